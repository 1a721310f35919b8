"""The whole models of several mazes, for the dm_control environment."""

from __future__ import annotations

import functools
from typing import Any

import mujoco

from mazebench.maps.moving_doors import StandingMazes
from mazebench.world.bodies import Body
from mazebench.world.mjcf import maze_spec

_MOST_GEOMS = 500_000  # in the models that are kept, some 1 kB each


class MazeModels:
    """The whole models of some mazes with a body; those used last are kept."""

    def __init__(self, mazes: StandingMazes, body: Body):
        self._mazes, self._body = mazes, body
        self._kept: dict[int, mujoco.MjModel] = {}  # the one used last at the end
        self._num_geoms = 0

    def __reduce__(self) -> tuple[Any, ...]:
        """Makes copies share the models, and pickles hold the mazes only."""
        return models_of, (self._mazes, self._body)

    def __getitem__(self, index: int) -> mujoco.MjModel:
        """Returns the whole model of maze number `index`; whoever changes it copies it.

        Raises:
          InputError: if MuJoCo can't put so large a model together in some seconds.
        """
        if (model := self._kept.pop(index, None)) is None:
            model = maze_spec(self._mazes[index], body=self._body).compile()
            self._num_geoms += model.ngeom
            while self._kept and self._num_geoms > _MOST_GEOMS:
                self._num_geoms -= self._kept.pop(next(iter(self._kept))).ngeom
        self._kept[index] = model
        return model


@functools.lru_cache(maxsize=8)
def models_of(mazes: StandingMazes, body: Body, /) -> MazeModels:
    """Returns the models of `mazes`, which all environments with these mazes and this body share."""
    return MazeModels(mazes, body)
