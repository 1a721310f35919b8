"""The whole models of several mazes, for pictures and for the dm_control environment.

Where a maze has too many boxes for a whole model, a picture's model has no walls: the picture is given the boxes.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import mujoco
import numpy as np

from mazebench.maps.drawn import Mazes
from mazebench.world.mjcf import has_whole_model, largest_spec, require_whole, wall_boxes

_MOST_SHOWN = 500_000  # things in the models that are kept, some 1 kB each


class Seen(NamedTuple):
    """A model that shows a maze, and the walls that it lacks."""

    model: mujoco.MjModel
    data: mujoco.MjData  # which anybody may overwrite
    middle: np.ndarray  # [K, 3] m, of wall boxes that the model lacks because they are too many
    half: np.ndarray  # [K, 3] m, their half sides

    @property
    def num_shown(self) -> int:
        """The number of things in a picture."""
        return self.model.ngeom + self.model.nsite + len(self.middle)


class MazeModels:
    """The models that show some mazes, whole where a maze has a whole model; those used last are kept."""

    def __init__(self, mazes: Mazes):
        self._mazes = mazes
        self._kept: dict[int, Seen] = {}  # the one used last at the end
        self._num_shown = 0

    def __reduce__(self) -> tuple[Any, ...]:
        """Makes copies share the models, and pickles hold the mazes only."""
        return models_of, (self._mazes,)

    def __getitem__(self, index: int) -> mujoco.MjModel:
        """Returns the whole model of maze number `index`; whoever changes it copies it.

        Raises:
          InputError: if MuJoCo can't put so large a model together in some seconds.
        """
        require_whole(self._mazes[index])
        return self.seen(index).model

    def seen(self, index: int) -> Seen:
        """Returns what shows maze number `index`."""
        if (found := self._kept.pop(index, None)) is None:
            maze = self._mazes[index]
            model = largest_spec(maze).compile()
            lacking = np.zeros((2, 0, 3)) if has_whole_model(maze) else wall_boxes(maze)
            found = Seen(model, mujoco.MjData(model), *lacking)
            self._num_shown += found.num_shown
            while self._kept and self._num_shown > _MOST_SHOWN:
                self._num_shown -= self._kept.pop(next(iter(self._kept))).num_shown
        self._kept[index] = found
        return found


@functools.lru_cache(maxsize=8)
def models_of(mazes: Mazes, /) -> MazeModels:
    """Returns the models of `mazes`, which all environments with these mazes share."""
    return MazeModels(mazes)
