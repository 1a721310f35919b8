"""The drawing in a scan or photograph: found by its outer walls, and seen from straight above.

`H` and `W` are the numbers of rows and columns of pixels.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

WORKING_SIDE = 2400  # pixels; larger photographs are shrunk to it
_LIGHT_SIDE = 128  # pixels of the small copy in which the light on the paper is estimated
_MIN_LIGHT = 0.6  # of the brightest paper; a wide area darker than this is wall, not paper in the shade
_MARGIN = 8  # pixels of paper added around a photograph, for drawings cut out along their outer walls
_MIN_FRAME_AREA = 0.05  # of the picture
_MIN_FRAME_FILL = 0.9  # smaller area over larger one, of a frame's outline and the four-sided shape fitted to it
_LONGER_SIDE = 2048  # pixels of the deskewed drawing: 8 a cell for the largest maze
_SHORTEST_SIDE = 3  # pixels


def flatten(gray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the picture at working size with the light evened out, as (without noise, with noise).

    Both are `[H', W']` uint8 with a margin around the picture; 255 is paper.
    """
    # The light on the paper, from a small copy: a closing half as wide as the picture replaces ink by the paper around.
    gray = _shrink(gray, WORKING_SIDE)
    small = _shrink(gray, _LIGHT_SIDE)
    closed = cv2.morphologyEx(small, cv2.MORPH_CLOSE, np.ones((max(small.shape) // 2,) * 2, np.uint8))
    light = np.maximum(closed, _MIN_LIGHT * np.percentile(closed, 95)).astype(np.float32)
    light = cv2.resize(cv2.GaussianBlur(light, (0, 0), 3), gray.shape[::-1], interpolation=cv2.INTER_LINEAR)

    # The picture in even light, with a margin of paper.
    fine = np.clip(255.0 * gray / np.maximum(light, 1), 0, 255).astype(np.uint8)
    fine = cv2.copyMakeBorder(fine, *(_MARGIN,) * 4, cv2.BORDER_CONSTANT, value=255)
    return cv2.medianBlur(fine, 3), fine


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


def frames(ink: np.ndarray) -> Iterator[np.ndarray]:
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


def deskew(paper: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Returns the drawing as seen from straight above: `[H, W]` uint8, the longer side of `_LONGER_SIDE` pixels."""
    lengths = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T)  # of the upper, right, lower and left side
    # An outline goes through the centres of its pixels, so half a pixel is missing at each end.
    sides = (lengths[:2] + lengths[2:]) / 2 + 1
    scale = _LONGER_SIDE / sides.max()
    width, height = np.maximum(np.round(sides * scale), _SHORTEST_SIDE).astype(int)
    inset = scale / 2 - 0.5
    left, right, top, bottom = inset, width - 1 - inset, inset, height - 1 - inset
    rectangle = np.array([[left, top], [right, top], [right, bottom], [left, bottom]], dtype=np.float32)
    transform = cv2.getPerspectiveTransform(corners, rectangle)
    return cv2.warpPerspective(paper, transform, (int(width), int(height)), borderValue=255)


def _shrink(gray: np.ndarray, side: int) -> np.ndarray:
    scale = min(1, side / max(gray.shape))
    height, width = (max(1, round(length * scale)) for length in gray.shape)
    return cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA)


def _fit_corners(outline: np.ndarray) -> np.ndarray | None:
    """Returns the corners (x, y) of an outline with four straight sides, `[4, 2]` float32 from top left, or None."""
    # Four rough corners.
    hull = cv2.convexHull(outline, clockwise=False)  # clockwise if y points down
    tolerances = cv2.arcLength(hull, True) * np.arange(0.01, 0.1, 0.005)
    polygons = (cv2.approxPolyDP(hull, tolerance, True)[:, 0] for tolerance in tolerances)
    rough = next((polygon for polygon in polygons if len(polygon) == 4), None)
    if rough is None:
        return None

    # In order from the top left one: the upper side leads most to the right, the lower one most to the left.
    rightwards = np.roll(rough, -1, axis=0)[:, 0] - rough[:, 0]  # of the side that starts at each corner
    rough = np.roll(rough, -int(np.argmax(rightwards - np.roll(rightwards, 2))), axis=0).astype(np.float64)

    # The lines through the sides meet in the corners, in homogeneous coordinates.
    points = outline[:, 0].astype(np.float64)
    sides = [_fit_side(points, rough[i], rough[(i + 1) % 4]) for i in range(4)]
    meetings = np.array([np.cross(sides[i - 1], sides[i]) for i in range(4)])
    if (np.abs(meetings[:, 2]) < 1e-9).any():
        return None
    corners = (meetings[:, :2] / meetings[:, 2:]).astype(np.float32)

    # The outline must fill the shape between them.
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
