"""The grid of cells of a drawing, which the edges of its walls lie on.

`R` and `C` are the numbers of rows and columns of cells.
"""

from __future__ import annotations

import cv2
import numpy as np

from mazebench.maps.maze import MAX_CHOSEN_SIZE, MIN_SIZE

MIN_SIDE = 3  # cells on the shorter side of a plan: wall, floor, wall
_NEARLY_BEST = 0.97  # share of the best fit with which smaller numbers of cells are preferred
# Of a cell: logarithm of width by height. A stretched picture has the same for all multiples of a grid.
_MAX_STRETCH, _SAME_STRETCH = 0.3, 0.02
_CORE = 0.5  # share of a cell's side: the middle of a cell, which decides whether it is wall


def fit_grid(
    across: np.ndarray,
    down: np.ndarray,
    pixels: tuple[int, ...],
    size: int | None,
) -> tuple[tuple[int, int], float]:
    """Returns the numbers of rows and columns that fit weights along the two axes best, and the worse fit.

    The fit of a number n along one axis is the mean of `cos(2 pi n x)` over the positions `x`, in shares of its length;
    1 is best. Cells are about square, so rows and columns are counted together. Multiples of the true numbers fit
    nearly as well, so the true ones are the smallest that fit nearly best and stretch cells as the best ones do.

    Args:
      across: weight of each position from top to bottom; `down` from left to right.
      down: see `across`.
      pixels: height and width of the picture.
      size: the number of cells along the longer axis; estimated if None.
    """
    # The fit of each pair of numbers: the two axes' fits, weighted.
    row_fits, row_weight = _axis_fits(across)
    column_fits, column_weight = _axis_fits(down)
    weight = max(1e-9, row_weight + column_weight)
    fits = (row_weight * row_fits[:, None] + column_weight * column_fits[None, :]) / weight  # [R, C]

    # The pairs that are allowed.
    counts = np.arange(len(row_fits))
    stretch = np.log(np.maximum(counts, 1)[:, None] / np.maximum(counts, 1)[None, :] * pixels[1] / pixels[0])
    longer = np.maximum(counts[:, None], counts[None, :])
    allowed = (np.abs(stretch) <= _MAX_STRETCH) & (longer >= MIN_SIZE) & (longer <= MAX_CHOSEN_SIZE)
    allowed &= np.minimum(counts[:, None], counts[None, :]) >= MIN_SIDE
    if size is not None:
        allowed &= longer == size
    fits[~allowed] = -1.0
    best = fits.max()
    if best <= 0:
        return (MIN_SIZE, MIN_SIZE), -1.0

    # The smallest of the pairs that fit nearly best, better than their neighbours, and stretch cells as the best does.
    near = cv2.dilate(fits, np.ones((3, 3), np.uint8))
    as_stretched = np.abs(stretch - stretch.ravel()[fits.argmax()]) <= _SAME_STRETCH
    rows, columns = np.nonzero((fits >= near) & (fits >= _NEARLY_BEST * best) & as_stretched & allowed)
    first = int(np.argmin(rows * columns))
    num_rows, num_columns = int(rows[first]), int(columns[first])
    return (num_rows, num_columns), float(min(row_fits[num_rows], column_fits[num_columns]))


def core_bounds(count: int, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns where the middle of each of `count` cells along `length` pixels begins, and where it ends."""
    bounds = (np.arange(count)[:, None] + [0.5 - _CORE / 2, 0.5 + _CORE / 2]) * length / count
    starts, ends = np.round(bounds).astype(int).T
    return starts, ends


def _axis_fits(edges: np.ndarray) -> tuple[np.ndarray, float]:
    """Returns the fit of each number of cells along an axis, `[256]` float, and the weight of the edges."""
    positions = np.arange(1, len(edges) + 1) / (len(edges) + 1)
    is_outline = np.minimum(positions, 1 - positions) < 0.5 / MAX_CHOSEN_SIZE  # of the frame
    edges = np.where(is_outline, 0, edges)
    weight = float(edges.sum())
    return np.cos(2 * np.pi * np.outer(np.arange(MAX_CHOSEN_SIZE + 1), positions)) @ edges / max(1e-9, weight), weight
