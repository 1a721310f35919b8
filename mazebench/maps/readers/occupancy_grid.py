"""Occupancy grids, such as maps of ROS, as mazes.

`H` and `W` are the numbers of rows and columns of pixels of a grid, `R` and `C` of cells. Row 0 is on top.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
from scipy import ndimage

from mazebench.errors import InputError, remark
from mazebench.maps.grids import largest_area, pad_to_square
from mazebench.maps.maze import MAX_CHOSEN_SIZE, MAX_SIZE, MIN_CELL_SIZE, MIN_SIZE, Maze, MazeError
from mazebench.maps.maze_options import ReadOptions

Pose = tuple[float, float, float]  # x, y (m), yaw (rad)

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
_TOLERANCE = 1e-3  # pixels by which a cell may miss a whole number of them
_SURE_CELL_SIZE = 0.5  # m, from which agents that steer by their pose seldom miss a goal
_MANY_CLOSED = 0.05  # share of the free cells of which a user would miss rooms


@dataclasses.dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """States of the pixels of a map."""

    states: np.ndarray  # [H, W] int8: FREE, OCCUPIED or UNKNOWN
    resolution: float  # m, the side of a pixel
    origin: Pose = (0.0, 0.0, 0.0)  # of the lower left corner
    changes: tuple[str, ...] = ()  # how the states differ from the file's, in words


class LocatedMaze(NamedTuple):
    """A maze, and where it lies in the map that it was made of."""

    maze: Maze
    origin: Pose = (0.0, 0.0, 0.0)  # of the maze's lower left corner in the map's frame


def locate_maze(grid: OccupancyGrid, options: ReadOptions, name: str) -> LocatedMaze:
    """Returns the largest connected free area of `grid` as a maze.

    Rows and columns around the grid of which nothing is known are cut off. A cell is wall if one of its pixels is. Free
    cells that can't be reached are closed. Wall is added where the border is open, then on the right or at the bottom
    until the maze is square. A `Remark` says what was changed.

    Raises:
      InputError: if the size of the cells is no multiple of the grid's resolution.
      MazeError: if nothing is free, or the maze would be too large or too small.
    """
    # Which pixels can't be driven on.
    top, left, states = _without_unknown_margin(grid.states)
    blocked = _inflate(_walls(states, options.unknown), options.inflate / grid.resolution)

    # Cells of several pixels.
    if not options.cell_size:
        pixels = _smallest_cell_pixels(blocked, grid.resolution)
    else:
        pixels = _cell_pixels(options.cell_size, grid.resolution)
    cell_size = options.cell_size or round(pixels * grid.resolution, 9)
    cells = _coarsen(blocked, pixels)
    if cells.all():
        raise MazeError(
            f"{name}: expected a free cell, found none of {cell_size:g} m; unknown cells: {options.unknown}"
        )

    # The largest area of free cells, closed all around.
    walls = largest_area(cells)
    num_free, num_closed = int((~cells).sum()), int(walls.sum() - cells.sum())
    area = walls
    row, column, walls = _close_border(area)
    maze = Maze(_checked_size(pad_to_square(walls), cell_size, name), name, cell_size)

    # Where the maze lies, in pixels from the left and from the lower edge of the map.
    from_left = left + column * pixels
    from_below = len(grid.states) - top - (row + maze.size) * pixels
    origin = _moved(grid.origin, from_left * grid.resolution, from_below * grid.resolution)

    # What a user should know.
    changes, hints = list(grid.changes), []
    if pixels > 1:
        height, width = grid.states.shape
        changes.append(f"{width} x {height} pixels of {grid.resolution:g} m as cells of {cell_size:g} m")
    if cell_size < _SURE_CELL_SIZE:
        sure = math.ceil(_SURE_CELL_SIZE / grid.resolution - _TOLERANCE) * grid.resolution
        hints.append(
            f"agents drive surely in cells from {_SURE_CELL_SIZE:g} m; if doors are at least {2 * sure:g} m wide, try "
            f"--cell-size {sure:g}"
        )
    if num_closed:
        share = num_closed / num_free
        part = f"{num_closed:,} of {num_free:,} free cells ({100 * share:.0f} %)"
        changes.append(f"{part} closed that can't be reached from the others")
        if share > _MANY_CLOSED:
            hints.extend(_reasons_to_close(states, pixels, grid.resolution, options))
    if min(row, column) < 0 or max(np.subtract(walls.shape, area.shape)) > 0:
        changes.append("wall added around an open border")
    elif not changes and (from_left, from_below) != (0, 0):
        changes.append("a margin without free cells cut off")
    if walls.shape != maze.walls.shape:
        changes.append(f"{walls.shape[0]} x {walls.shape[1]} cells padded with wall to {maze.size} x {maze.size}")
    if changes:
        changes.append(_describe_corner(origin))
        remark(f"{name}: {'; '.join(changes)}")
    if hints:
        remark(f"{name}: {'; '.join(hints)}")
    return LocatedMaze(maze, origin)


def _without_unknown_margin(states: np.ndarray) -> tuple[int, int, np.ndarray]:
    """Returns the first row, the first column, and the grid without the rows and columns around it that are unknown."""
    known = states != UNKNOWN
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        return 0, 0, states
    return int(rows[0]), int(columns[0]), states[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def _smallest_cell_pixels(blocked: np.ndarray, resolution: float) -> int:
    """Returns the pixels on a side of the smallest cells of at least `MIN_CELL_SIZE` of which a maze has enough."""
    pixels = _fewest_pixels(resolution)
    if max(blocked.shape) <= pixels * MAX_CHOSEN_SIZE:
        return pixels
    free = [np.flatnonzero(~blocked.all(axis=axis)) for axis in (0, 1)]
    longest = max((int(np.ptp(indices)) + 1 for indices in free if len(indices)), default=1)
    # Beside these pixels there are walls, and the first and the last cell of them may be cut.
    return max(pixels, math.ceil(longest / (MAX_CHOSEN_SIZE - 3)))


def _cell_pixels(cell_size: float, resolution: float) -> int:
    """Returns the pixels on a side of a cell of `cell_size`.

    Raises:
      InputError: if that is no whole number of them, or the body does not fit through such a cell.
    """
    pixels = max(round(cell_size / resolution), _fewest_pixels(resolution))
    if abs(cell_size / resolution - pixels) > _TOLERANCE:
        raise InputError(
            f"expected a cell_size of at least {MIN_CELL_SIZE} m and of a whole number of pixels of {resolution:g} m, "
            f"such as {pixels * resolution:g}, found {cell_size:g}"
        )
    return pixels


def _fewest_pixels(resolution: float) -> int:
    """Returns the pixels on a side of the smallest cells of at least `MIN_CELL_SIZE`."""
    return max(1, math.ceil(MIN_CELL_SIZE / resolution - _TOLERANCE))


def _reasons_to_close(states: np.ndarray, pixels: int, resolution: float, options: ReadOptions) -> Iterator[str]:
    """Yields what may have cut off free cells, in words, and what to try against it."""
    if pixels > 1:
        remedy = ", try a smaller --cell-size" if pixels > _fewest_pixels(resolution) else ""
        yield f"doors narrower than two cells ({2 * pixels * resolution:g} m) may close{remedy}"
    if options.pixel_size is not None:
        yield "text, furniture and door swings on a plan are walls too, erase them"
    if options.unknown == "wall" and (_walls(states, "wall") != _walls(states, "free")).any():
        yield "unknown cells are wall, try --unknown free"
    if options.inflate:
        yield "walls are inflated, try a smaller --inflate"


def _describe_corner(origin: Pose) -> str:
    """Returns where the maze lies on a map and, if it is not turned, where a point of the map lies in the maze."""
    x, y, yaw = (round(number, 6) + 0.0 for number in origin)  # + 0.0: no -0
    corner = f"the maze's lower left corner is ({x:g}, {y:g}) m on the map"
    if yaw:
        return f"{corner}, turned by {yaw:g} rad"
    if x == y == 0:
        return corner
    shifted = (f"{name} {'+' if at < 0 else '-'} {abs(at):g}" if at else name for name, at in (("x", x), ("y", y)))
    return f"{corner}, so its point (x, y) is ({', '.join(shifted)}) m in the maze"


def _walls(states: np.ndarray, unknown: str) -> np.ndarray:
    """Returns `[H, W]` bool; unknown areas that reach the edge lie outside of the building and are always wall."""
    is_unknown = states == UNKNOWN
    if unknown == "free":
        areas, _ = ndimage.label(is_unknown)
        edges = np.concatenate([areas[0], areas[-1], areas[:, 0], areas[:, -1]])
        is_unknown &= np.isin(areas, edges)
    return (states == OCCUPIED) | is_unknown


def _inflate(walls: np.ndarray, num_pixels: float) -> np.ndarray:
    """Returns `walls` with all pixels whose centre is at most `num_pixels` from the centre of one of them."""
    if num_pixels == 0 or not walls.any():
        return walls
    distances = cv2.distanceTransform((~walls).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(distances <= num_pixels + _TOLERANCE)


def _coarsen(walls: np.ndarray, pixels: int) -> np.ndarray:
    """Returns `[R, C]` bool: the cells of `pixels` x `pixels` in which there is wall or an end of the grid."""
    height, width = (-length % pixels for length in walls.shape)
    padded = np.pad(walls, ((0, height), (0, width)), constant_values=True)
    rows, columns = (length // pixels for length in padded.shape)
    return np.any(padded.reshape(rows, pixels, columns, pixels), axis=(1, 3))


def _close_border(walls: np.ndarray) -> tuple[int, int, np.ndarray]:
    """Returns the grid with a row or column of wall where its border is open, and with the first row and column of it.

    If it is too large for a maze, it is cut to the free cells and the walls next to them.
    """
    row = column = 0
    if max(walls.shape) > MAX_SIZE:
        rows, columns = (np.flatnonzero(~walls.all(axis=axis)) for axis in (1, 0))
        row, column = int(max(0, rows[0] - 1)), int(max(0, columns[0] - 1))
        walls = walls[row : rows[-1] + 2, column : columns[-1] + 2]
    is_open = [not edge.all() for edge in (walls[0], walls[-1], walls[:, 0], walls[:, -1])]
    closed = np.pad(walls, np.array(is_open, dtype=int).reshape(2, 2), constant_values=True)
    return row - is_open[0], column - is_open[2], closed


def _checked_size(walls: np.ndarray, cell_size: float, name: str) -> np.ndarray:
    if len(walls) > MAX_SIZE:
        raise MazeError(
            f"{name}: expected at most {MAX_SIZE} cells a side, found {len(walls)} of {cell_size:g} m; "
            "give a larger cell_size"
        )
    missing = max(0, MIN_SIZE - len(walls))
    return np.pad(walls, ((0, missing), (0, missing)), constant_values=True)


def _moved(origin: Pose, x: float, y: float) -> Pose:
    """Returns the pose of the point (x, y) of a frame that lies at `origin`."""
    x0, y0, yaw = origin
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return x0 + cosine * x - sine * y, y0 + sine * x + cosine * y, yaw
