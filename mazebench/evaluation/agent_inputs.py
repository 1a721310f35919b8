"""The inputs of agents besides observations: seeds of their own and, if they declare that they need it, the truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mazebench.agent import Truth
from mazebench.tasks.episode import Episode
from mazebench.tasks.task import Task


def agent_seed(run_seed: int, number: int) -> int:
    """Returns the seed of an agent's own draws in episode `number` of a run.

    It reveals nothing of the episode, whose flips, warp and noise come from `Episode.seed`.
    """
    return int(np.random.SeedSequence([run_seed, number]).generate_state(1)[0])


def true_state(task: Task, episodes: Sequence[Episode | None], position: np.ndarray, yaw: np.ndarray) -> Truth:
    """Returns the truth of B environments.

    Args:
      task: the task, with the mazes that the episodes index.
      episodes: the running ones; None where an environment rests, where the truth is a maze without a goal.
      position: `[B, 2]` m, true.
      yaw: `[B]` rad, true.
    """
    mazes = [task.mazes[episode.maze if episode else 0] for episode in episodes]
    goals = [episode.goal if episode else (0, 0) for episode in episodes]
    pose = np.column_stack([position, yaw]).astype(np.float64)
    return Truth(np.stack([maze.walls for maze in mazes]), pose, np.array(goals, dtype=np.int64))
