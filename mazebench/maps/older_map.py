"""An older map of a building, which agents are shown instead of the map of the maze that is built.

`N` is the number of cells on a side of the maze. `H` and `W` are the numbers of rows and columns of pixels.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from typing import Any

import numpy as np
import scipy

from mazebench.errors import InputError, remark
from mazebench.maps.maze import Maze
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.readers.occupancy_grid import LocatedMaze, OccupancyGrid, blocked_pixels

_LEAST_SHARED = 0.5  # of the free space of both maps together: less is another building, or another frame
_MOVED = 2.0  # m, by which a map is tried elsewhere
_BETTER = 0.05  # of the free space, by which it must fit better there for a user to be told
_TURN = 1e-3  # rad


@dataclasses.dataclass(frozen=True, eq=False)
class OlderMap:
    """An older map of the building of a maze, in the maze's cells. Its free cells need not be connected."""

    walls: np.ndarray  # [N, N] bool, True is wall
    maze: Maze

    @functools.cached_property
    def joined(self) -> np.ndarray:
        """`[N, N]` bool: the cells that are free in the maze and on the map, where ways on the map join them all."""
        return ~self.maze.walls & _largest_area(self.walls, self.maze)


def older_map(walls: np.ndarray, maze: Maze, name: str) -> OlderMap:
    """Returns an older map of `maze`, in whose cells `walls` (`[N, N]` bool) are.

    What is free on it, but apart from the building, and wall in the maze, is closed, as it is where a maze is read.

    Raises:
      InputError: if it shares too little free space with the maze; `name` is that of the map.
    """
    walls = walls | (maze.walls & ~_largest_area(walls, maze))
    walls[[0, -1]] = walls[:, [0, -1]] = True
    walls.flags.writeable = False
    shared = _shared(walls, maze.walls)
    if shared < _LEAST_SHARED:
        raise InputError(
            f"{name}: expected an older map of {maze.name}, with at least {_LEAST_SHARED:g} of the free space of both "
            f"in common, found {shared:.2f}; both must lie in one frame, in pixels finer than the cells"
        )

    # What a user should know: how much has changed, and whether the map fits better elsewhere.
    most = round(_MOVED / maze.cell_size)
    shifts = list(itertools.product(range(-most, most + 1), repeat=2))
    fits = [_shared(np.roll(walls, shift, axis=(0, 1)), maze.walls) for shift in shifts]
    down, right = shifts[int(np.argmax(fits))]
    better = f"; moved by ({right * maze.cell_size:g}, {-down * maze.cell_size:g}) m it would be {max(fits):.2f}"
    remark(
        f"{name}: {shared:.2f} of the free space is common with {maze.name}; {np.sum(maze.walls & ~walls)} cells are "
        f"wall now, {np.sum(walls & ~maze.walls)} are free now{better * (max(fits) > shared + _BETTER)}"
    )
    return OlderMap(walls, maze)


def _shared(walls: np.ndarray, others: np.ndarray) -> float:
    """Returns the intersection over union of what is free on two maps `[N, N]` bool."""
    return float(np.sum(~(walls | others)) / max(1, np.sum(~(walls & others))))


def one_for_each(shown: list[Any], num_mazes: int) -> list[Any]:
    """Returns as many older maps as there are mazes: those of each, or the one of all.

    Raises:
      InputError: if there are other numbers of them.
    """
    if len(shown) not in (1, num_mazes):
        raise InputError(f"expected an older map for each of {num_mazes} mazes, or one for all, found {len(shown)}")
    return shown if len(shown) == num_mazes else shown * num_mazes


def lay_on(
    older: OccupancyGrid, newer: OccupancyGrid, located: LocatedMaze, options: ReadOptions, name: str
) -> OlderMap:
    """Returns an older map in the cells of a maze that was read from a newer one.

    Maps of ROS are laid on each other by their origins. Pictures and cells must have one height and width. A cell is
    wall if one of its pixels is, or lies outside of the older map.

    Args:
      older: the pixels of the older map.
      newer: those of the map that the maze was read from.
      located: the maze, and where it lies on the newer map.
      options: of reading either.
      name: of the older map.

    Raises:
      InputError: if they can't be laid on each other, or share too little free space.
    """
    maze, (x, y, yaw) = located
    if newer.is_cells and older.is_cells:
        older = dataclasses.replace(older, resolution=maze.cell_size)
    wanted, found = (grid.frame or grid.states.shape for grid in (newer, older))
    if found != wanted:
        units = ("cells" if grid.is_cells else "pixels" for grid in (newer, older))
        wanted, found = (
            "a map with an origin" if each == "map" else "{1} x {0} {2}".format(*each, unit)
            for each, unit in zip((wanted, found), units, strict=True)
        )
        raise InputError(f"{name}: expected an older map of {wanted}, as {maze.name} is, found {found}")
    older_x, older_y, older_yaw = older.origin
    if abs(math.remainder(yaw - older_yaw, math.tau)) > _TURN:
        raise InputError(
            f"{name}: expected an older map that is turned by {yaw:g} rad, as {maze.name} is, found {older_yaw:g}"
        )

    # Where cells begin, in pixels from the left and from the top of the older map, and where the last ones end.
    cosine, sine = math.cos(yaw), math.sin(yaw)
    right = cosine * (x - older_x) + sine * (y - older_y)
    up = cosine * (y - older_y) - sine * (x - older_x)
    edges = np.arange(maze.size + 1) * maze.cell_size
    height, width = older.states.shape
    columns = np.rint((right + edges) / older.resolution).astype(int)
    rows = height - np.rint((up + edges[::-1]) / older.resolution).astype(int)

    # Whether one of their pixels is wall; with wall around the map, so much that cells beyond its end reach into it.
    walls = np.pad(blocked_pixels(older.states, options, older.resolution), (1, 2), constant_values=True)
    walls = np.logical_or.reduceat(walls, np.clip(rows, -1, height + 1) + 1, axis=0)[:-1]
    walls = np.logical_or.reduceat(walls, np.clip(columns, -1, width + 1) + 1, axis=1)[:, :-1]
    return older_map(walls, maze, name)


def _largest_area(walls: np.ndarray, maze: Maze) -> np.ndarray:
    """Returns `[N, N]` bool: the connected free area of a map that has the most free cells of the maze."""
    areas, _ = scipy.ndimage.label(~walls)
    counts = np.bincount(areas[~maze.walls & ~walls], minlength=1)
    return areas == counts.argmax() if counts.any() else np.zeros(walls.shape, dtype=bool)
