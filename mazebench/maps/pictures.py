"""Drawings of mazes: `H` and `W` are the rows and columns of a picture, `N` the cells along a side of the maze.

Row 0 is on top. `mazebench.maps.readers.image` reads a drawing without markers exactly.
"""

from __future__ import annotations

import pathlib

import cv2
import numpy as np

from mazebench.errors import InputError
from mazebench.maps import colors
from mazebench.maps.maze import Cell, Maze
from mazebench.storage.files import open_whole, writing_to

MAX_SIDE = 8192  # pixels of a drawing's side
# Neighbouring wall cells alternate between two nearly equal shades, so that the cells of a drawing can be counted.
_WALL_SHADES = np.array([[30, 32, 38], [34, 36, 42]], dtype=np.uint8)
_PATH_SHADES = np.array([[70, 90, 200], [200, 80, 160], [250, 160, 50]])  # at the path's start, middle and end
_RAY_SHADE = (40, 150, 190)
_MOST_UNITS = 24  # cells a side; in larger mazes marks and paths are as large as in one of this size
_SUBPIXEL_BITS = 4  # cv2 draws at sixteenths of a pixel


def draw_maze(maze: Maze, cell_pixels: int = 16) -> np.ndarray:
    """Draws `maze` with near-black walls on white floor: `[H, W, 3]` uint8 RGB with H = W = N * cell_pixels.

    `mazebench.read_maze` reads it exactly.

    Raises:
      InputError: if the picture would be larger than 8192 pixels a side.
    """
    if not 1 <= cell_pixels <= MAX_SIDE // maze.size:
        raise InputError(f"expected 1 to {MAX_SIDE // maze.size} pixels a cell for this maze, found {cell_pixels}")
    return draw_grid(maze.walls, cell_pixels)


def draw_plan(maze: Maze, cell_pixels: int) -> np.ndarray:
    """Draws `maze` as `draw_maze` does, without the padding that makes a long building square: `[H, W, 3]` uint8 RGB.

    The picture has all rows and columns up to the last wall behind a free cell, along the axis that has fewer of them.
    """
    height, width = maze.free_cells.max(axis=0) + 2
    image = draw_maze(maze, cell_pixels)
    return image[: height * cell_pixels] if height <= width else image[:, : width * cell_pixels]


def draw_grid(
    walls: np.ndarray,
    cell_pixels: int,
    start: Cell | None = None,
    goal: Cell | None = None,
    path: np.ndarray | None = None,
) -> np.ndarray:
    """Draws any walls, such as those of a perturbed map, as `draw_maze` draws a maze.

    A green disc marks `start`, a red one `goal`, each at least 3 % of the picture wide. `path` is `[T, 2]` points
    (x, y) in cells, equally spaced in time; it is drawn as a line from blue (first) to orange (last).
    Cells of `walls` (`[N, N]`) are bool, or shares of wall in [0, 1], which are drawn in shades between floor and wall.

    Raises:
      InputError: if `path` is not finite points.
    """
    chequered = _WALL_SHADES[np.indices(walls.shape).sum(axis=0) % 2]
    cells = np.rint(255.0 - walls[..., None] * (255.0 - chequered)).astype(np.uint8)
    image = np.ascontiguousarray(cells.repeat(cell_pixels, axis=0).repeat(cell_pixels, axis=1))
    if path is not None:
        _draw_path(image, path, cell_pixels)
    for cell, color in ((start, colors.START), (goal, colors.GOAL)):
        if cell is not None:
            centre = _to_subpixels(np.array([cell[1] + 0.5, cell[0] + 0.5]) * cell_pixels)
            radius = round(0.36 * _unit(image, cell_pixels) * 2**_SUBPIXEL_BITS)
            cv2.circle(image, centre.tolist(), radius, colors.to_bytes(color), cv2.FILLED, cv2.LINE_AA, _SUBPIXEL_BITS)
    return image


def draw_rays(image: np.ndarray, cell_pixels: int, centre: np.ndarray, ends: np.ndarray) -> None:
    """Draws rays over a picture that `draw_grid` made, in place; the first one is thicker.

    Args:
      image: `[H, W, 3]` uint8 RGB.
      cell_pixels: of the picture.
      centre: `[2]` cells (x, y), where all rays begin.
      ends: `[R, 2]` cells, in the order of their directions.
    """
    points = np.concatenate([[centre], ends]) * [cell_pixels, -cell_pixels] + [0, len(image)]
    begin, *corners = _to_subpixels(points).tolist()

    # The area that the rays reach, translucent.
    area = image.copy()
    cv2.fillPoly(area, [np.array(corners)], _RAY_SHADE, cv2.LINE_AA, _SUBPIXEL_BITS)
    cv2.addWeighted(area, 0.25, image, 0.75, 0, dst=image)

    # The rays, with a dot at the end of each.
    unit = _unit(image, cell_pixels)
    for number, corner in enumerate(corners):
        thickness = max(1, round(unit / (10 if number == 0 else 30)))
        cv2.line(image, begin, corner, _RAY_SHADE, thickness, cv2.LINE_AA, _SUBPIXEL_BITS)
        radius = round(unit * 2**_SUBPIXEL_BITS / 12)
        cv2.circle(image, corner, radius, _RAY_SHADE, cv2.FILLED, cv2.LINE_AA, _SUBPIXEL_BITS)


def write_image(image: np.ndarray, path: str | pathlib.Path) -> None:
    """Writes `image` (`[H, W, 3]` uint8 RGB) as PNG, whatever the suffix of `path`, all or nothing.

    Raises:
      InputError: if the file can't be written.
    """
    _, content = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    with writing_to(pathlib.Path(path)), open_whole(path) as file:
        file.write(content.tobytes())


def _unit(image: np.ndarray, cell_pixels: int) -> float:
    """Returns the pixels by which marks and paths are measured: a cell's, or more where cells are too small to see."""
    return max(cell_pixels, len(image) / _MOST_UNITS)


def _draw_path(image: np.ndarray, path: np.ndarray, cell_pixels: int) -> None:
    points = np.asarray(path, dtype=np.float64)
    if points.shape != (len(points), 2) or len(points) == 0 or not np.isfinite(points).all():
        raise InputError(f"expected a path of finite points, shape [T, 2], found shape {points.shape}")
    # In pixels, y down, and how far along the path each point is.
    side = len(image)
    pixels = np.clip(points * [cell_pixels, -cell_pixels] + [0, side], -side, 2 * side)
    travelled = np.r_[0, np.cumsum(np.hypot(*np.diff(pixels, axis=0).T))]

    # Segments of two pixels: shorter ones are blended into the image so often that the line's soft edge is lost.
    kept = np.unique(np.r_[np.searchsorted(travelled, np.arange(0, travelled[-1], 2)), len(points) - 1])
    times = np.linspace(0, 1, len(points))[kept]
    shades = np.stack([np.interp(times, [0, 0.5, 1], shade) for shade in _PATH_SHADES.T], axis=1)

    corners = _to_subpixels(pixels[kept]).tolist()
    thickness = max(1, round(_unit(image, cell_pixels) / 6))
    for before, after, shade in zip(corners[:-1], corners[1:], shades[1:], strict=True):
        cv2.line(image, before, after, shade.tolist(), thickness, cv2.LINE_AA, _SUBPIXEL_BITS)


def _to_subpixels(points: np.ndarray) -> np.ndarray:
    # cv2 puts the centre of the first pixel at 0, this module at 0.5.
    return np.round((points - 0.5) * 2**_SUBPIXEL_BITS).astype(np.int64)
