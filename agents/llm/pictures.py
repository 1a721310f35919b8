"""The pictures of a prompt: the map with what is known in it, and what the robot's camera saw, as PNG."""

from __future__ import annotations

import math

import cv2
import numpy as np

from mazebench.maps import colors
from mazebench.maps.maze import Cell
from mazebench.maps.pictures import draw_grid

_SIDE = 744  # pixels of a map, about; services make larger pictures smaller, often to 768
_CELL_PIXELS = (8, 32)  # the least and the most of a cell's side
_NUMBERED = 5  # of so many rows and columns, one has its number where cells are too small for each
_SEEN_WALL, _SEEN_FREE = (255, 150, 0), (110, 190, 255)  # RGB
_POSE, _NUMBER, _LINE = (230, 0, 230), (255, 255, 255), 205
_MARK, _DISC, _ROBOT = 0.3, 0.25, 0.3  # of a cell's side: half a mark of what was seen, and radii
_VIEW_HEIGHT = 75 / 360  # of a view all round, as a share of its width; see `Camera`
_STRIP = 20  # pixels above a view all round, which name the directions


def draw_map(
    walls: np.ndarray,
    start: Cell | None,
    goal: Cell,
    pose: tuple[float, float, float],
    seen: np.ndarray | None = None,
) -> np.ndarray:
    """Draws a map `[N, N]` bool as a picture `[N P, N P, 3]` uint8 RGB with P pixels a cell, 24 for 31 cells.

    Rows and columns are numbered along the border. The start is a green disc, the goal a red one. A magenta disc with
    an arrow is the robot at `pose`: x and y in cells, and yaw in rad. Of `seen` `[N, N]`, a wall (positive) is a small
    orange square, and a free cell (negative) a light blue one.
    """
    size = len(walls)
    pixels = min(max(_SIDE // size, _CELL_PIXELS[0]), _CELL_PIXELS[1])
    image = draw_grid(walls, pixels)

    # What was seen, in the middle of its cell.
    for row, column in np.argwhere(np.zeros(walls.shape) if seen is None else seen).tolist():
        low, high = round(pixels * (0.5 - _MARK)), round(pixels * (0.5 + _MARK))
        place = slice(row * pixels + low, row * pixels + high), slice(column * pixels + low, column * pixels + high)
        image[place] = _SEEN_WALL if seen is not None and seen[row, column] > 0 else _SEEN_FREE

    # Lines between free cells, and the number of each row and column at both of its ends.
    for lines in (image[::pixels], image[:, ::pixels]):
        lines[(lines == 255).all(axis=-1)] = _LINE
    every = 1 if pixels >= 20 else _NUMBERED
    scale = 0.36 if every == 1 else 0.3
    for number in range(0, size, every):
        for column, row in {(number, 0), (number, size - 1), (0, number), (size - 1, number)}:
            if number or column == row:
                _write(image, str(number), (column + 0.5) * pixels, (row + 0.5) * pixels, scale, _NUMBER)

    for cell, color in ((start, colors.START), (goal, colors.GOAL)):
        if cell is not None:
            centre = round((cell[1] + 0.5) * pixels), round((cell[0] + 0.5) * pixels)
            cv2.circle(image, centre, round(_DISC * pixels), colors.to_bytes(color), cv2.FILLED, cv2.LINE_AA)

    x, y, yaw = pose
    middle = np.array([x, size - y]) * pixels
    tip = (middle + pixels * np.array([math.cos(yaw), -math.sin(yaw)])).astype(int).tolist()
    cv2.circle(image, middle.astype(int).tolist(), round(_ROBOT * pixels), _POSE, cv2.FILLED, cv2.LINE_AA)
    cv2.arrowedLine(image, middle.astype(int).tolist(), tip, _POSE, max(2, pixels // 8), cv2.LINE_AA, tipLength=0.4)
    return image


def draw_panorama(view: np.ndarray, yaw: float) -> np.ndarray:
    """Draws a view all round `[H, H, 3]`, with what is ahead in the middle, as `[~ 5/12 H, 2 H, 3]` uint8 RGB.

    North is in the middle, as by the heading `yaw` (rad), and south at both sides; a strip above it says so.
    """
    side = len(view)
    turned = np.roll(view, round((math.pi / 2 - yaw) / (2 * math.pi) * side), axis=1)
    image = cv2.resize(turned, (2 * side, round(2 * side * _VIEW_HEIGHT)), interpolation=cv2.INTER_AREA)
    strip = np.full((_STRIP, 2 * side, 3), 255, dtype=np.uint8)
    for place, name in enumerate(("south", "west", "north", "east", "south")):
        _write(strip, name, place * side / 2, _STRIP / 2, 0.45, (0, 0, 0))
    return np.concatenate([strip, image])


def to_png(image: np.ndarray) -> bytes:
    """Returns a picture `[H, W, 3]` uint8 RGB as PNG."""
    smallest = (cv2.IMWRITE_PNG_COMPRESSION, 9, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_DEFAULT)
    return cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), smallest)[1].tobytes()


def _write(image: np.ndarray, text: str, x: float, y: float, scale: float, color: tuple[int, int, int]) -> None:
    """Writes a text around a point (pixels), within the picture."""
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
    left = min(max(round(x - width / 2), 0), image.shape[1] - width)
    cv2.putText(image, text, (left, round(y + height / 2)), cv2.FONT_HERSHEY_SIMPLEX, scale, color, 1, cv2.LINE_AA)
