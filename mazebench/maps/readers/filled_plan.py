"""The maze in a picture of a plan whose walls are filled.

The drawing is cut out along its outer walls, and its cells are counted by the edges of its walls. `R` and `C` are the
numbers of rows and columns of cells, `H` and `W` of pixels.
"""

from __future__ import annotations

import cv2
import numpy as np

from mazebench.maps.maze import MazeError, require_connected
from mazebench.maps.maze_options import THIN_WALLS
from mazebench.maps.readers.cell_grid import core_bounds, fit_grid
from mazebench.maps.readers.pixel_map import (
    STRAIGHTEN,
    WORKING_SIDE,
    dark_and_light,
    enlarged,
    ink_of,
    on_white,
    outer_walls,
)

# In synthetic pictures of 13 and 21 cells the true N had a fit of 0.6 to 0.95, any other N at most 0.39.
_MIN_FIT = 0.4
_MIN_INK = 0.25  # share of a plan with filled walls; line drawings have less
_MIN_CONTRAST = 64  # between the shades of walls and floor, of 255
_MIN_LINE = 0.22  # share of the contrast; the lines of squared paper are fainter
_LINE_WIDTH, _LINE_LENGTH = 0.6, 0.9  # shares of a cell's side; walls are wider than a line, letters shorter
_MIN_CLARITY = 0.1  # share of the contrast, between a core's shade and the middle of wall and floor


def read_plan(gray: np.ndarray, size: int | None, name: str) -> np.ndarray:
    """Returns the walls, `[R, C]` bool, that `gray` (`[H, W]` uint8, dark is wall) shows. The outermost are walls.

    Args:
      gray: the picture.
      size: the larger one of R and C; estimated from the drawing if None.
      name: of the maze, for errors.
    """
    # The drawing without noise, and as it is.
    fine = on_white(gray, min(WORKING_SIDE, max(gray.shape)))
    paper = cv2.medianBlur(fine, 3)
    dark, light = dark_and_light(paper)
    if light - dark < _MIN_CONTRAST or gray.min() == gray.max():
        raise MazeError(f"{name}: expected dark walls on light paper, found a page of one shade")
    ink = ink_of(paper)
    crop = outer_walls(ink)
    if crop is None:
        raise MazeError(
            f"{name}: expected a drawing whose dark outer walls form a closed, upright rectangle, found none "
            f"({_advice(ink, size)})"
        )
    drawing, fine = enlarged(paper[crop]), enlarged(fine[crop])

    # The grid of cells on which the edges of the ink lie best.
    ink = ink_of(drawing)
    advice = _advice(ink, size)
    across = cv2.reduce(cv2.absdiff(ink[1:], ink[:-1]), 1, cv2.REDUCE_SUM, dtype=cv2.CV_64F).ravel()
    down = cv2.reduce(cv2.absdiff(ink[:, 1:], ink[:, :-1]), 0, cv2.REDUCE_SUM, dtype=cv2.CV_64F).ravel()
    shape, fit = fit_grid(across, down, ink.shape, size)
    if fit < _MIN_FIT:
        raise MazeError(f"{name}: expected walls along the lines of a grid of cells, found edges off it ({advice})")

    # The shade of each cell's middle, which must be clearly dark or light.
    sums = cv2.integral(drawing)
    (top, bottom), (left, right) = (
        core_bounds(count, length) for count, length in zip(shape, drawing.shape, strict=True)
    )
    totals = sums[bottom][:, right] - sums[top][:, right] - sums[bottom][:, left] + sums[top][:, left]
    cores = totals / np.outer(bottom - top, right - left)
    dark, light = dark_and_light(np.round(cores).astype(np.uint8))
    in_words = f"{shape[0]} x {shape[1]} cells"
    if light - dark < _MIN_CONTRAST:
        raise MazeError(
            f"{name}: expected filled walls as thick as a cell, found only lines between {in_words}; {THIN_WALLS}"
        )
    clarity = np.abs(cores - (dark + light) / 2) / (light - dark)
    clarity[[0, -1], :] = clarity[:, [0, -1]] = 1
    if clarity.min() < _MIN_CLARITY:
        cell = tuple(map(int, np.argwhere(clarity == clarity.min())[0]))
        raise MazeError(f"{name}: expected {in_words} of wall or floor, found cell {cell} between the two ({advice})")
    walls = cores < (dark + light) / 2
    walls[[0, -1], :] = walls[:, [0, -1]] = True

    # What else speaks against filled walls as thick as a cell.
    lines = _lines_in_floor(fine, walls, _MIN_LINE * (light - dark))
    if lines.any():
        cell = tuple(map(int, np.argwhere(lines)[0]))
        raise MazeError(
            f"{name}: expected filled walls as thick as a cell, found a thin line across the floor at {cell} ({advice})"
        )
    try:
        require_connected(walls, name)
    except MazeError as error:
        raise MazeError(f"{error} ({advice})") from error
    return walls


def _advice(ink: np.ndarray, size: int | None) -> str:
    """Returns what to try with a drawing that is not read."""
    if size is not None:
        return f"are there {size} cells a side? {STRAIGHTEN}"
    if np.count_nonzero(ink) < _MIN_INK * ink.size:
        return f"are the walls lines? {THIN_WALLS}; {STRAIGHTEN}"
    return f"give the number of cells on the longer side; {STRAIGHTEN}"


def _lines_in_floor(fine: np.ndarray, walls: np.ndarray, contrast: float) -> np.ndarray:
    """Returns the floor cells in which a thin dark line, about a cell long or longer, is found: `[R, C]` bool."""
    # Dark pixels in thin shapes, then those of them that are part of a line along an axis.
    cell = min(length // count for length, count in zip(fine.shape, walls.shape, strict=True))
    thick, long = max(3, round(_LINE_WIDTH * cell)), max(3, round(_LINE_LENGTH * cell))
    dark = cv2.morphologyEx(fine, cv2.MORPH_BLACKHAT, np.ones((thick, thick), np.uint8)) > contrast
    lines = np.zeros(fine.shape, dtype=bool)
    for kernel in (np.ones((1, long), np.uint8), np.ones((long, 1), np.uint8)):
        lines |= cv2.morphologyEx(dark.astype(np.uint8), cv2.MORPH_OPEN, kernel) > 0

    # The floor, but not next to walls, where it is dark if the picture is blurred or the drawing a little off its grid.
    floor = cv2.resize((~walls).astype(np.uint8), fine.shape[::-1], interpolation=cv2.INTER_NEAREST)
    floor = cv2.erode(floor, np.ones((2 * (cell // 4) + 1,) * 2, np.uint8))

    rows, columns = np.nonzero(lines & (floor > 0))
    found = np.zeros_like(walls)
    found[rows * walls.shape[0] // fine.shape[0], columns * walls.shape[1] // fine.shape[1]] = True
    return found
