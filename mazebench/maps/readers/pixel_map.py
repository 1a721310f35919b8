"""Ink and paper in a picture of a plan, and the rectangle of its outer walls.

`H` and `W` are the numbers of rows and columns of pixels.
"""

from __future__ import annotations

import cv2
import numpy as np

WORKING_SIDE = 2400  # pixels; larger pictures are shrunk to it
STRAIGHTEN = "crop, straighten and threshold a photograph first"
_MIN_AREA = 0.05  # of the picture
_MIN_FILL = 0.97  # share of the rectangle within the outline of the outer walls; less if the plan is turned by a degree
_LONGER_SIDE = 2048  # pixels of the drawing: 8 a cell for the largest maze


def on_white(gray: np.ndarray, side: int) -> np.ndarray:
    """Returns `gray` in shades of which 255 is paper, with a longer side of `side` pixels."""
    height, width = (max(1, round(length * side / max(gray.shape))) for length in gray.shape)
    gray = cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA)
    return np.clip(255.0 * gray / max(1.0, dark_and_light(gray)[1]), 0, 255).astype(np.uint8)


def ink_of(paper: np.ndarray) -> np.ndarray:
    """Returns an array of the same shape, uint8: 255 at ink, 0 at paper."""
    return (paper < np.mean(dark_and_light(paper))).astype(np.uint8) * 255


def dark_and_light(shades: np.ndarray) -> tuple[float, float]:
    """Returns the mean dark and the mean light shade of a uint8 picture, split by Otsu's method."""
    # Otsu's threshold separates the two, but need not lie halfway between them.
    threshold, _ = cv2.threshold(shades, 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    counts = cv2.calcHist([shades], [0], None, [256], [0, 256]).ravel()
    levels = np.arange(256)
    everything = np.ones(256, dtype=bool)
    parts = (part if counts[part].any() else everything for part in (levels <= threshold, levels > threshold))
    dark, light = (float(counts[part] @ levels[part] / counts[part].sum()) for part in parts)
    return dark, light


def outer_walls(ink: np.ndarray) -> tuple[slice, slice] | None:
    """Returns the rows and columns of the largest shape of ink, or None if it does not fill an upright rectangle."""
    without_specks = cv2.morphologyEx(ink, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    outlines, _ = cv2.findContours(without_specks, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(outlines, key=cv2.contourArea, default=None)
    if outline is None or cv2.contourArea(outline) < _MIN_AREA * ink.size:
        return None
    left, top, width, height = cv2.boundingRect(outline)
    if cv2.contourArea(outline) < _MIN_FILL * (width - 1) * (height - 1):  # outlines go through centres of pixels
        return None
    return slice(top, top + height), slice(left, left + width)


def enlarged(drawing: np.ndarray) -> np.ndarray:
    """Returns the drawing with a longer side of `_LONGER_SIDE` pixels."""
    height, width = (max(3, round(length * _LONGER_SIDE / max(drawing.shape))) for length in drawing.shape)
    return cv2.resize(drawing, (width, height), interpolation=cv2.INTER_LINEAR)
