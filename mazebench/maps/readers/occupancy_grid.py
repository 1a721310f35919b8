"""Occupancy grids, which every file is read as, and the maze in one.

`H` and `W` are the numbers of rows and columns of pixels of a grid, `R` and `C` of cells. Row 0 is on top. In a grid of
cells, such as a text, each pixel is a cell.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, NamedTuple

import cv2
import numpy as np
import scipy

from mazebench.constants import SLIDER_RADIUS
from mazebench.errors import InputError, remark
from mazebench.maps.maze import MAX_CHOSEN_SIZE, MAX_SIZE, MIN_CELL_SIZE, MIN_SIZE, Maze, MazeError
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.places import cell_of_place
from mazebench.maps.readers.areas import (
    Area,
    Cells,
    Enclosed,
    Rim,
    areas_of,
    choose,
    describe_areas,
    enclose,
    lay_cells,
    outside_of,
)
from mazebench.maps.readers.directions import turn_of_walls
from mazebench.maps.readers.lost_regions import lost_regions, reach_from
from mazebench.maps.readers.narrow_ways import WORTH_REACHING, nodes_of, open_ways

Pose = tuple[float, float, float]  # x, y (m), yaw (rad)

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
_TOLERANCE = 1e-3  # pixels by which a cell may miss a whole number of them
_TIE = 1e-6  # of a pixel or cell, by which a centre on an edge lies right of it or above
_ROWS_AT_ONCE = 256
_MANY_CLOSED = 0.05  # share of the body's positions of which a user would miss rooms
_MANY_LOST, _MOST_NAMED = 2.0, 3  # m2 of positions in a region whose loss a user is told; such regions
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


@dataclasses.dataclass(frozen=True, eq=False)
class _Seen:
    """The pixels of a map as they lie, and the cells over them."""

    picture: OccupancyGrid
    clear: np.ndarray  # [H, W] float, m to the nearest pixel that is not free
    cell_of: np.ndarray  # [H, W] int, of free pixels row * C + column; -1 where no cell is
    is_turned: bool  # whether the cells are

    def at(self, cells: np.ndarray) -> np.ndarray:
        """Returns the values of the pixels' cells, `[R, C]` bool, True where no cell is: `[H, W]`."""
        return np.append(cells.ravel(), True)[self.cell_of]


def states_in_cells(grid: OccupancyGrid, origin: Pose, cell_size: float, shape: tuple[int, int]) -> np.ndarray:
    """Returns the states of cells that are laid over a map at any pose: `[R, C]` int8.

    A cell has the pixels whose centre lies in it, and the one under its own centre. It is OCCUPIED if one of them is,
    else UNKNOWN if one is or lies outside of the map, else FREE.

    Args:
      grid: the map.
      origin: of the cells' lower left corner, in the frame of the map's own origin.
      cell_size: in metres; it may be below the resolution.
      shape: R and C.
    """
    states = np.pad(grid.states, 1, constant_values=UNKNOWN)
    height, width = states.shape
    corner = np.array([-1.0, -1.0]) * grid.resolution  # of the padded pixels, in the frame that is turned as the map is
    cells_in_map = _moved(origin, grid.origin)
    map_in_cells = _moved(grid.origin, origin)

    # The pixel under the centre of each cell; some rows at a time, as there may be as many cells as pixels.
    laid = np.empty(shape, dtype=np.int8)
    right = (np.arange(shape[1]) + 0.5) * cell_size
    for begin in range(0, shape[0], _ROWS_AT_ONCE):
        rows = np.arange(begin, min(begin + _ROWS_AT_ONCE, shape[0]))
        x, y = _transformed(cells_in_map, right, (shape[0] - rows[:, None] - 0.5) * cell_size)
        columns = np.clip(np.floor((x - corner[0]) / grid.resolution + _TIE), 0, width - 1).astype(np.intp)
        from_below = np.clip(np.floor((y - corner[1]) / grid.resolution + _TIE), 0, height - 1).astype(np.intp)
        laid[rows] = states[height - 1 - from_below, columns]

    # The cell of each pixel at the rim of its state; what is inside of an area lies with others of it.
    for state in (UNKNOWN, OCCUPIED):
        has_state = (states == state).astype(np.uint8)
        rows, columns = np.nonzero(has_state & (cv2.erode(has_state, np.ones((3, 3)), borderValue=0) == 0))
        x, y = _transformed(
            map_in_cells,
            corner[0] + (columns + 0.5) * grid.resolution,
            corner[1] + (height - rows - 0.5) * grid.resolution,
        )
        to_right, up = (np.floor(along / cell_size + _TIE).astype(np.intp) for along in (x, y))
        down = shape[0] - 1 - up
        is_inside = (down >= 0) & (down < shape[0]) & (to_right >= 0) & (to_right < shape[1])
        down, to_right = down[is_inside], to_right[is_inside]
        laid[down, to_right] = np.where(laid[down, to_right] == OCCUPIED, OCCUPIED, state)
    return laid


