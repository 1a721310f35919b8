"""The main direction of the walls on a map."""

from __future__ import annotations

import math

import cv2
import numpy as np

_MAX_POINTS = 20_000
_BIN = 0.1  # m, in which points along a wall count as one line; at least two pixels, so that no angle fits pixels best
_LEAST_LENGTH = 10.0  # m of walls, of which a direction is taken
# How much better than most angles a direction must fit, and than the picture's own for cells to be turned.
_CLEAR, _BETTER = 1.25, 1.2
_LEAST_TURN = math.radians(3)


def turn_of_walls(free: np.ndarray, occupied: np.ndarray, resolution: float) -> float:
    """Returns the angle from the picture to the main direction of its walls, in rad from -pi / 4 to pi / 4.

    It is counter-clockwise. It is 0 if the walls have no clear direction, or nearly that of the picture.

    Args:
      free: `[H, W]` bool.
      occupied: `[H, W]` bool; the walls are its pixels beside free ones.
      resolution: m, the side of a pixel.
    """
    beside = cv2.dilate(free.astype(np.uint8), np.ones((3, 3))) > 0
    rows, columns = np.nonzero(occupied & beside)
    if len(rows) * resolution < _LEAST_LENGTH:
        return 0.0
    points = np.stack([columns, -rows]).astype(float)[:, :: -(-len(rows) // _MAX_POINTS)]
    width = max(2.0, _BIN / resolution)

    # To a degree, then to a tenth of it.
    degrees = np.arange(-45, 45)
    fits = np.array([_fit(points, float(degree), width) for degree in degrees])
    finer = degrees[fits.argmax()] + np.arange(-10, 11) / 10
    finer_fits = [_fit(points, float(degree), width) for degree in finer]
    turn = math.remainder(math.radians(finer[int(np.argmax(finer_fits))]), math.pi / 2)
    is_clear = max(finer_fits) > max(_CLEAR * float(np.median(fits)), _BETTER * fits[degrees == 0].item())
    return turn if is_clear and abs(turn) > _LEAST_TURN else 0.0


def _fit(points: np.ndarray, degrees: float, width: float) -> float:
    """Returns how much of some points lies on lines along an angle or across it: the sum of squared counts."""
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    lines = np.floor(np.array([[cosine, sine], [-sine, cosine]]) @ points / width).astype(int)
    return float(sum((np.bincount(line - line.min()).astype(float) ** 2).sum() for line in lines))
