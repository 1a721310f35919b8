"""Experience to learn from.

`B` is the number of environments. A cell is given by its index, row * N + column.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from mazebench.agent import Observation


class Scene(NamedTuple):
    """The truth of B environments before a step, by the names that `Experience` has for it."""

    cell: np.ndarray
    pose: np.ndarray
    velocity: np.ndarray
    maze: np.ndarray
    start: np.ndarray
    goal: np.ndarray
    step: np.ndarray
    doors: Sequence[Any]


class Experience(NamedTuple):
    """One agent step in B environments.

    Rewards and ends are those of the goal that the agent was sent to; for another goal, they follow from the cells.
    """

    state: np.ndarray  # [B, 12] float32, observed before the step
    action: np.ndarray  # [B] int
    cell: np.ndarray  # [B] int, the body's true cell before the step
    pose: np.ndarray  # [B, 3] float64, its true x and y (m) and yaw (rad)
    velocity: np.ndarray  # [B, 2] float64, the true one on the map (m/s)
    new_episode: np.ndarray  # [B] bool, whether a trajectory begins with this step
    new_context: np.ndarray  # [B] bool, whether a trajectory or the leg to another goal begins with this step
    maze: np.ndarray  # [B] int, index among the task's mazes
    start: np.ndarray  # [B] int, the cell where the leg started
    goal: np.ndarray  # [B] int, the cell where the leg leads
    reward: np.ndarray  # [B] float32, for the step
    terminated: np.ndarray  # [B] bool, whether the step reached the goal
    ended: np.ndarray  # [B] bool, whether the trajectory ends with this step
    final_state: np.ndarray  # [B, 12] float32, observed after the step where it ended; undefined elsewhere
    final_cell: np.ndarray  # [B] int, likewise
    context: np.ndarray  # [B, 4, M, M] float32, observed before the step
    sensors: Observation  # [B, ...] by the sensor's name, observed before the step
    stream: int  # the seed of the trajectories, which begin anew at a milestone
    notes: Any  # what the agent's `notes` returned
    step: np.ndarray | None = None  # [B] int, the steps since the episode began
    doors: Sequence[Any] = ()  # B of `mazebench.tasks.schedule.Schedule`, None where no door moves