def _moved(origin: Pose, into: Pose) -> Pose:
    """Returns an origin in the frame of another origin."""
    x, y, yaw = origin
    cosine, sine = math.cos(into[2]), math.sin(into[2])
    right, up = x - into[0], y - into[1]
    return cosine * right + sine * up, cosine * up - sine * right, yaw - into[2]


def _transformed(origin: Pose, right: Any, up: Any) -> tuple[Any, Any]:
    """Returns points that are given from an origin in the frame of that origin; exactly so if it is not turned."""
    x, y, yaw = origin
    if not yaw:
        return x + right, y + up
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return x + cosine * right - sine * up, y + sine * right + cosine * up


def locate_maze(grid: OccupancyGrid, options: ReadOptions, name: str, radius: float = SLIDER_RADIUS) -> LocatedMaze:
    """Returns one connected free area of `grid` as a maze.

    Rows and columns around the grid of which nothing is known are cut off. If pixels are finer than cells, cells lie
    along the walls. A cell is wall if one of its pixels is. The area is the one that has the cell or point
    `options.area`. If none is given, it is the largest one, or the largest enclosed one of a fair size if the largest
    is the ground around it. Cells are opened where a body of `radius` m reaches more of the building on the pixels. All
    other areas are closed. Wall is added where the border is open, then on the right or at the bottom until the maze is
    square. A `Remark` says what was changed.

    Raises:
      InputError: if an option does not fit the grid.
      MazeError: if nothing is free, or the maze would be too large or too small.
    """
    if grid.is_cells:
        grid = dataclasses.replace(grid, resolution=options.cell_size or 1.0)
        if not grid.is_defined:
            _require_not_inverted(grid.states, name)

    # Which pixels can't be driven on, and the cells made of them, along the walls if these are slanted.
    picture, turn, all_states = _known_part(grid), 0.0, grid.states
    if not grid.is_cells and _fewest_pixels(grid.resolution, radius) > 1:
        turn = turn_of_walls(picture.states == FREE, picture.states == OCCUPIED, grid.resolution)
    grid = _turned(picture, turn) if turn else grid
    part = _known_part(grid)
    blocked = blocked_pixels(part.states, options, grid.resolution)
    pixels = 1 if grid.is_cells else _cell_pixels(blocked, grid.resolution, options, name, radius)
    cell_size = options.cell_size or round(pixels * grid.resolution, 9)
    rim = _rim(picture, part, cell_size) if turn else None
    cells = lay_cells(blocked, pixels, rim)
    if cells.walls.all():
        wall, unknown, free = (100 * (all_states == state).mean() for state in (OCCUPIED, UNKNOWN, FREE))
        raise MazeError(
            f"{name}: expected a free cell of {cell_size:g} m, found none; {wall:.0f} % of the map is wall, "
            f"{unknown:.0f} % unknown, {free:.0f} % free{'; ' * bool(grid.shades)}{grid.shades}"
        )

    # One area, with the ways that are too narrow for cells, closed all around.
    areas = areas_of(cells, blocked, rim)
    enclosed = [enclose(area.cells, 0 if grid.is_cells else MIN_SIZE) for area in areas]
    number, is_found = choose(areas, enclosed, options.area, cell_size)
    changes, lost = [], ""
    if pixels > 1:
        clear = _clearance(picture, dataclasses.replace(options, inflate=0.0))
        seen = _Seen(picture, clear, _cells_of_pixels(picture, part, cells, clear > 0), turn != 0)
        walls = _with_ways(seen, cells.walls, areas, number, options, radius)
        if num_opened := int((cells.walls & ~walls).sum()):
            count = f"{num_opened} cell{'s' * (num_opened > 1)}"
            changes.append(f"{count} opened where a body {2 * radius:g} m wide passes on the map")
        place = tuple(np.argwhere(areas[number].cells)[0])
        outside = np.zeros_like(walls)
        if areas[number].is_ground:
            outside = outside_of(~walls, _beyond(picture, part, cells), cell_size)
        if options.area is not None and is_found:
            row, column = cell_of_place(options.area, len(enclosed[number].walls), cell_size)
            place = row + enclosed[number].row, column + enclosed[number].column
            walls = walls if outside[place] else walls | outside
        if (walls != cells.walls).any():
            cells = cells._replace(walls=walls)
            areas = areas_of(cells, blocked, rim)
            enclosed = [enclose(area.cells, MIN_SIZE) for area in areas]
            number = next(index for index, area in enumerate(areas) if area.cells[place])
        changes += _describe_outside(areas[number], enclosed[number], outside)
        lost = _describe_lost(seen, pixels, areas, number, options, radius)
    row, column, height, width, walls = enclosed[number]
    size = max(height, width, len(walls))
    if size > MAX_SIZE:
        remedy = "save it as a ROS map, which is coarsened" if grid.is_cells else "give a larger cell_size"
        raise MazeError(f"{name}: expected at most {MAX_SIZE} cells a side, found {size} of {cell_size:g} m; {remedy}")
    maze = Maze(walls, name, cell_size)

    # Where the maze lies, in pixels from the edges of the map.
    top, left = (span.start for span in known_box(grid.states))
    from_left, from_top = left + cells.right + column * pixels, top + cells.down + row * pixels
    from_below = len(grid.states) - from_top - size * pixels
    corner = _transformed(grid.origin, from_left * grid.resolution, from_below * grid.resolution)
    origin = *corner, grid.origin[2]

    # What a user should know.
    if pixels > 1:
        along = f" that are turned by {math.degrees(turn):.1f} degrees, along the walls" if turn else ""
        shape = "{1} x {0}".format(*all_states.shape)
        coarser = f"{shape} pixels of {grid.resolution:g} m as cells of {cell_size:g} m{along}"
        changes = [coarser, *changes]
    changes = [*grid.changes, *["nothing on it is wall"] * (not (picture.states == OCCUPIED).any()), *changes]
    if len(areas) > 1:
        changes.append(describe_areas(areas, enclosed, number, cell_size))
    if not is_found:
        changes.append(f"none has {options.area}")
    num_free = int((~cells.walls).sum())
    if num_closed := num_free - areas[number].num_cells:
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
    if lost:
        remark(f"{name}: {lost}")
    return LocatedMaze(maze, origin)


