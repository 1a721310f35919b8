"""The whole models of several mazes, for pictures and for the dm_control environment."""

from __future__ import annotations

import functools
from typing import Any

import mujoco

from mazebench.maps.drawn import Mazes
from mazebench.world.mjcf import maze_spec
from mazebench.world.textures import add_textures

_MOST_GEOMS = 500_000  # of the models that are kept, some 1 kB each


class MazeModels:
    """The whole model of each of some mazes, with data to compute what a picture shows; those used last are kept."""

    def __init__(self, mazes: Mazes, textures: bool = False):
        """With `textures`, the models have the textured look, which only pictures need."""
        self._mazes, self._textures = mazes, textures
        self._kept: dict[int, tuple[mujoco.MjModel, mujoco.MjData]] = {}  # the one used last at the end
        self._num_geoms = 0

    def __reduce__(self) -> tuple[Any, ...]:
        """Makes copies share the models, and pickles hold the mazes only."""
        return models_of, (self._mazes, self._textures)

    def __getitem__(self, index: int) -> mujoco.MjModel:
        """Returns the model of maze number `index`; whoever changes it copies it."""
        return self.with_data(index)[0]

    def with_data(self, index: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Returns the model of maze number `index` and data of it, which anybody may overwrite.

        Raises:
          InputError: if MuJoCo can't put so large a model together in some seconds.
        """
        if (found := self._kept.pop(index, None)) is None:
            spec = maze_spec(self._mazes[index])
            if self._textures:
                add_textures(spec, self._mazes[index])
            model = spec.compile()
            found = model, mujoco.MjData(model)
            self._num_geoms += model.ngeom
            while self._kept and self._num_geoms > _MOST_GEOMS:
                oldest, _ = self._kept.pop(next(iter(self._kept)))
                self._num_geoms -= oldest.ngeom
        self._kept[index] = found
        return found


def models_of(mazes: Mazes, textures: bool = False) -> MazeModels:
    """Returns the models of `mazes`, which all environments with these mazes share."""
    return _models_of(mazes, textures)  # the cache tells `textures=False` from the default


@functools.lru_cache(maxsize=8)
def _models_of(mazes: Mazes, textures: bool) -> MazeModels:
    return MazeModels(mazes, textures)
