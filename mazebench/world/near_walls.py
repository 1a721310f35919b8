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
from mazebench.maps.maze import Maze
from mazebench.maps.moving_doors import ChangingMazes, MovedMaze, StandingMazes, moving_doors
from mazebench.world.bodies import Body
from mazebench.world.mjcf import boxes_spec, parked_boxes, placed_boxes

_MOST_ENTERED = 10_000  # cells whose boxes are kept, some 1 kB each
_MOST_GRIDS = 64  # of mazes, those used last
_AHEAD = 2  # cells around the one that is entered whose boxes are found in advance
_FEW = 4  # bodies in other cells, whose boxes are sooner looked up one by one
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
        # By maze: what `_grid` returns of those that were shown last; [N, N] int, the set of its doors near each cell.
        self._grids: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._near_doors: dict[int, np.ndarray] = {}
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

        self._entered: dict[tuple[int, int], list[np.ndarray]] = {}  # by maze and cell: what `_near` returns

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
        if len(env) <= _FEW:
            for where in zip(maze.tolist(), cell.tolist(), env.tolist(), strict=True):
                self.write_one(geoms, *where)
            return
        slot = env if self._is_fresh else maze
        for at, shown in {(int(slot[i]), int(maze[i])) for i in np.flatnonzero(self._shown[slot] != maze)}:
            self._show(at, shown)
        _assign(geoms, env, *self._near(slot, cell))

    def write_one(self, geoms: WallGeoms, maze: int, cell: int, env: int = 0) -> None:
        """Does what `write` does for a single environment, and prepares the cells around, which take little longer."""
        key = self._stands(maze, cell), cell
        if (boxes := self._entered.get(key)) is None:
            slot = env if self._is_fresh else maze
            if self._shown[slot] != maze:
                self._show(slot, maze)
            if len(self._entered) > _MOST_ENTERED:
                self._entered.clear()
            row, column = divmod(cell, self._size)
            rows, columns = (slice(max(0, at - _AHEAD), at + _AHEAD + 1) for at in (row, column))
            cells = np.argwhere(~self._mazes[maze].walls[rows, columns]) + np.array([rows.start, columns.start])
            near = np.append(cells @ (self._size, 1), cell)  # which is a wall where there is no body
            rows_of = zip(near.tolist(), *self._near(np.full(len(near), slot), near), strict=True)
            found = {(self._stands(maze, each), each): values for each, *values in rows_of}
            self._entered |= found
            boxes = found[key]
        _assign(geoms, env, *boxes)

    def _stands(self, maze: int, cell: int) -> int:
        """Returns the number of a maze that has the same walls near a cell, with no door moved elsewhere."""
        if maze < (count := len(self._mazes)):
            return maze
        moved, maze = divmod(maze, count)
        if (near := self._near_doors.get(maze)) is None:
            near = self._near_doors[maze] = np.zeros((self._size, self._size), dtype=np.int64)
            for number, (top, left, bottom, right, _) in enumerate(moving_doors(self._mazes[maze])):
                first_row, first_column = max(0, top - self._reach), max(0, left - self._reach)
                near[first_row : bottom + self._reach, first_column : right + self._reach] |= 1 << number
        return maze + count * (moved & near.item(cell))

    def _near(self, slot: np.ndarray, cell: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns middles, half sides (`[E, K, 3]` m) and radii (`[E, K]` m) of the boxes near cells of slots."""
        # The boxes in the window, each once, in the maze's order.
        row, column = np.divmod(cell, self._size)
        boxes = self._first[slot[:, None], (row * self._width + column)[:, None] + self._offsets]  # [E, W]
        boxes.sort(axis=1)
        boxes[:, 1:][boxes[:, 1:] == boxes[:, :-1].copy()] = self._none
        boxes.sort(axis=1)
        boxes = boxes[:, : self.num_boxes]
        is_box = boxes < self._none

        # Those that are not needed are below the floor.
        first = np.where(is_box, boxes, 0)
        top, left = np.divmod(first, self._size)
        bottom, right = np.moveaxis(self._end[slot[:, None], first], -1, 0)
        placed = placed_boxes(top, left, bottom, right, self._size, self._scale)
        middle, half = (np.where(is_box[..., None], *pair) for pair in zip(placed, self._parked, strict=True))
        return middle, half, np.sqrt((half * half).sum(axis=-1))

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


def _assign(geoms: WallGeoms, env: np.ndarray | int, middle: np.ndarray, half: np.ndarray, radius: np.ndarray) -> None:
    geoms.pos[env] = middle
    geoms.size[env] = half
    geoms.aabb[env, :, 3:] = half
    geoms.rbound[env] = radius


def near_walls_of(mazes: StandingMazes, num_envs: int, body: Body) -> NearWalls:
    """Returns the near walls of mazes for some environments; all environments with the same fixed mazes share them."""
    return _of_fixed(mazes, body) if isinstance(mazes, tuple) else NearWalls(mazes, num_envs, body)


@functools.lru_cache(maxsize=8)
def _of_fixed(mazes: tuple[Maze, ...], body: Body) -> NearWalls:
    return NearWalls(mazes, len(mazes), body)
