"""An older map of a building, which agents are shown instead of the map of the maze that is built.

`N` is the number of cells on a side of the maze. `H` and `W` are the numbers of rows and columns of pixels.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np
import scipy

from mazebench.errors import InputError, remark
from mazebench.maps.align import LEAST_FIT, align, fit, moved
from mazebench.maps.maze import Maze
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.pair import Pair, compared
from mazebench.maps.readers.occupancy_grid import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    LocatedMaze,
    OccupancyGrid,
    Pose,
    blocked_pixels,
    moved_into,
    states_in_cells,
)

_LEAST_COVERED = 2 / 3  # of the smaller free space; of maps of one size, half of the free space of both together
_MOST_SQUARES = 8  # along a side of a cell, in which maps are compared


@dataclasses.dataclass(frozen=True, eq=False)
class OlderMap:
    """An older map of the building of a maze, in the maze's cells. Its free cells need not be connected."""

    walls: np.ndarray  # [N, N] bool, True is wall
    maze: Maze
    pair: Pair | None = None  # None if the maze was made of the map
    origin: Pose = (0.0, 0.0, 0.0)  # of the maze's lower left corner in the map's frame

    @functools.cached_property
    def joined(self) -> np.ndarray:
        """`[N, N]` bool: the cells that are free in the maze and on the map, where ways on the map join them all."""
        return ~self.maze.walls & _largest_area(self.walls, self.maze)


def one_for_each(shown: list[Any], num_mazes: int) -> list[Any]:
    """Returns as many older maps as there are mazes: those of each, or the one of all.

    Raises:
      InputError: if there are other numbers of them.
    """
    if len(shown) not in (1, num_mazes):
        raise InputError(f"expected an older map for each of {num_mazes} mazes, or one for all, found {len(shown)}")
    return shown if len(shown) == num_mazes else shown * num_mazes


def lay_on(
    older: OccupancyGrid,
    newer: OccupancyGrid,
    located: LocatedMaze,
    options: ReadOptions,
    name: str,
    is_aligned: bool = False,
) -> OlderMap:
    """Returns an older map in the cells of a maze that was read from a newer one, and remarks how they differ.

    Maps of ROS are laid on each other by their origins. Pictures and cells must have one height and width. A cell is
    wall if one of its pixels is, or is unknown, or lies outside of the older map. What is free on the older map, but
    apart from the building, and wall in the maze, is closed, as it is where a maze is read.

    Args:
      older: the pixels of the older map.
      newer: those of the map that the maze was read from.
      located: the maze, and where it lies on the newer map.
      options: of reading either.
      name: of the older map.
      is_aligned: True if the older map is turned and moved by `align` first, instead of being laid by its origin.

    Raises:
      InputError: if they can't be laid on each other, or the larger one covers too little of the free space of the
        smaller one.
    """
    maze, pose = located.maze, None
    older, newer = (
        dataclasses.replace(grid, resolution=maze.cell_size) if grid.is_cells else grid for grid in (older, newer)
    )
    if is_aligned:
        pose = align(older, newer, name)
        older = moved(older, pose)
    else:
        _require_one_frame(older, newer, name, maze.name)
    covered, met = fit(older, newer)
    if covered < _LEAST_COVERED:
        raise InputError(
            f"{name}: expected an older map of {maze.name}, with at least {_LEAST_COVERED:.2f} of the free space of "
            f"the smaller one in common, found {covered:.2f}; "
            + ("it lies where its walls fit best" if is_aligned else "if it is turned or moved, try --align")
        )

    # Its walls in the cells of the maze; what is not shown is wall.
    blocked = dataclasses.replace(
        older, states=np.where(blocked_pixels(older.states, options, older.resolution), OCCUPIED, FREE)
    )
    walls = states_in_cells(blocked, located.origin, maze.cell_size, maze.walls.shape) != FREE
    walls |= maze.walls & ~_largest_area(walls, maze)
    walls[[0, -1]] = walls[:, [0, -1]] = True
    walls.flags.writeable = False

    # What both maps show, in squares that are about as wide as the pixels of the newer one.
    squares = min(_MOST_SQUARES, max(1, round(maze.cell_size / newer.resolution)))
    shown, built = (
        states_in_cells(
            _with_thick_walls(grid, options), located.origin, maze.cell_size / squares, (maze.size * squares,) * 2
        )
        for grid in (older, newer)
    )
    pair = compared(shown, built, maze.size, maze.cell_size, covered, pose)
    hint = "" if is_aligned or covered * met >= LEAST_FIT else "; few walls lie on each other: try --align"
    remark(f"{name}: {pair.describe(maze.name)}{hint}")
    origin = located.origin if pose is None else moved_into(located.origin, pose)
    return OlderMap(walls, maze, pair, origin)


def _require_one_frame(older: OccupancyGrid, newer: OccupancyGrid, name: str, of: str) -> None:
    """Raises `InputError` unless two maps have origins, or as many pixels."""
    wanted, found = (grid.frame or grid.states.shape for grid in (newer, older))
    if found != wanted:
        units = ("cells" if grid.is_cells else "pixels" for grid in (newer, older))
        wanted, found = (
            "a map with an origin" if each == "map" else "{1} x {0} {2}".format(*each, unit)
            for each, unit in zip((wanted, found), units, strict=True)
        )
        raise InputError(
            f"{name}: expected an older map of {wanted}, as {of} is, found {found}; --align takes others, too"
        )


def _with_thick_walls(grid: OccupancyGrid, options: ReadOptions) -> OccupancyGrid:
    """Returns a map whose walls are as thick as where a maze is read; what is unknown stays unknown."""
    is_wall = blocked_pixels(grid.states, options, grid.resolution) & (grid.states != UNKNOWN)
    return dataclasses.replace(grid, states=np.where(is_wall, OCCUPIED, grid.states))


def _largest_area(walls: np.ndarray, maze: Maze) -> np.ndarray:
    """Returns `[N, N]` bool: the connected free area of a map that has the most free cells of the maze."""
    areas, _ = scipy.ndimage.label(~walls)
    counts = np.bincount(areas[~maze.walls & ~walls], minlength=1)
    return areas == counts.argmax() if counts.any() else np.zeros(walls.shape, dtype=bool)
