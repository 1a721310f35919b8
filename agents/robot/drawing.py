"""Compares a picture of a maze with the maze as it is estimated: how grey pixels should be, and what that tells.

A pixel covers a box of the maze: the cells' shares of it are its grey value. Cells are walls with some probability. If
walls are drawn thicker or thinner than they are, an axis falls into zones: zone 2 i + 1 is the core of cell i, and zone
2 i is the edge between cells i - 1 and i, as wide as the change. Thick: an edge is drawn as wall if any of the cells
there is one; thin: if all are. A maze of N x N cells has (2 N + 1) x (2 N + 1) zones; the outermost ones never end.

Points are (row, column) in cells, with the maze's corners at 0 and N. `P` x `Q` are the pixels. A box's `overlaps` with
zones are `first`, the first zone, `last`, the last one, and their shares of the box in order.
"""

from __future__ import annotations

import math

import numpy as np

from mazebench.kernels import compiled, inlined

_LARGEST_BOX = 2.5  # cells squared; a box that is larger tells nothing of single cells
_MOST_ZONES = 16  # in a box of the largest width along an axis


@compiled
def compare(
    picture: np.ndarray, points: np.ndarray, widths: np.ndarray, thickening: float, walls: np.ndarray, noise: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Returns what pixels have more than they should, how that depends on the drawing, and what it tells of cells.

    Args:
      picture: `[P, Q]` float, the share of wall in each pixel.
      points: `[P, Q, 2]` float, the points at the pixels' centres.
      widths: `[P, Q, 2]` float, the sides of the boxes that pixels cover, in cells, at most 3.
      thickening: by how much walls are drawn thicker, in cells.
      walls: `[N, N]` float, the probability of each cell to be a wall.
      noise: standard deviation of a grey value.

    Returns:
      `[P, Q]`, the differences of picture and expectation;
      `[P, Q, 3]`, the expectation's derivatives by row, column, and thickening;
      `[P, Q]`, the standard deviations of the differences;
      `[N, N]`, the log odds of wall that the picture adds for each cell, as if all others were as estimated.
    """
    (height, width), size, thick = picture.shape, len(walls), thickening >= 0
    half, sign = abs(thickening) / 2, 0.5 if thick else -0.5

    # The probability of each zone to be drawn as wall, and by how much a wall in each cell raises its 3 x 3 zones.
    zones, effects = np.empty((2 * size + 1, 2 * size + 1)), np.empty((size, size, 3, 3))
    for a in range(len(zones)):
        for b in range(len(zones)):
            meeting = _product(walls, thick, a, b, -1, -1)
            zones[a, b] = 1 - meeting if thick else meeting
    for i in range(size):
        for j in range(size):
            for a in range(3):
                for b in range(3):
                    effects[i, j, a, b] = _product(walls, thick, 2 * i + a, 2 * j + b, i, j)
    doubts = np.sqrt(zones * (1 - zones))

    differences, deviations = np.empty((height, width)), np.empty((height, width))
    slopes, evidence = np.empty((height, width, 3)), np.zeros((size, size))
    down, down_slope = np.empty(_MOST_ZONES), np.empty(_MOST_ZONES)
    right, right_slope = np.empty(_MOST_ZONES), np.empty(_MOST_ZONES)
    for p in range(height):
        for q in range(width):
            # What the box should show.
            box = widths[p, q]
            top, bottom = _overlaps(points[p, q, 0], box[0], half, 2 * size, down, down_slope)
            left, end = _overlaps(points[p, q, 1], box[1], half, 2 * size, right, right_slope)
            expected, doubt, by_row, by_column, by_half = 0.0, 0.0, 0.0, 0.0, 0.0
            for a in range(top, bottom + 1):
                mean, mean_doubt, mean_by_half = 0.0, 0.0, 0.0
                for b in range(left, end + 1):
                    mean += right[b - left] * zones[a, b]
                    mean_doubt += right[b - left] * doubts[a, b]
                    mean_by_half += right_slope[b - left] * zones[a, b]
                expected += down[a - top] * mean
                doubt += down[a - top] * mean_doubt
                by_half += down[a - top] * mean_by_half + down_slope[a - top] * mean
                by_row += mean * ((a == bottom) - (a == top))
                by_column += down[a - top] * (zones[a, end] - zones[a, left])
            differences[p, q] = picture[p, q] - expected
            deviations[p, q] = math.sqrt(noise**2 + doubt**2)
            slopes[p, q, 0], slopes[p, q, 1], slopes[p, q, 2] = by_row / box[0], by_column / box[1], by_half * sign

            # What the pixel tells of cells.
            if box[0] * box[1] < _LARGEST_BOX:
                for i in range(max(1, (top - 1) // 2), min(size - 2, bottom // 2) + 1):
                    for j in range(max(1, (left - 1) // 2), min(size - 2, end // 2) + 1):
                        # By how much a wall in the cell raises the pixel's value.
                        effect = 0.0
                        for a in range(max(2 * i, top), min(2 * i + 2, bottom) + 1):
                            for b in range(max(2 * j, left), min(2 * j + 2, end) + 1):
                                effect += down[a - top] * right[b - left] * effects[i, j, a - 2 * i, b - 2 * j]
                        # How much likelier the pixel is with that wall than without; the other cells are uncertain.
                        wall = walls[i, j]
                        others = max(doubt - effect * math.sqrt(wall * (1 - wall)), 0.0)
                        without = differences[p, q] + wall * effect
                        with_wall = differences[p, q] - (1 - wall) * effect
                        evidence[i, j] += (without**2 - with_wall**2) / (2 * (noise**2 + others**2))
    return differences, slopes, deviations, evidence


@inlined
def _product(walls: np.ndarray, thick: bool, a: int, b: int, row: int, column: int) -> float:
    """Returns the probability that the cells that meet zone (a, b) are all free (thick) or all walls.

    Cell (row, column) is left out; cells outside of the maze are walls.
    """
    size, product = len(walls), 1.0
    for i in range((a - 1) // 2 if a % 2 == 0 else a // 2, a // 2 + 1):
        for j in range((b - 1) // 2 if b % 2 == 0 else b // 2, b // 2 + 1):
            if i != row or j != column:
                wall = walls[i, j] if 0 <= i < size and 0 <= j < size else 1.0
                product *= 1 - wall if thick else wall
    return product


@inlined
def _overlaps(
    centre: float, width: float, half: float, last_zone: int, shares: np.ndarray, slopes: np.ndarray
) -> tuple[int, int]:
    """Writes the shares of a box in zones, and their derivatives by `half`; returns the first and the last zone.

    `half` is half of the change of the walls' thickness. All is along one axis.
    """
    start, end = centre - width / 2, centre + width / 2
    first, last = _zone(start, half, last_zone), _zone(end, half, last_zone)
    previous = start
    for zone in range(first, last + 1):
        is_edge = zone % 2 == 0
        following = end if zone == last else zone // 2 + (half if is_edge else 1 - half)
        # Edges grow on both sides, and what lies between them shrinks.
        num_sides = (zone > first) + (zone < last)
        shares[zone - first] = (following - previous) / width
        slopes[zone - first] = (num_sides if is_edge else -num_sides) / width
        previous = following
    return first, last


@inlined
def _zone(coordinate: float, half: float, last_zone: int) -> int:
    line = math.floor(coordinate + half)
    zone = 2 * line if coordinate + half - line < 2 * half else 2 * line + 1
    return min(max(zone, 0), last_zone)


@compiled
def widths_of_pixels(points: np.ndarray, smallest: float) -> np.ndarray:
    """Returns `[P, Q, 2]` float: the sides in cells of the boxes that pixels cover, at least `smallest`.

    `points` are `[P, Q, 2]` float, the points at the pixels' centres.
    """
    height, width = points.shape[:2]
    widths = np.empty((height, width, 2))
    for p in range(height):
        above, below = max(p - 1, 0), min(p + 1, height - 1)
        for q in range(width):
            left, right = max(q - 1, 0), min(q + 1, width - 1)
            down = abs(points[below, q, 0] - points[above, q, 0]) / max(below - above, 1)
            across = abs(points[p, right, 1] - points[p, left, 1]) / max(right - left, 1)
            widths[p, q, 0], widths[p, q, 1] = max(down, smallest), max(across, smallest)
    return widths
