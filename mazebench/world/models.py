"""The models of a set of mazes of one size, compiled when first asked for, and how one takes another's place."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from mazebench.errors import InputError
from mazebench.maps.covering import cover
from mazebench.maps.maze import Maze
from mazebench.world.mjcf import build_spec

# The only fields in which two models of one `MazeModels` differ (a test compares all the others).
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
    """A sequence of `MjModel`, one for each maze, whose `MjData` all have one layout."""

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

    def __getitem__(self, index: int) -> mujoco.MjModel:
        model = self._models[index]
        if model is None:
            model = build_spec(self._mazes[index], self._covers[index], self._num_boxes).compile()
            self._models[index] = model
        return model


def copy_maze(source: mujoco.MjModel, target: mujoco.MjModel) -> None:
    """Turns `target` into the maze of `source`; both must come from one `MazeModels`."""
    for field in _MAZE_FIELDS:
        np.copyto(getattr(target, field), getattr(source, field))
