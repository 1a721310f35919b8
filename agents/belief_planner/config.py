"""The config of the belief planner, with the reason for each number."""

from __future__ import annotations

from mazebench.options import options

from ..common.ranges import Count, Factor, Share, Size, Steps, Updates


@options
class BeliefPlannerConfig:
    """The learned belief, sized for half an hour on one core.

    Raises:
      InputError: if a value is out of its range.
    """

    channels: Size = 32  # of each layer; some 80,000 weights together
    dilations: tuple[Size, ...] = (1, 1, 2, 4, 8, 1, 2, 4)  # of the layers, which see 24 cells far
    batch_size: Count = 32  # scenes in an update
    lost_share: Share = 0.125  # of updates from scenes where the place on the map is unknown; they are larger
    task_share: Share = 0.5  # of layouts that are from the task's mazes; the others are of our own
    least_size: Size = 13  # cells on a side of a scene, drawn from this to the task's
    near_weight: Factor = 4.0  # of cells near seen ones, beside the 1 of all: the next decisions are made there
    near_cells: Size = 6  # how near
    goal_weight: Factor = 0.1  # of the goal's loss beside that of the walls; most marks are right
    learning_rate: Factor = 3e-3  # AdamW's; in short runs, 4e-3 learned more than 1e-3
    num_updates: Updates = 8_000  # half an hour on one core; the learning rate falls to a hundredth along half a cosine
    weight_decay: Factor = 1e-4  # AdamW's
    max_gradient_norm: Factor = 1.0  # to which a longer gradient is shortened
    num_envs: Count = 4  # played side by side; nothing is learned from them, they only pace the updates
    min_rows: Steps = 4  # before the first update
    steps_per_update: Steps = 4  # few, since they bring nothing
    epsilon_base: Share = 0.0  # no random actions
    epsilon_alpha: Factor = 0.0  # likewise