def known_box(states: np.ndarray) -> tuple[slice, slice]:
    """Returns the rows and the columns of `states` from the first to the last of which something is known, or all."""
    known = states != UNKNOWN
    spans = [np.flatnonzero(known.any(axis=axis)) for axis in (1, 0)]
    if not len(spans[0]):
        return slice(0, len(states)), slice(0, states.shape[1])
    rows, columns = (slice(int(span[0]), int(span[-1]) + 1) for span in spans)
    return rows, columns


def _known_part(grid: OccupancyGrid) -> OccupancyGrid:
    """Returns a map without the rows and columns around it of which nothing is known; all of it if nothing is."""
    rows, columns = known_box(grid.states)
    right, up = columns.start * grid.resolution, (len(grid.states) - rows.stop) * grid.resolution
    x, y = _transformed(grid.origin, right, up)
    return dataclasses.replace(grid, states=grid.states[rows, columns], origin=(float(x), float(y), grid.origin[2]))


def _turned(grid: OccupancyGrid, turn: float) -> OccupancyGrid:
    """Returns a map in pixels that are turned by `turn` rad, with unknown ones in the corners."""
    height, width = np.array(grid.states.shape) * grid.resolution
    x, y = _transformed((0.0, 0.0, -turn), np.array([0, width, 0, width]), np.array([0, 0, height, height]))
    shape = math.ceil(np.ptp(y) / grid.resolution), math.ceil(np.ptp(x) / grid.resolution)
    corner = _transformed((0.0, 0.0, turn), x.min(), y.min())
    x, y = _transformed(grid.origin, *corner)
    origin = float(x), float(y), grid.origin[2] + turn
    return dataclasses.replace(grid, states=states_in_cells(grid, origin, grid.resolution, shape), origin=origin)


