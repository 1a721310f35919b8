"""The models of several mazes of one size and scale, and how one model is turned into another."""

from __future__ import annotations

import copy
import functools
from typing import Any

import mujoco
import numpy as np

from mazebench.maps.drawn import FreshMazes, Mazes
from mazebench.maps.maze import Maze, require_one_size
from mazebench.world.mjcf import build_spec, wall_boxes
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
_FIRST_WALL = 1  # index of its geom, after the floor
_NO_TREE = int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)  # contacts are searched without trees of bounding boxes


class MazeModels:
    """The `MjModel` of each of some mazes, compiled on first use; the `MjData` of all of them have one layout.

    Of fresh mazes, only the first one is compiled. Others are written into copies of its model, without a tree of
    bounding boxes, in which MuJoCo would search for contacts; so it looks at all walls.
    """

    def __init__(self, mazes: Mazes, textures: bool = False):
        """With `textures`, the models have the textured look, which only pictures need."""
        self._mazes = mazes
        self._textures = textures
        self._models: dict[int, mujoco.MjModel] = {}
        self._faces, self._num_faces = [], 0
        if isinstance(mazes, FreshMazes):
            self._num_boxes = mazes.max_boxes
            return
        require_one_size(mazes)
        self._num_boxes = max(len(maze.boxes) for maze in mazes)
        if textures:
            self._faces = [wall_faces(maze) for maze in mazes]
            self._num_faces = max(map(len, self._faces))

    def __len__(self) -> int:
        return len(self._mazes)

    def __reduce__(self) -> tuple[Any, ...]:
        """Makes copies share the models, and pickles hold the mazes only."""
        return models_of, (self._mazes, self._textures)

    def __getitem__(self, index: int) -> mujoco.MjModel:
        if index not in self._models:
            spec = build_spec(self._mazes[index], self._num_boxes)
            if self._textures:
                add_textures(spec, self._mazes[index], self._faces[index], self._num_faces)
            model = self._models[index] = spec.compile()
            if isinstance(self._mazes, FreshMazes):
                model.opt.disableflags |= _NO_TREE
        return self._models[index]

    def first_models(self, count: int) -> list[mujoco.MjModel]:
        """Returns `count` models of the first maze: copies if mazes are fresh, else one and the same."""
        if isinstance(self._mazes, FreshMazes):
            return [copy.copy(self[0]) for _ in range(count)]
        return [self[0]] * count

    def replaced(self, model: mujoco.MjModel, index: int) -> mujoco.MjModel:
        """Returns a model of maze number `index`; if mazes are fresh, `model` itself, which it changes."""
        if not isinstance(self._mazes, FreshMazes):
            return self[index]
        self.load(index, model)
        return model

    def load(self, index: int, model: Any) -> None:
        """Puts maze number `index` into `model`, a copy of one of these models, or dm_control's wrapper of one."""
        if isinstance(self._mazes, FreshMazes):
            _write_maze(self._mazes[index], self._num_boxes, model)
        else:
            copy_maze(self[index], model)


def models_of(mazes: Mazes, textures: bool = False) -> MazeModels:
    """Returns the models of `mazes`, which all environments with these mazes share."""
    return _models_of(mazes, textures)  # the cache tells `textures=False` from the default


@functools.lru_cache(maxsize=8)
def _models_of(mazes: Mazes, textures: bool) -> MazeModels:
    return MazeModels(mazes, textures)


def copy_maze(source: mujoco.MjModel, target: Any) -> None:
    """Copies the maze of `source` into `target`; both must come from one `MazeModels`."""
    for field in _MAZE_FIELDS:
        np.copyto(getattr(target, field), getattr(source, field))


def _write_maze(maze: Maze, num_boxes: int, model: Any) -> None:
    """Writes what the walls of `maze` are into `model`, as MuJoCo compiles them, but for the tree of bounding boxes."""
    walls = slice(_FIRST_WALL, _FIRST_WALL + num_boxes)
    middle, half = wall_boxes(maze, num_boxes)
    model.geom_pos[walls] = middle
    model.geom_size[walls] = model.geom_aabb[walls, 3:] = half
    model.geom_rbound[walls] = np.sqrt((half * half).sum(axis=1))
    model.key_qpos[0, :2] = maze.point(maze.free_cells[0])
