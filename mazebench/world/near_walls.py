"""The walls near a body, which are all that its physics needs: one small model for all mazes of a task.

`B` is the number of environments, `E` of those whose bodies have entered other cells, `N` the cells a side of a maze,
`K` the boxes of the model, and `W` the cells of the window around a cell.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import mujoco
import mujoco.batch
import numpy as np

from mazebench.constants import STEP_TIME
from mazebench.kernels import compiled
from mazebench.maps.maze import WALL_HEIGHT, Maze
from mazebench.maps.moving_doors import ChangingMazes, MovedMaze, StandingMazes, moving_doors
from mazebench.world.bodies import Body
from mazebench.world.mjcf import boxes_spec, parked_boxes

_MOST_GRIDS = 64  # of mazes, those used last
_FIRST_WALL = 1  # index of its geom, after the floor
# Contacts are searched without trees of bounding boxes, and not sorted into islands, of which one body has one.
_NOT_NEEDED = int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE | mujoco.mjtDisableBit.mjDSBL_ISLAND)


class WallGeoms(NamedTuple):
    """The arrays of the wall boxes in the models of B environments; what is written there is simulated."""

    pos: np.ndarray  # [B, K, 3] m
    size: np.ndarray  # [B, K, 3] m, half sides
    aabb: np.ndarray  # [B, K, 6] m, middle and half sides in the box's own frame
    rbound: np.ndarray  # [B, K] m, the radius of a sphere around the box

    @classmethod
    def of_model(cls, model: Any) -> WallGeoms:
        """Returns those of a single model."""
        return cls(*(getattr(model, f"geom_{name}")[None, _FIRST_WALL:-1] for name in cls._fields))

    @classmethod
    def of_batch(cls, batch: mujoco.batch.Batch) -> WallGeoms:
        """Returns those of all simulations of a batch, each of which then has its own."""
        return cls(*(batch.expand(f"geom_{name}")[:, _FIRST_WALL:-1] for name in cls._fields))


class NearWalls:
    """The boxes near each cell of some mazes, and the model that holds them.

    The boxes are those of the maze's whole model, in the same order, that a body can touch within an agent step. They
    are found by their first cells in a window around the body's cell. The window's middle is free, so that `K` = W - 1
    boxes are enough for any cell.
    """

    def __init__(self, mazes: StandingMazes, num_slots: int, body: Body):
        """`num_slots` is how many mazes are kept: all of them or, of fresh or changing ones, one per environment."""
        self._mazes, self._size, self._scale = mazes, mazes[0].size, mazes[0].cell_size
        self._args, self._is_fresh = (mazes, num_slots, body), not isinstance(mazes, tuple)
        self._grids: dict[int, tuple[np.ndarray, np.ndarray]] = {}  # by maze: what `_grid` returns of those shown last
        # From the body's centre at the start of an agent step.
        reach = math.ceil((body.reach + body.fastest * STEP_TIME) / self._scale)  # cells
        width = self._size + 2 * reach
        self._offsets = (np.arange(2 * reach + 1)[:, None] * width + np.arange(2 * reach + 1)).ravel()  # [W]
        self._width, self._reach = width, reach
        self.num_boxes = len(self._offsets) - 1
        self._parked = parked_boxes(self.num_boxes, self._scale)

        # By slot and cell. A cell is row * N + column; `_none` stands for no box, in free cells and around the maze.
        self._none = self._size**2
        self._shown = np.full(num_slots, -1, dtype=np.int64)  # the maze that a slot has
        self._first = np.zeros((num_slots, width * width), dtype=np.int32)  # of a wall cell, the first cell of its box
        self._end = np.zeros((num_slots, self._none, 2), dtype=np.int16)  # of a first cell, the box's bottom and right

        self.model = boxes_spec(mazes[0], *self._parked, body=body).compile()
        self.model.opt.disableflags |= _NOT_NEEDED

    def __reduce__(self) -> tuple[Any, ...]:
        """Makes pickles hold the mazes only."""
        return near_walls_of, self._args

    def write(self, geoms: WallGeoms, env: np.ndarray, maze: np.ndarray, cell: np.ndarray) -> None:
        """Writes the boxes near cells into the models of environments.

        Args:
          geoms: of B environments; changed.
          env: `[E]` int, whose models are written to.
          maze: `[E]` int, the index of the maze that each is in.
          cell: `[E]` int, the body's cell in it, as row * N + column.
        """
        slot = env if self._is_fresh else maze
        for at, shown in {(int(slot[i]), int(maze[i])) for i in np.flatnonzero(self._shown[slot] != maze)}:
            self._show(at, shown)
        _place(
            self._first, self._end, slot, cell, self._offsets, self._width, self._size, self._scale, self._parked, env,
            *geoms,
        )  # fmt: skip

    def _show(self, slot: int, maze: int) -> None:
        """Puts a maze into a slot."""
        stands = self._mazes[maze]
        closed = stands.moved if isinstance(stands, MovedMaze) and stands.only_closed else ()
        grid, self._end[slot] = self._grid(maze % len(self._mazes) if closed else maze)
        if closed:
            grid = grid.copy()
            inner = grid.reshape(self._width, -1)[self._reach :, self._reach :]
            for door in closed:
                inner[door.cells()] = door.top * self._size + door.left
        self._first[slot] = grid  # at once, because environments in other threads may read it
        self._shown[slot] = maze

    def _grid(self, maze: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns what `_first` and `_end` have of a maze, and the ends of its doors when they close."""
        if (kept := self._grids.pop(maze, None)) is None:
            built = self._mazes[maze]
            boxes = np.array(built.boxes, dtype=np.int64)  # [boxes, 4]: top, left, bottom, right
            top, left, bottom, right = boxes.T
            first = top * self._size + left
            end = np.zeros(self._end.shape[1:], dtype=self._end.dtype)
            end[first] = boxes[:, 2:]
            if isinstance(self._mazes, ChangingMazes):
                for door in moving_doors(built.as_built):
                    if not built.walls[door.top, door.left]:  # else a box of the maze has its cells
                        end[door.top * self._size + door.left] = door.bottom, door.right

            # All cells of all boxes, one box after the other.
            columns = right - left
            area = (bottom - top) * columns
            box = np.repeat(np.arange(len(boxes)), area)
            within = np.arange(len(box)) - np.repeat(np.cumsum(area) - area, area)
            row, column = top[box] + within // columns[box], left[box] + within % columns[box]
            grid = np.full_like(self._first[0], self._none)
            grid[(row + self._reach) * self._width + column + self._reach] = first[box]
            kept = grid, end
            if len(self._grids) >= _MOST_GRIDS:
                self._grids.pop(next(iter(self._grids)))
        self._grids[maze] = kept
        return kept


