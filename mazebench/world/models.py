"""The models of several mazes of one size, and how one model is turned into another."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from mazebench.errors import InputError
from mazebench.maps.covering import cover
from mazebench.maps.maze import Maze
from mazebench.world.mjcf import build_spec

# The only fields in which two models of one `MazeModels` differ. A test compares all others.
_MAZE_FIELDS = (
    "geom_aabb",
    "geom_pos",
    "geom_rbound",
    "geom_size",
    "bvh_aabb",
    "bvh_child",
    "bvh_depth",
    "bvh_nodeid",
    "key_qpos",
)


class MazeModels:
    """The `MjModel` of each of some mazes, compiled on first use; the `MjData` of all of them have one layout."""

    def __init__(self, mazes: Sequence[Maze]):
        sizes = sorted({maze.size for maze in mazes})
        if len(sizes) != 1:
            raise InputError(f"expected mazes of one size, found sizes {sizes}")
        self._mazes = mazes
        self._covers = [cover(maze.walls) for maze in mazes]
        self._num_boxes = max(map(len, self._covers))
        self._models: list[mujoco.MjModel | None] = [None] * len(mazes)

    def __len__(self) -> int:
        return len(self._mazes)

    def __reduce__(self) -> tuple[Any, ...]:
        """Makes copies share the models, and pickles hold the mazes only."""
        return models_of, (tuple(self._mazes),)

    def __getitem__(self, index: int) -> mujoco.MjModel:
        model = self._models[index]
        if model is None:
            model = build_spec(self._mazes[index], self._covers[index], self._num_boxes).compile()
            self._models[index] = model
        return model


@functools.lru_cache(maxsize=4)
def models_of(mazes: tuple[Maze, ...]) -> MazeModels:
    """Returns the models of `mazes`, which all environments with these mazes share."""
    return MazeModels(mazes)


def copy_maze(source: mujoco.MjModel, target: mujoco.MjModel) -> None:
    """Copies the maze of `source` into `target`; both must come from one `MazeModels`."""
    for field in _MAZE_FIELDS:
        np.copyto(getattr(target, field), getattr(source, field))
