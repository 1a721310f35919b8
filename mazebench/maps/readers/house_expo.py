"""Houses of HouseExpo: JSON with the outline of the floor."""

from __future__ import annotations

import json

import cv2
import numpy as np

from mazebench.maps.maze import MazeError
from mazebench.maps.readers.occupancy_grid import FREE, OCCUPIED, OccupancyGrid

_RESOLUTION = 0.05  # m, the side of a pixel
_MAX_SIDE = 400.0  # m, of a house


def read_house(text: str, name: str) -> OccupancyGrid:
    """Returns the floor that `verts` outlines, `[K, 2]` points (x, y) in metres. Boxes of rooms are only labels.

    Raises:
      MazeError: if the text is no such JSON.
    """
    expected = f"{name}: expected the JSON of a HouseExpo house, with points of its outline as verts"
    try:
        content = json.loads(text)
        corners = np.array(content["verts"], dtype=float).reshape(-1, 2)
    except (ValueError, KeyError, TypeError) as error:
        raise MazeError(f"{expected}, found {str(error)[:80]}") from error
    sides = np.ptp(corners, axis=0) if len(corners) > 2 else np.zeros(2)
    if not (sides.min() > 0 and sides.max() <= _MAX_SIDE):
        raise MazeError(f"{expected}, found {len(corners)} points over {sides[0]:g} x {sides[1]:g} m")
    low = corners.min(axis=0) - _RESOLUTION
    width, height = np.ceil((corners.max(axis=0) - low) / _RESOLUTION).astype(int) + 2
    states = np.full((height, width), OCCUPIED, np.uint8)
    pixels = np.floor((corners - low) / _RESOLUTION).astype(np.int32)
    cv2.fillPoly(states, [pixels], FREE)
    return OccupancyGrid(states[::-1].astype(np.int8), _RESOLUTION, (float(low[0]), float(low[1]), 0.0))