def _pixels_on(
    part: OccupancyGrid, picture: OccupancyGrid, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Returns on which rows and columns of pixels of `part` those of a picture have their centre."""
    right = (columns + 0.5) * picture.resolution
    up = (len(picture.states) - rows - 0.5) * picture.resolution
    x, y = _transformed(_moved(picture.origin, part.origin), right, up)
    from_below, from_left = (np.floor(along / part.resolution + _TIE).astype(np.int32) for along in (y, x))
    return len(part.states) - 1 - from_below, from_left


def _rim(picture: OccupancyGrid, part: OccupancyGrid, cell_size: float) -> Rim | None:
    """Returns the edge of a picture, in pixels of `part`; None if no pixel at the edge is free."""
    edge = np.ones(picture.states.shape, dtype=bool)
    edge[1:-1, 1:-1] = False
    places = np.argwhere(edge)
    is_free = picture.states[edge] == FREE
    last: np.ndarray = np.array(edge.shape) - 1
    inward = np.minimum(math.ceil(1.5 * cell_size / picture.resolution), last // 2)
    rows, columns = _pixels_on(part, picture, *np.clip(places, inward, last - inward).T)
    return Rim(np.where(is_free, rows, -1), np.where(is_free, columns, -1)) if is_free.any() else None


def _cells_of_pixels(picture: OccupancyGrid, part: OccupancyGrid, cells: Cells, is_free: np.ndarray) -> np.ndarray:
    """Returns the cell of each free pixel of a picture as row * C + column, -1 where there is none: `[H, W]` int.

    `part` is the map that the cells were laid on.
    """
    num_rows, num_columns = cells.walls.shape
    cell_of = np.full(picture.states.shape, -1, dtype=np.int32)
    places = np.nonzero(is_free)
    rows, columns = _pixels_on(part, picture, *places)
    rows, columns = (rows - cells.down) // cells.pixels, (columns - cells.right) // cells.pixels
    is_laid = (rows >= 0) & (rows < num_rows) & (columns >= 0) & (columns < num_columns)
    cell_of[places] = np.where(is_laid, rows * num_columns + columns, -1)
    return cell_of


def _beyond(picture: OccupancyGrid, part: OccupancyGrid, cells: Cells) -> np.ndarray:
    """Returns the cells whose centre lies outside of a picture: `[R, C]` bool."""
    rows, columns = (np.arange(count)[:, None] * cells.pixels + cells.pixels // 2 for count in cells.walls.shape)
    rows, columns = _pixels_on(picture, part, rows + cells.down, columns.T + cells.right)
    height, width = picture.states.shape
    return np.asarray(~((rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)))


def _clearance(picture: OccupancyGrid, options: ReadOptions) -> np.ndarray:
    """Returns the distance from the centre of each pixel to that of the nearest blocked one: `[H, W]`, in m."""
    free = np.pad(~blocked_pixels(picture.states, options, picture.resolution), 1).astype(np.uint8)
    return cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1] * picture.resolution


def _with_ways(
    seen: _Seen, walls: np.ndarray, areas: list[Area], number: int, options: ReadOptions, radius: float
) -> np.ndarray:
    """Returns walls in which one of the areas is joined with what a body reaches from it, but not with the ground."""
    area = areas[number].cells
    positions = (_clearance(seen.picture, options) if options.inflate else seen.clear) > radius
    if np.sum(positions & ~seen.at(_grown(area))) * seen.picture.resolution**2 < WORTH_REACHING:
        return walls
    nodes = nodes_of(positions, seen.cell_of, area.shape, seen.picture.resolution)
    # Cells along the picture stay as they are if little is lost.
    least = WORTH_REACHING if seen.is_turned else _MANY_LOST
    return open_ways(walls, area, _grown(_ground(areas, number)), nodes, least)


def _ground(areas: list[Area], number: int) -> np.ndarray:
    """Returns the cells of the areas around a building, apart from the one that is asked for: `[R, C]` bool."""
    others = [area.cells for area in areas if area.is_ground and area is not areas[number]]
    return np.any([np.zeros_like(areas[number].cells), *others], axis=0)


def _grown(cells: np.ndarray) -> np.ndarray:
    """Returns some cells and those that touch them: `[R, C]` bool."""
    return cv2.dilate(cells.astype(np.uint8), np.ones((3, 3))) > 0


def _describe_outside(area: Area, enclosed: Enclosed, outside: np.ndarray) -> list[str]:
    """Returns how much of a maze is ground around the building and how it is left out, in words; [] if none counts."""
    num_outside, rooms = int((outside & area.cells).sum()), area.cells & ~outside
    parts, _ = scipy.ndimage.label(rooms)
    building = rooms & (parts == np.bincount(parts[rooms], minlength=1).argmax())
    if min(num_outside, building.sum()) <= _MANY_CLOSED * area.num_cells:
        return []
    row, column = np.argwhere(building)[0] - (enclosed.row, enclosed.column)
    share = 100 * num_outside / area.num_cells
    return [f"{share:.0f} % of the maze lies outside of the walls, --area {row},{column} leaves it out"]


def _describe_lost(
    seen: _Seen, pixels: int, areas: list[Area], number: int, options: ReadOptions, radius: float
) -> str:
    """Returns which free regions of a map are not in the maze, how wide the ways there are, and what helps, in words.

    It is empty if nothing that counts is lost. The ground around a building is not meant.
    """
    picture, area = seen.picture, areas[number].cells
    is_near = seen.at(_grown(area | _ground(areas, number)))
    kept, clear = seen.at(area) & (seen.cell_of >= 0), seen.clear
    lost = lost_regions(clear, kept, is_near, picture.resolution, radius, _MANY_LOST)
    share = sum(region.area for region in lost) / (np.sum(clear > radius) * picture.resolution**2 + 1e-9)
    if not (any(region.width for region in lost) or share > _MANY_CLOSED):
        return ""

    # Where they are.
    named = []
    for region in lost[:_MOST_NAMED]:
        right = (region.column + 0.5) * picture.resolution
        up = (len(clear) - region.row - 0.5) * picture.resolution
        x, y = _transformed(picture.origin, right, up)
        way = f"by a way {region.width:.2g} m wide" if region.width else "closed on all sides"
        named.append(f"{region.area:,.3g} m2 at ({x:.1f}, {y:.1f}) m, {way}")
    others = len(lost) - len(named)
    line = f"not in the maze: {'; '.join(named)}{f'; and {others} more' * bool(others)}"

    # What may help: by which the body would reach one of them.
    places = np.array([region.row * clear.shape[1] + region.column for region in lost])
    inside = np.flatnonzero(kept)
    is_within_reach = np.array([region.width >= 2 * radius - _TIE for region in lost])
    advice = {
        "a smaller --cell-size": pixels > _fewest_pixels(picture.resolution, radius),
        "a smaller --inflate": options.inflate > 0,
    }
    ways = [way for way, helps in advice.items() if helps and is_within_reach.any()]
    if options.unknown == "wall" and not is_within_reach.all():
        through = reach_from(
            inside, _clearance(picture, dataclasses.replace(options, inflate=0.0, unknown="free")) > radius, places
        )
        ways += ["--unknown free"] * bool((through & ~is_within_reach).any())
    if options.pixel_size is not None and not is_within_reach.all():
        ways.append("without text, furniture and door swings on the plan")
    return f"{line}; try {', or '.join(ways)}" if ways else line


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


def _cell_pixels(blocked: np.ndarray, resolution: float, options: ReadOptions, name: str, radius: float) -> int:
    """Returns the pixels on a side of a cell of `options.cell_size`.

    If none is given, it is the smallest through which a body of `radius` m passes, and of which a maze has enough.
    """
    fewest = _fewest_pixels(resolution, radius)
    if options.cell_size:
        pixels = max(round(options.cell_size / resolution), fewest)
        if abs(options.cell_size / resolution - pixels) > _TOLERANCE:
            raise InputError(
                f"{name}: expected a cell_size of at least {_narrowest(radius):g} m and of a whole number of pixels of "
                f"{resolution:g} m, such as {pixels * resolution:g}, found {options.cell_size:g}"
            )
        return pixels
    if max(blocked.shape) <= fewest * MAX_CHOSEN_SIZE:
        return fewest
    free = [np.flatnonzero(~blocked.all(axis=axis)) for axis in (0, 1)]
    longest = max((int(np.ptp(indices)) + 1 for indices in free if len(indices)), default=1)
    # Beside these pixels there are walls, and the first and the last cell of them may be cut.
    return max(fewest, math.ceil(longest / (MAX_CHOSEN_SIZE - 3)))


def _narrowest(radius: float) -> float:
    """Returns the metres on a side of the smallest cells through which a body passes, at least `MIN_CELL_SIZE`."""
    return MIN_CELL_SIZE + 2 * max(0.0, radius - SLIDER_RADIUS)


def _fewest_pixels(resolution: float, radius: float) -> int:
    """Returns the pixels on a side of these cells."""
    return max(1, math.ceil(_narrowest(radius) / resolution - _TOLERANCE))


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
