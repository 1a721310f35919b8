"""Maps in JSON objects: houses of HouseExpo, and a grid under any key."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from mazebench.maps.maze import MazeError
from mazebench.maps.readers.cells import grid_of_numbers
from mazebench.maps.readers.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from mazebench.storage.json_files import parse_json

_RESOLUTION = 0.05  # m, the side of a pixel
_MAX_SIDE = 400.0  # m, of a house


def read_json_map(text: str, name: str) -> OccupancyGrid:
    """Returns the cells of the only list of rows of numbers in a JSON object, or the floor of a house.

    Raises:
      MazeError: if the text is no JSON, or has neither.
    """
    expected = f"{name}: expected a HouseExpo house, with points of its outline as verts, or one list of rows"
    try:
        content = parse_json(text)
    except ValueError as error:
        raise MazeError(f"{expected}, found {str(error)[:80]}") from error
    if "verts" in content:
        return _house(content["verts"], name)
    grids = [grid for value in content.values() if (grid := _array(value)) is not None and grid.ndim == 2]
    if len(grids) == 1:
        return grid_of_numbers(grids[0], name)
    hint = "; draw the plan as a picture, or write its cells as text" if "features" in content else ""  # GeoJSON
    raise MazeError(f"{expected}, found the keys {', '.join(content)}"[:200] + hint)


def _house(verts: Any, name: str) -> OccupancyGrid:
    """Returns the floor that points outline, `[K, 2]` (x, y) in metres. Boxes of rooms are only labels."""
    expected = f"{name}: expected verts of a HouseExpo house, the points (x, y) of its outline"
    corners = _array(verts)
    if corners is None or corners.shape[1:] != (2,):
        raise MazeError(f"{expected}, found {str(verts)[:60]}")
    corners = corners.astype(float)
    sides = np.ptp(corners, axis=0) if len(corners) > 2 else np.zeros(2)
    if not (sides.min() > 0 and sides.max() <= _MAX_SIDE):
        raise MazeError(f"{expected}, found {len(corners)} of them over {sides[0]:g} x {sides[1]:g} m")
    low = corners.min(axis=0) - _RESOLUTION
    width, height = np.ceil((corners.max(axis=0) - low) / _RESOLUTION).astype(int) + 2
    states = np.full((height, width), OCCUPIED, np.uint8)
    pixels = np.floor((corners - low) / _RESOLUTION).astype(np.int32)
    cv2.fillPoly(states, [pixels], FREE)
    return OccupancyGrid(states[::-1].astype(np.int8), _RESOLUTION, (float(low[0]), float(low[1]), 0.0), frame="map")


def _array(value: Any) -> np.ndarray | None:
    """Returns a value of JSON as an array of numbers; None if it is none."""
    try:
        array = np.array(value)
    except ValueError:  # of rows that differ in length
        return None
    return array if array.dtype.kind in "bif" and array.ndim else None
