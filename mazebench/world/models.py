"""The models of several mazes of one size and scale, and how one model is turned into another."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from mazebench.maps.covering import cover
from mazebench.maps.maze import Maze, require_one_size
from mazebench.world.mjcf import build_spec
from mazebench.world.textures import add_textures, wall_faces

# The only fields in which two models of one `MazeModels` differ. A test compares all others.
_MAZE_FIELDS = (
    "geom_aabb",
    "geom_matid",
    "geom_pos",
    "geom_quat",
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

    def __init__(self, mazes: Sequence[Maze], textures: bool = False):
        """With `textures`, the models have the textured look, which only pictures need."""
        require_one_size(mazes)
        self._mazes = mazes
        self._covers = [cover(maze.walls) for maze in mazes]
        self._num_boxes = max(map(len, self._covers))
        self._textures = textures
        self._faces = [wall_faces(maze) if textures else [] for maze in mazes]
        self._num_faces = max(map(len, self._faces))
        self._models: list[mujoco.MjModel | None] = [None] * len(mazes)

    def __len__(self) -> int:
        return len(self._mazes)

    def __reduce__(self) -> tuple[Any, ...]:
        """Makes copies share the models, and pickles hold the mazes only."""
        return models_of, (tuple(self._mazes), self._textures)

    def __getitem__(self, index: int) -> mujoco.MjModel:
        model = self._models[index]
        if model is None:
            maze = self._mazes[index]
            spec = build_spec(maze, self._covers[index], self._num_boxes)
            if self._textures:
                add_textures(spec, maze, self._faces[index], self._num_faces)
            model = self._models[index] = spec.compile()
        return model


def models_of(mazes: tuple[Maze, ...], textures: bool = False) -> MazeModels:
    """Returns the models of `mazes`, which all environments with these mazes share."""
    return _models_of(mazes, textures)  # the cache tells `textures=False` from the default


@functools.lru_cache(maxsize=8)
def _models_of(mazes: tuple[Maze, ...], textures: bool) -> MazeModels:
    return MazeModels(mazes, textures)


def copy_maze(source: mujoco.MjModel, target: mujoco.MjModel) -> None:
    """Copies the maze of `source` into `target`; both must come from one `MazeModels`."""
    for field in _MAZE_FIELDS:
        np.copyto(getattr(target, field), getattr(source, field))
