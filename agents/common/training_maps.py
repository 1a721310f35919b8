"""The maps of the mazes that are trained in, turned by a symmetry, as networks read them."""

from __future__ import annotations

import functools

import numpy as np
import torch

from mazebench.errors import InputError
from mazebench.tasks.context import build_context
from mazebench.tasks.episode import sample_episode
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.task import Task
from mazebench.tasks.task_options import SPARSE

from . import symmetry
from .replay import Contexts

_NUM_KEPT = 2**16  # mazes whose walls are kept, in bits; a million rows of experience have about half as many


class TrainingMaps:
    """The maps of a task's mazes; a symmetry of 0 leaves them as they are. `G` is the number of a sample's groups."""

    def __init__(self, task: Task):
        self._bits = functools.lru_cache(_NUM_KEPT)(lambda maze: np.packbits(task.standing[maze].walls))
        self.size = task.size  # N
        self._context_size = task.context_size  # M

    def walls(self, maze: int) -> np.ndarray:
        """Returns `[N, N]` bool: the walls of the maze with a number."""
        bits = np.unpackbits(self._bits(maze), count=self.size**2)
        return bits.astype(bool).reshape(self.size, self.size)

    def contexts(self, contexts: Contexts, turned: int) -> torch.Tensor:
        """Returns the contexts `[G, 4, M, M]` of a sample's groups, turned by the symmetry `turned`."""
        shown = map(self.walls, contexts.maze.tolist()) if contexts.shown is None else contexts.shown
        planes = [
            build_context(walls, divmod(start, self.size), divmod(goal, self.size), self._context_size)
            for walls, start, goal in zip(shown, contexts.start.tolist(), contexts.goal.tolist(), strict=True)
        ]
        return symmetry.turn_planes(torch.from_numpy(np.stack(planes)), turned)

    def marks(self, cell: np.ndarray, turned: int) -> torch.Tensor:
        """Returns the positions `[G, 2]` (row, column) at which turned contexts mark the cells `[G]`."""
        marks = np.stack(np.divmod(cell, self.size), axis=-1) * self._context_size // self.size
        return symmetry.turn_cells(torch.from_numpy(marks).float(), self._context_size, turned)

    def positions(self, cell: np.ndarray, turned: int) -> torch.Tensor:
        """Returns the positions `[..., 2]` (row, column) of true cells `[...]` on turned contexts."""
        cells = torch.from_numpy(np.stack(np.divmod(cell, self.size), axis=-1)).float()
        return symmetry.turn_cells(cells, self.size, turned) * (self._context_size / self.size)


def shows_other_maps(task: Task, agent: str) -> bool:
    """Returns whether the maps that `task` shows may be others than those of its mazes.

    Raises:
      InputError: if the maps are drawn or lack marks, or a reward is asked for, which the learner of `agent` does not
        read.
    """
    name = f"agent {agent!r}"
    if task.options.reward != SPARSE:
        raise InputError(f"{name}: computes the rewards of any goal itself, found reward {task.options.reward!r}")
    if task.options.track is None and not task.options.active_perturbations:
        return False

    episode = sample_episode(task, np.random.default_rng(0))
    shown = [show_map(task.replace(level=level), episode) for level in task.levels or (None,)]
    if any(each.drawing is not None or each.hidden for each in shown):
        found = "map_warp" if task.options.track is None else f"track {task.options.track!r}"
        raise InputError(f"{name}: learns only on maps of one pixel a cell with start and goal marked; found {found}")
    return True
