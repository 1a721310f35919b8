"""The maze in a scan or photograph of a drawn plan.

The drawing is found by its outer walls, deskewed to a square, and its cells are counted by the edges of its walls.
`N` is the number of cells along a side of the maze.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from mazebench.maps.maze import MAX_SIZE, MIN_SIZE, Maze, MazeError

_WORKING_SIDE = 2400  # pixels; larger photographs are shrunk to it
_LIGHT_SIDE = 128  # pixels of the small copy in which the light on the paper is estimated
_MIN_LIGHT = 0.6  # of the brightest paper; a wide area darker than this is wall, not paper in the shade
_MARGIN = 8  # pixels of paper added around a photograph, for drawings cut out along their outer walls
_MIN_FRAME_AREA = 0.05  # of the picture
_MIN_FRAME_FILL = 0.9  # smaller area over larger one, of a frame's outline and the four-sided shape fitted to it
_SQUARE_SIDE = 2048  # pixels of the deskewed drawing: 8 a cell for the largest maze
# On synthetic photographs of 13 and 21 cells the true N had a fit of 0.6 to 0.95, any other N at most 0.39.
_MIN_FIT = 0.4
_NEARLY_BEST = 0.97  # share of the best fit
_CORE = 0.5  # share of a cell's side: the middle of a cell, which decides whether it is wall
_MIN_CONTRAST = 64  # between the shades of walls and floor, of 255
_MIN_LINE = 0.22  # share of the contrast; the lines of squared paper are fainter
_LINE_WIDTH, _LINE_LENGTH = 0.6, 0.9  # shares of a cell's side; walls are wider than a line, letters shorter
_MIN_CLARITY = 0.1  # share of the contrast, between a core's shade and the middle of wall and floor


def read_plan(gray: np.ndarray, size: int | None, name: str) -> Maze:
    """Returns the maze that `gray` (`[H, W]` uint8, dark is wall) shows.

    Args:
      size: N; estimated from the drawing if None.
      name: of the maze, also in errors.

    Raises:
      MazeError: if no legal maze is found.
    """
    paper, fine = _flatten(gray)
    problem = f"{name}: expected a drawing whose dark outer walls form a closed square, found none"
    for corners in _frames(_ink(paper)):
        try:
            return _read_square(_deskew(paper, corners), _deskew(fine, corners), size, name)
        except MazeError as error:
            problem = str(error)
    advice = "give the number of cells a side" if size is None else f"are there {size} cells a side?"
    raise MazeError(f"{problem} ({advice})")


def _flatten(gray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the picture at working size with the light evened out, as (without noise, with noise).

    Both are `[H', W']` uint8 with a margin around the picture; 255 is paper.
    """
    gray = _shrink(gray, _WORKING_SIDE)
    small = _shrink(gray, _LIGHT_SIDE)
    # A closing half as wide as the picture replaces ink by the paper around it.
    closed = cv2.morphologyEx(small, cv2.MORPH_CLOSE, np.ones((max(small.shape) // 2,) * 2, np.uint8))
    light = np.maximum(closed, _MIN_LIGHT * np.percentile(closed, 95)).astype(np.float32)
    light = cv2.resize(cv2.GaussianBlur(light, (0, 0), 3), gray.shape[::-1], interpolation=cv2.INTER_LINEAR)
    fine = np.clip(255.0 * gray / np.maximum(light, 1), 0, 255).astype(np.uint8)
    fine = cv2.copyMakeBorder(fine, *(_MARGIN,) * 4, cv2.BORDER_CONSTANT, value=255)
    return cv2.medianBlur(fine, 3), fine


def _shrink(gray: np.ndarray, side: int) -> np.ndarray:
    scale = min(1, side / max(gray.shape))
    height, width = (max(1, round(length * scale)) for length in gray.shape)
    return cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA)


def _ink(paper: np.ndarray) -> np.ndarray:
    """Returns an array of the same shape, uint8: 255 at ink, 0 at paper."""
    return (paper < np.mean(_dark_and_light(paper))).astype(np.uint8) * 255


def _dark_and_light(shades: np.ndarray) -> tuple[float, float]:
    """Returns the mean dark and the mean light shade of a uint8 picture, split by Otsu's method."""
    # Otsu's threshold separates the two, but need not lie halfway between them.
    threshold, _ = cv2.threshold(shades, 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    counts = cv2.calcHist([shades], [0], None, [256], [0, 256]).ravel()
    levels = np.arange(256)
    everything = np.ones(256, dtype=bool)
    parts = (part if counts[part].any() else everything for part in (levels <= threshold, levels > threshold))
    dark, light = (float(counts[part] @ levels[part] / counts[part].sum()) for part in parts)
    return dark, light


def _frames(ink: np.ndarray) -> Iterator[np.ndarray]:
    """Yields the corners of up to two four-sided shapes that may be the drawing's outer walls.

    The first is the largest shape of ink. The second is the largest one that does not touch the picture's edge, which
    is the drawing if the picture shows a dark table around the paper.
    """
    clear = ink.copy()
    clear[:_MARGIN] = clear[-_MARGIN:] = clear[:, :_MARGIN] = clear[:, -_MARGIN:] = 255
    cv2.floodFill(clear, None, (0, 0), 0)
    for shapes in (ink, clear):
        without_specks = cv2.morphologyEx(shapes, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        outlines, _ = cv2.findContours(without_specks, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        outline = max(outlines, key=cv2.contourArea, default=None)
        if outline is not None and cv2.contourArea(outline) >= _MIN_FRAME_AREA * ink.size:
            corners = _fit_corners(outline)
            if corners is not None:
                yield corners


def _fit_corners(outline: np.ndarray) -> np.ndarray | None:
    """Returns the corners (x, y) of an outline with four straight sides, `[4, 2]` float32 from top left, or None."""
    hull = cv2.convexHull(outline, clockwise=False)  # clockwise if y points down
    tolerances = cv2.arcLength(hull, True) * np.arange(0.01, 0.1, 0.005)
    polygons = (cv2.approxPolyDP(hull, tolerance, True)[:, 0] for tolerance in tolerances)
    rough = next((polygon for polygon in polygons if len(polygon) == 4), None)
    if rough is None:
        return None
    rightwards = np.roll(rough, -1, axis=0)[:, 0] - rough[:, 0]  # of the side that starts at each corner
    rough = np.roll(rough, -int(np.argmax(rightwards - np.roll(rightwards, 2))), axis=0).astype(np.float64)
    points = outline[:, 0].astype(np.float64)
    sides = [_fit_side(points, rough[i], rough[(i + 1) % 4]) for i in range(4)]
    meetings = np.array([np.cross(sides[i - 1], sides[i]) for i in range(4)])  # homogeneous
    if (np.abs(meetings[:, 2]) < 1e-9).any():
        return None
    corners = (meetings[:, :2] / meetings[:, 2:]).astype(np.float32)
    smaller, larger = sorted((cv2.contourArea(outline), cv2.contourArea(corners)))
    return corners if smaller >= _MIN_FRAME_FILL * larger else None


def _fit_side(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Returns the homogeneous line (`[3]` float) through the `points` of an outline along one of its sides."""
    length = np.hypot(*(end - start))
    along = (end - start) / length
    share = (points - start) @ along / length
    away = np.abs((points - start) @ [-along[1], along[0]])
    near = points[(share > 0.05) & (share < 0.95) & (away < 0.03 * length)]
    near = np.concatenate([near, [start, end]])  # so that there are two points or more
    direction, point = cv2.fitLine(near.astype(np.float32), cv2.DIST_HUBER, 0, 0.01, 0.01).reshape(2, 2).astype(float)
    return np.cross([*point, 1.0], [*(point + direction), 1.0])


def _deskew(paper: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Returns the drawing as seen from straight above, `[_SQUARE_SIDE, _SQUARE_SIDE]` uint8."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32) * (_SQUARE_SIDE - 1)
    transform = cv2.getPerspectiveTransform(corners, square)
    return cv2.warpPerspective(paper, transform, (_SQUARE_SIDE, _SQUARE_SIDE), borderValue=255)


def _read_square(square: np.ndarray, fine: np.ndarray, size: int | None, name: str) -> Maze:
    """Returns the maze in a deskewed drawing; `fine` is the drawing with its noise. The outermost cells are walls."""
    fits = _grid_fits(_ink(square))
    if size is None:
        is_best = (fits[1:-1] >= fits[:-2]) & (fits[1:-1] >= fits[2:]) & (fits[1:-1] >= _NEARLY_BEST * fits.max())
        size = 1 + int(np.argmax(is_best))
    if fits[size] < _MIN_FIT:
        raise MazeError(f"{name}: expected walls along the lines of a square grid of cells, found edges off it")
    cores = _cores(square, size)
    dark, light = _dark_and_light(np.round(cores).astype(np.uint8))
    if light - dark < _MIN_CONTRAST:
        raise MazeError(f"{name}: expected dark walls on light paper, found shades {dark:.0f} and {light:.0f} of 255")
    clarity = np.abs(cores - (dark + light) / 2) / (light - dark)
    clarity[[0, -1], :] = clarity[:, [0, -1]] = 1
    if clarity.min() < _MIN_CLARITY:
        cell = tuple(map(int, np.argwhere(clarity == clarity.min())[0]))
        raise MazeError(f"{name}: expected {size} x {size} cells of wall or floor, found cell {cell} between the two")
    walls = cores < (dark + light) / 2
    walls[[0, -1], :] = walls[:, [0, -1]] = True
    lines = _lines_in_floor(fine, walls, _MIN_LINE * (light - dark))
    if lines.any():
        cell = tuple(map(int, np.argwhere(lines)[0]))
        raise MazeError(
            f"{name}: expected filled walls as thick as a cell, found a thin line across the floor at {cell}"
        )
    return Maze(walls, name)


def _lines_in_floor(fine: np.ndarray, walls: np.ndarray, contrast: float) -> np.ndarray:
    """Returns the floor cells in which a thin dark line, about a cell long or longer, is found: `[N, N]` bool."""
    size = len(walls)
    cell = _SQUARE_SIDE // size
    thick, long = max(3, round(_LINE_WIDTH * cell)), max(3, round(_LINE_LENGTH * cell))
    dark = cv2.morphologyEx(fine, cv2.MORPH_BLACKHAT, np.ones((thick, thick), np.uint8)) > contrast
    lines = np.zeros(fine.shape, dtype=bool)
    for kernel in (np.ones((1, long), np.uint8), np.ones((long, 1), np.uint8)):
        lines |= cv2.morphologyEx(dark.astype(np.uint8), cv2.MORPH_OPEN, kernel) > 0
    floor = cv2.resize((~walls).astype(np.uint8), fine.shape[::-1], interpolation=cv2.INTER_NEAREST)
    # Without the floor next to walls, which is dark if the picture is blurred or the drawing a little off its grid.
    floor = cv2.erode(floor, np.ones((2 * (cell // 4) + 1,) * 2, np.uint8))
    rows, columns = np.nonzero(lines & (floor > 0))
    found = np.zeros_like(walls)
    found[rows * size // len(fine), columns * size // len(fine)] = True
    return found


def _grid_fits(ink: np.ndarray) -> np.ndarray:
    """Returns for each N how well the edges of the ink lie on its grid: `[MAX_SIZE + 2]` float, -1 below MIN_SIZE.

    The fit is the mean of `cos(2 pi N x)` over the positions `x` of edges, in shares of the frame's side; 1 is best.
    Multiples of the true N fit nearly as well, so the smallest N that fits nearly best is the true one.
    """
    across = cv2.reduce(cv2.absdiff(ink[1:], ink[:-1]), 1, cv2.REDUCE_SUM, dtype=cv2.CV_64F)
    down = cv2.reduce(cv2.absdiff(ink[:, 1:], ink[:, :-1]), 0, cv2.REDUCE_SUM, dtype=cv2.CV_64F)
    edges = across.ravel() + down.ravel()
    positions = np.arange(1, len(ink)) / len(ink)
    edges[np.minimum(positions, 1 - positions) < 0.5 / MAX_SIZE] = 0  # the frame's outline
    sizes = np.arange(MIN_SIZE, MAX_SIZE + 2)
    fits = np.cos(2 * np.pi * np.outer(sizes, positions)) @ edges / max(1, edges.sum())
    return np.concatenate([np.full(MIN_SIZE, -1.0), fits])


def _cores(square: np.ndarray, size: int) -> np.ndarray:
    """Returns the mean shade of the middle of each cell: `[size, size]` float."""
    sums = cv2.integral(square)
    bounds = (np.arange(size)[:, None] + [0.5 - _CORE / 2, 0.5 + _CORE / 2]) * _SQUARE_SIDE / size
    starts, ends = np.round(bounds).astype(int).T
    totals = sums[ends][:, ends] - sums[starts][:, ends] - sums[ends][:, starts] + sums[starts][:, starts]
    return totals / np.outer(ends - starts, ends - starts)