@compiled
def _place(
    first: np.ndarray, end: np.ndarray, slots: np.ndarray, cells: np.ndarray, offsets: np.ndarray, width: int,
    size: int, scale: float, parked: tuple[np.ndarray, np.ndarray], envs: np.ndarray,
    pos: np.ndarray, half: np.ndarray, aabb: np.ndarray, rbound: np.ndarray,
) -> None:  # fmt: skip
    """Writes the boxes in the windows around cells into the `WallGeoms` of environments, as `placed_boxes` would.

    The first of the arrays are attributes of `NearWalls`.
    """
    near = np.empty(len(offsets), dtype=np.int64)  # the first cells of boxes
    for number, env in enumerate(envs):
        slot, row, column = slots[number], cells[number] // size, cells[number] % size

        # The boxes in the window, each once, in the maze's order.
        count = 0
        for offset in offsets:
            box = first[slot, row * width + column + offset]
            place = count
            while place > 0 and near[place - 1] > box:
                place -= 1
            if box < size * size and (place == 0 or near[place - 1] < box):
                for behind in range(count, place, -1):
                    near[behind] = near[behind - 1]
                near[place] = box
                count += 1

        for box in range(pos.shape[1]):
            if box < count:
                top, left = near[box] // size, near[box] % size
                bottom, right = end[slot, near[box], 0], end[slot, near[box], 1]
                pos[env, box, 0], half[env, box, 0] = scale * (left + right) / 2, scale * (right - left) / 2
                pos[env, box, 1], half[env, box, 1] = scale * (size - (top + bottom) / 2), scale * (bottom - top) / 2
                pos[env, box, 2] = half[env, box, 2] = WALL_HEIGHT / 2
            else:  # it is not needed, and lies below the floor
                for axis in range(3):
                    pos[env, box, axis], half[env, box, axis] = parked[0][box, axis], parked[1][box, axis]
            squared = 0.0
            for axis in range(3):
                aabb[env, box, 3 + axis] = half[env, box, axis]
                squared += half[env, box, axis] * half[env, box, axis]
            rbound[env, box] = math.sqrt(squared)


def near_walls_of(mazes: StandingMazes, num_envs: int, body: Body) -> NearWalls:
    """Returns the near walls of mazes for some environments; all environments with the same fixed mazes share them."""
    return _of_fixed(mazes, body) if isinstance(mazes, tuple) else NearWalls(mazes, num_envs, body)


@functools.lru_cache(maxsize=8)
def _of_fixed(mazes: tuple[Maze, ...], body: Body) -> NearWalls:
    return NearWalls(mazes, len(mazes), body)
