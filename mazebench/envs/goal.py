"""The local task as a goal-conditioned Gymnasium environment, for hindsight experience replay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np

from mazebench.constants import STATE_SIZE
from mazebench.envs import spaces
from mazebench.envs.gym import MazeEnv
from mazebench.errors import InputError
from mazebench.tasks.context import GOAL, NUM_PLANES
from mazebench.tasks.rules import reward
from mazebench.tasks.task import Task
from mazebench.tasks.task_options import SPARSE

_SHOWN_PLANES = [plane for plane in range(NUM_PLANES) if plane != GOAL]

# For arrays of goals, `info` is one mapping of arrays, or one mapping for each goal.
Infos = Mapping[str, Any] | Sequence[Mapping[str, Any]]


class GoalMazeEnv(MazeEnv):
    """A `MazeEnv` that shows the goal in `desired_goal` only, so that it can be replaced by another one afterwards.

    Observations:

    - observation: `[12 + 3 M M]` float32: the state, then the planes of the context that do not show the goal (the map,
      the map around the start, the start), row by row.
    - achieved_goal: `[2]` float32: the centre (x, y) in m of the cell in which the body truly is.
    - desired_goal: `[2]` float32: the centre of the goal cell.
    - what the `sensors` observe; in pictures there is no disc at the goal, which hindsight would leave where it was.

    `compute_reward`, `compute_terminated` and `compute_truncated` return what a step that led to `achieved_goal` gives
    if the goal is `desired_goal`. They take single goals and arrays of goals.
    """

    _shows_goal = False

    def __init__(self, task: Task, seed: int | None = None, render_mode: str | None = None, camera: str = "top"):
        # A track may hide the body's position and has its own time limits, and the goals would tell what is hidden.
        if task.has_legs or task.options.track is not None or task.options.hide:
            raise InputError("a goal-conditioned environment: expected the local task, one goal, no track, no hide")
        if task.options.reward != SPARSE:  # another goal's way is not known
            raise InputError(
                f"a goal-conditioned environment: expected reward {SPARSE!r}, found {task.options.reward!r}"
            )
        super().__init__(task, seed, render_mode, camera)
        side, num_values = task.mazes[0].side, STATE_SIZE + len(_SHOWN_PLANES) * task.context_size**2
        sensed = {name: spaces.observation_space(task)[name] for name in task.options.sensors}
        self.observation_space = gymnasium.spaces.Dict(
            {
                "observation": gymnasium.spaces.Box(-np.inf, np.inf, (num_values,), np.float32),
                "achieved_goal": gymnasium.spaces.Box(0.0, side, (2,), np.float32),
                "desired_goal": gymnasium.spaces.Box(0.0, side, (2,), np.float32),
                **sensed,
            }
        )

    def compute_reward(self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Infos) -> np.ndarray:
        """Returns `[...]` float: the reward where the achieved goal `[..., 2]` is the desired one; ignores `info`."""
        return reward(self.compute_terminated(achieved_goal, desired_goal, info))

    def compute_terminated(self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Infos) -> np.ndarray:
        """Returns `[...]` bool: where the achieved goal `[..., 2]` is the desired one; ignores `info`."""
        # Exact, because equal cells have equal centres as float32.
        return (np.asarray(achieved_goal) == np.asarray(desired_goal)).all(axis=-1)

    def compute_truncated(self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Infos) -> np.ndarray:
        """Returns `[...]` bool: where the goal was not reached and `info["steps"]` is at the time limit."""
        steps = info["steps"] if isinstance(info, Mapping) else np.array([each["steps"] for each in info])
        return (steps >= self.task.options.time_limit) & ~self.compute_terminated(achieved_goal, desired_goal, info)

    def _observation(self) -> dict[str, np.ndarray]:
        shown = super()._observation()
        maze = self.task.mazes[self.runner.episode.maze]
        planes = shown.pop("context")[_SHOWN_PLANES]
        return {
            "observation": np.concatenate([shown.pop("state"), planes.ravel()]),
            "achieved_goal": maze.point(maze.cell(self.simulation.position())).astype(np.float32),
            "desired_goal": maze.point(self.runner.route.goal).astype(np.float32),
            **shown,
        }
