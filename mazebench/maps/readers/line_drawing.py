"""The maze in a drawing whose walls are lines between rooms.

`R` and `C` are the numbers of rows and columns of rooms, `H` and `W` of pixels.
"""

from __future__ import annotations

import cv2
import numpy as np

from mazebench.maps.maze import MAX_CHOSEN_SIZE, MazeError
from mazebench.maps.maze_options import THIN_WALLS
from mazebench.maps.readers.cell_grid import CORE, core_bounds, fit_grid
from mazebench.maps.readers.pixel_map import STRAIGHTEN, WORKING_SIDE, enlarged, ink_of, on_white, outer_walls

_MIN_CLARITY = 0.2  # between the share of a boundary that is line, and a half


def read_lines(gray: np.ndarray, size: int | None, name: str) -> np.ndarray:
    """Returns the walls of a plan of R x C rooms whose walls are drawn as lines between them.

    Args:
      gray: the picture, `[H, W]` uint8. Its outer line may have gaps, which are closed.
      size: the larger one of 2 R + 1 and 2 C + 1; estimated from the drawing if None.
      name: of the maze, for errors.

    Returns:
      `[2 R + 1, 2 C + 1]` bool: rooms have odd rows and columns, the cells between them are wall where a line is.
    """
    problem = MazeError(
        f"{name}: expected rooms in an upright square grid with lines as walls between them, found none; "
        f"{STRAIGHTEN}; {THIN_WALLS}"
    )

    # The ink, with the gaps in the outer line closed. Thin lines are lost at smaller sizes.
    paper = cv2.medianBlur(on_white(gray, WORKING_SIDE), 3)
    reach = max(paper.shape) // 4 | 1  # wider than a gap in the outer line
    filled = cv2.copyMakeBorder(ink_of(paper), *(reach,) * 4, cv2.BORDER_CONSTANT, value=0)
    filled = cv2.morphologyEx(filled, cv2.MORPH_CLOSE, np.ones((reach, reach), np.uint8))[reach:-reach, reach:-reach]

    # The lines, from the middle of the outer line on.
    crop = outer_walls(filled)
    if crop is None:
        raise problem
    lines = ink_of(enlarged(paper[crop])) > 0
    if lines.mean() > 0.5:
        raise problem
    depths = cv2.distanceTransform(lines.astype(np.uint8), cv2.DIST_L2, 5)
    edge = round(float(np.percentile(depths[lines], 90)))  # half the width of a line
    lines = lines[edge : len(lines) - edge, edge : lines.shape[1] - edge]

    # The grid of rooms, and how much of the boundaries to the right and below each room is line.
    shape, _ = fit_grid(
        lines.mean(axis=1),
        lines.mean(axis=0),
        lines.shape,
        shortest=2,
        longest=(2, (MAX_CHOSEN_SIZE - 1) // 2),
        size=None if size is None else (size - 1) // 2,
        nearly_best=0.9,
    )
    right, below = _line_shares(lines, shape), _line_shares(lines.T, shape[::-1]).T
    shares = np.concatenate([right.ravel(), below.ravel()])
    if np.abs(shares - 0.5).min() < _MIN_CLARITY:
        raise problem

    # Rooms are free, boundaries wall where a line is, corners wall where a boundary next to them is.
    rows, columns = shape
    walls = np.ones((2 * rows + 1, 2 * columns + 1), dtype=bool)
    walls[1::2, 1::2] = False
    walls[1::2, 2:-1:2] = right > 0.5
    walls[2:-1:2, 1::2] = below > 0.5
    walls[2:-1:2, 2:-1:2] = walls[1:-2:2, 2:-1:2] | walls[3::2, 2:-1:2] | walls[2:-1:2, 1:-2:2] | walls[2:-1:2, 3::2]
    return walls


def _line_shares(lines: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Returns how much of each boundary between a room and the one on its right is line: `[R, C - 1]` float.

    Args:
      lines: `[H, W]` bool, from the middle of the outer line to the middle of the outer line.
      shape: R and C.
    """
    rows, columns = shape
    tops, bottoms = core_bounds(rows, len(lines))
    middles = np.arange(1, columns) * lines.shape[1] / columns
    reach = lines.shape[1] / columns * CORE / 2
    shares = np.zeros((rows, columns - 1))
    for column, middle in enumerate(middles):
        strip = lines[:, round(middle - reach) : round(middle + reach) + 1]
        shares[:, column] = [strip[top:bottom].mean(axis=0).max() for top, bottom in zip(tops, bottoms, strict=True)]
    return shares
