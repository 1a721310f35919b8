"""Free regions of a map that its maze does not have.

`H` and `W` are the numbers of rows and columns of pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

_STEP, _SLACK = 0.05, 1e-6  # m, to which the width of a way is measured; of the rounded distances


class Lost(NamedTuple):
    """A region that is not in the maze, though a body has room in it."""

    area: float  # m2, of the positions of the body's centre
    row: int  # of its pixel that is farthest from walls
    column: int
    width: float  # m, about that of the widest way to the maze, at most the body's; 0 if it is closed


def lost_regions(
    clear: np.ndarray, kept: np.ndarray, near: np.ndarray, resolution: float, radius: float, least: float
) -> list[Lost]:
    """Returns the regions of at least `least` m2 that are lost: those with a way first, by falling size.

    Args:
      clear: `[H, W]` float, the distance from a pixel to the nearest one that is not free, in m.
      kept: `[H, W]` bool, the pixels in the maze.
      near: `[H, W]` bool, the pixels so near to it that nothing is lost there.
      resolution: m, the side of a pixel.
      radius: m, of the body.
      least: m2.
    """
    is_far = (clear > radius + _SLACK) & ~near
    if is_far.sum() * resolution**2 < least:
        return []
    _, regions, stats, _ = cv2.connectedComponentsWithStats(is_far.astype(np.uint8), connectivity=4)
    areas = stats[:, cv2.CC_STAT_AREA] * resolution**2
    numbers = [int(number) for number in np.flatnonzero(areas >= least) if number]
    places = {}
    for number in numbers:
        left, top, width, height = stats[number, :4]
        box = slice(top, top + height), slice(left, left + width)
        place = np.argmax(np.where(regions[box] == number, clear[box], -1))
        places[number] = np.unravel_index(place, (height, width)) + np.array([top, left])

    # The width of the largest disc that comes from the maze to each: one place stands for all, as the body moves there.
    widths = dict.fromkeys(numbers, 0.0)
    begin = np.flatnonzero(kept)
    at = np.array([np.ravel_multi_index(tuple(places[number]), clear.shape) for number in numbers], dtype=int)
    for width in np.arange(2 * radius, _STEP / 2, -_STEP).tolist():
        if not numbers or all(widths.values()):
            break
        for number, is_reached in zip(numbers, reach_from(begin, clear > width / 2 + _SLACK, at), strict=True):
            widths[number] = widths[number] or width * bool(is_reached)
    lost = []
    for number in numbers:
        row, column = places[number]
        lost.append(Lost(float(areas[number]), int(row), int(column), widths[number]))
    return sorted(lost, key=lambda region: (region.width == 0, -region.area))


def reach_from(begin: np.ndarray, positions: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Returns which pixels are connected with some of others: `[P]` bool.

    Args:
      begin: `[B]` int, the indices of those others among all pixels.
      positions: `[H, W]` bool, the pixels that connect.
      places: `[P]` int, the indices of the pixels that are asked for.
    """
    count, labels = cv2.connectedComponents(positions.astype(np.uint8), connectivity=4)
    is_reached = np.zeros(count, dtype=bool)
    is_reached[labels.ravel()[begin]] = True
    is_reached[0] = False
    return is_reached[labels.ravel()[places]]
