"""Occupancy grids, which every file is read as, and the maze in one.

`H` and `W` are the numbers of rows and columns of pixels of a grid, `R` and `C` of cells. Row 0 is on top. In a grid of
cells, such as a text, each pixel is a cell.
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import cv2
import numpy as np
import scipy

from mazebench.errors import InputError, remark
from mazebench.maps.maze import MAX_CHOSEN_SIZE, MAX_SIZE, MIN_CELL_SIZE, MIN_SIZE, Maze, MazeError
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.readers.areas import areas_of, choose, describe_areas, enclose, lay_cells

Pose = tuple[float, float, float]  # x, y (m), yaw (rad)

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
_TOLERANCE = 1e-3  # pixels by which a cell may miss a whole number of them
_MANY_CLOSED = 0.05  # share of the free cells of which a user would miss rooms
_MIN_INVERTED = 0.25  # share of wall from which one connected wall in free cells is taken for the free cells


@dataclasses.dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """States of the pixels of a map."""

    states: np.ndarray  # [H, W] int8: FREE, OCCUPIED or UNKNOWN
    resolution: float = 1.0  # m, the side of a pixel
    origin: Pose = (0.0, 0.0, 0.0)  # of the lower left corner
    changes: tuple[str, ...] = ()  # how the states differ from the file's, in words
    shades: str = ""  # of the picture, and what they mean, in words
    is_cells: bool = False  # whether each pixel is a cell, of the size that the options say
    # What the origin counts from: "map" is the frame of a map, which others share; else a picture's height and width.
    frame: str | tuple[int, int] | None = None  # None: H and W
    is_defined: bool = False  # whether the format says what is wall, so that free and wall can't be mixed up


class LocatedMaze(NamedTuple):
    """A maze, and where it lies in the map that it was made of."""

    maze: Maze
    origin: Pose = (0.0, 0.0, 0.0)  # of the maze's lower left corner in the map's frame


def locate_maze(grid: OccupancyGrid, options: ReadOptions, name: str) -> LocatedMaze:
    """Returns one connected free area of `grid` as a maze.

    Rows and columns around the grid of which nothing is known are cut off. A cell is wall if one of its pixels is. The
    area is the one that has the cell or point `options.area`. If none is given, it is the largest one, or the largest
    enclosed one of a fair size if the largest is the ground around it. All others are closed. Wall is added where the
    border is open, then on the right or at the bottom until the maze is square. A `Remark` says what was changed.

    Raises:
      InputError: if an option does not fit the grid.
      MazeError: if nothing is free, or the maze would be too large or too small.
    """
    if grid.is_cells:
        grid = dataclasses.replace(grid, resolution=options.cell_size or 1.0)
        if not grid.is_defined:
            _require_not_inverted(grid.states, name)

    # Which pixels can't be driven on, and the cells made of them.
    known = grid.states != UNKNOWN
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    top, left = (int(rows[0]), int(columns[0])) if len(rows) else (0, 0)
    states = grid.states[top : rows[-1] + 1, left : columns[-1] + 1] if len(rows) else grid.states
    blocked = blocked_pixels(states, options, grid.resolution)
    pixels = 1 if grid.is_cells else _cell_pixels(blocked, grid.resolution, options, name)
    cell_size = options.cell_size or round(pixels * grid.resolution, 9)
    cells = lay_cells(blocked, pixels)
    if cells.walls.all():
        wall, unknown, free = (100 * (grid.states == state).mean() for state in (OCCUPIED, UNKNOWN, FREE))
        raise MazeError(
            f"{name}: expected a free cell of {cell_size:g} m, found none; {wall:.0f} % of the map is wall, "
            f"{unknown:.0f} % unknown, {free:.0f} % free{'; ' * bool(grid.shades)}{grid.shades}"
        )

    # One area, closed all around.
    areas = areas_of(cells, blocked)
    enclosed = [enclose(area.cells, 0 if grid.is_cells else MIN_SIZE) for area in areas]
    number, is_found = choose(areas, enclosed, options.area, cell_size)
    row, column, height, width, walls = enclosed[number]
    size = max(height, width, len(walls))
    if size > MAX_SIZE:
        remedy = "save it as a ROS map, which is coarsened" if grid.is_cells else "give a larger cell_size"
        raise MazeError(f"{name}: expected at most {MAX_SIZE} cells a side, found {size} of {cell_size:g} m; {remedy}")
    maze = Maze(walls, name, cell_size)

    # Where the maze lies, in pixels from the edges of the map.
    from_left, from_top = left + cells.right + column * pixels, top + cells.down + row * pixels
    from_below = len(grid.states) - from_top - size * pixels
    x, y, yaw = grid.origin
    right, up = from_left * grid.resolution, from_below * grid.resolution
    cosine, sine = math.cos(yaw), math.sin(yaw)
    origin = x + cosine * right - sine * up, y + sine * right + cosine * up, yaw

    # What a user should know.
    changes = [*grid.changes, *["nothing on it is wall"] * (not (states == OCCUPIED).any())]
    if pixels > 1:
        shape = "{1} x {0}".format(*grid.states.shape)
        changes.append(f"{shape} pixels of {grid.resolution:g} m as cells of {cell_size:g} m")
    if len(areas) > 1:
        changes.append(describe_areas(areas, enclosed, number, cell_size))
    if not is_found:
        changes.append(f"none has {options.area}")
    num_free = int((~cells.walls).sum())
    num_closed = num_free - areas[number].num_cells
    if num_closed:
        share = f"{num_closed:,} of {num_free:,} free cells ({100 * num_closed / num_free:.0f} %)"
        changes.append(f"{share} closed that can't be reached from the others")
    beyond = np.array([from_top + (height - 1) * pixels, from_left + (width - 1) * pixels]) - grid.states.shape
    if min(from_top, from_left) < 0 or max(beyond) >= 0:
        changes.append("wall added along its border")
    if height < size or width < size:
        changes.append(f"{height} x {width} cells padded with wall to {size} x {size}")
    if grid.is_cells and (from_top or from_left):
        changes.append(f"its cell (r, c) is ({_shifted('r', from_top)}, {_shifted('c', from_left)}) in the maze")
    if changes or from_left or from_below:
        remark(f"{name}: {'; '.join([*changes, _describe_corner(origin)])}")
    num_lost = num_closed - sum(area.num_cells for area in areas if area.is_ground and area is not areas[number])
    if num_lost > _MANY_CLOSED * num_free:
        advice = {
            "a smaller --cell-size": pixels > _fewest_pixels(grid.resolution),
            "a smaller --inflate": options.inflate > 0,
            "--unknown free": options.unknown == "wall" and bool((states == UNKNOWN).any()),
            "without text, furniture and door swings on the plan": options.pixel_size is not None,
        }
        if any(advice.values()):
            remark(f"{name}: if rooms are missing, try {', or '.join(way for way, helps in advice.items() if helps)}")
    return LocatedMaze(maze, origin)


def _require_not_inverted(states: np.ndarray, name: str) -> None:
    """Raises `MazeError` if the walls look like the free cells of a maze, and the free cells like its walls."""
    border = np.ones(states.shape, dtype=bool)
    border[1:-1, 1:-1] = False
    walls = states == OCCUPIED
    is_free_around = (states != UNKNOWN).all() and not walls[border].any()
    if is_free_around and walls.mean() >= _MIN_INVERTED and scipy.ndimage.label(walls)[1] == 1:
        raise MazeError(
            f"{name}: expected free cells within walls, found one connected wall within free cells; is it inverted? "
            "1 is wall, and so are # and 100"
        )


def _cell_pixels(blocked: np.ndarray, resolution: float, options: ReadOptions, name: str) -> int:
    """Returns the pixels on a side of a cell of `options.cell_size`.

    If none is given, it is the smallest of at least `MIN_CELL_SIZE` of which a maze has enough.
    """
    fewest = _fewest_pixels(resolution)
    if options.cell_size:
        pixels = max(round(options.cell_size / resolution), fewest)
        if abs(options.cell_size / resolution - pixels) > _TOLERANCE:
            raise InputError(
                f"{name}: expected a cell_size of at least {MIN_CELL_SIZE} m and of a whole number of pixels of "
                f"{resolution:g} m, such as {pixels * resolution:g}, found {options.cell_size:g}"
            )
        return pixels
    if max(blocked.shape) <= fewest * MAX_CHOSEN_SIZE:
        return fewest
    free = [np.flatnonzero(~blocked.all(axis=axis)) for axis in (0, 1)]
    longest = max((int(np.ptp(indices)) + 1 for indices in free if len(indices)), default=1)
    # Beside these pixels there are walls, and the first and the last cell of them may be cut.
    return max(fewest, math.ceil(longest / (MAX_CHOSEN_SIZE - 3)))


def _fewest_pixels(resolution: float) -> int:
    """Returns the pixels on a side of the smallest cells of at least `MIN_CELL_SIZE`."""
    return max(1, math.ceil(MIN_CELL_SIZE / resolution - _TOLERANCE))


def blocked_pixels(states: np.ndarray, options: ReadOptions, resolution: float) -> np.ndarray:
    """Returns which pixels of `states`, `resolution` m wide, can't be driven on: `[H, W]` bool.

    Unknown areas that reach the edge lie outside of the building and are always wall.
    """
    is_unknown = states == UNKNOWN
    if options.unknown == "free":
        areas, _ = scipy.ndimage.label(is_unknown)
        edges = np.concatenate([areas[0], areas[-1], areas[:, 0], areas[:, -1]])
        is_unknown &= np.isin(areas, edges)
    return _inflate((states == OCCUPIED) | is_unknown, options.inflate / resolution)


def _inflate(walls: np.ndarray, num_pixels: float) -> np.ndarray:
    """Returns `walls` with all pixels whose centre is at most `num_pixels` from the centre of one of them."""
    if num_pixels == 0 or not walls.any():
        return walls
    distances = cv2.distanceTransform((~walls).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(distances <= num_pixels + _TOLERANCE)


def _describe_corner(origin: Pose) -> str:
    """Returns where the maze lies on a map and, if it is not turned, where a point of the map lies in the maze."""
    x, y, yaw = (round(number, 6) + 0.0 for number in origin)  # + 0.0: no -0
    corner = f"the maze's lower left corner is ({x:g}, {y:g}) m on the map"
    if yaw:
        return f"{corner}, turned by {yaw:g} rad"
    if x == y == 0:
        return corner
    return f"{corner}, so its point (x, y) is ({_shifted('x', x)}, {_shifted('y', y)}) m in the maze"


def _shifted(name: str, by: float) -> str:
    """Returns a coordinate less a number, in words."""
    return f"{name} {'+' if by < 0 else '-'} {abs(by):g}" if by else name
