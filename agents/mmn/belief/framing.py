"""Shown maps on the grid of the maze's cells.

`P` is the side of a context in pixels, `M` the side of the map that is read from it, in cells.
"""

from __future__ import annotations

import cv2
import numpy as np

from mazebench.tasks import context as planes

from .belief import GOAL, MAP, NUM_SHOWN, START

_INNER = 1  # the first cell of a maze that may be free: the border is wall


def framed(context: np.ndarray, size: int) -> np.ndarray:
    """Returns a context `[4, P, P]` as `[3, M, M]` float32: the map, and one-hot marks of goal and start.

    A picture of more pixels than cells is stretched so that its free pixels fill the cells inside of the border.
    """
    pixels = context.shape[-1]
    if pixels <= size:
        return context[[planes.GLOBAL_MAP, planes.GOAL, planes.START]]
    picture = context[planes.GLOBAL_MAP]
    spans = [_free_span(picture.min(axis=1 - axis)) for axis in range(2)]
    scale = [(end - begin) / (size - 2 * _INNER) for begin, end in spans]  # pixels per cell
    origin = [begin - _INNER * each for (begin, _), each in zip(spans, scale, strict=True)]
    shown = np.zeros((NUM_SHOWN, size, size), dtype=np.float32)
    shown[MAP] = _resampled(picture, origin, scale, size)
    for plane, mark in ((planes.GOAL, GOAL), (planes.START, START)):
        for pixel in np.argwhere(context[plane]):
            cell = [(place + 0.5 - begin) / each for place, begin, each in zip(pixel, origin, scale, strict=True)]
            row, column = np.clip(np.floor(cell), 0, size - 1).astype(int)
            shown[mark, row, column] = 1
    return shown


def _free_span(least: np.ndarray) -> tuple[int, int]:
    """Returns first and last pixel, plus one, where the least share of wall of rows or columns `[P]` is below half."""
    free = np.flatnonzero(least < 0.5)
    return (int(free[0]), int(free[-1]) + 1) if len(free) > 1 else (0, len(least))


def _resampled(picture: np.ndarray, origin: list[float], scale: list[float], size: int) -> np.ndarray:
    """Returns `[M, M]`: means of the picture over cells of `scale` pixels from `origin` on."""
    fine = 4  # points per cell along each axis
    points = [
        begin + each * (np.arange(size * fine) + 0.5) / fine - 0.5 for begin, each in zip(origin, scale, strict=True)
    ]
    rows, columns = np.meshgrid(*points, indexing="ij")
    sampled = cv2.remap(
        picture.astype(np.float32),
        columns.astype(np.float32),
        rows.astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=1,
    )
    return sampled.reshape(size, fine, size, fine).mean(axis=(1, 3))
