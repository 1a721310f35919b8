"""Mazes in pictures in which each cell is a block of pixels, as drawings of this package are.

`H` and `W` are the numbers of rows and columns of a picture, `N` of cells along a side of the maze. Row 0 is on top.
"""

from __future__ import annotations

import io
import pathlib
import struct
import warnings

import cv2
import numpy as np
import PIL.Image
import PIL.ImageOps

from mazebench.errors import InputError
from mazebench.maps.file_kinds import kind_of, way_out
from mazebench.maps.maze import MAX_CHOSEN_SIZE, MIN_SIZE, MazeError, require_closed_border, require_connected
from mazebench.maps.pictures import MAX_SIDE
from mazebench.maps.readers.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from mazebench.storage.files import read_at_most

_MAX_BYTES = 2**27  # of a picture's file; _MAX_PIXELS gray pixels take half of it
_MAX_PIXELS = MAX_SIDE**2  # of a picture that is read: every drawing of this package
_FORMATS = ("PNG", "JPEG", "BMP", "GIF", "PPM", "TIFF", "WEBP")
_MIN_SIDE = 3  # cells on the shorter side: wall, floor, wall
_MARK_SATURATION = 90  # of 255, between the strongest and the weakest channel of a marker
_MAX_MARK_SHARE = 0.15  # of the picture, and of its dark pixels; if more are coloured, the paper or the walls are
_DARK_CELL = 0.35  # of the lightest shade, up to which a cell with soft edges is dark; as much below it, it is light
_MAX_MAP_SHADES = 8  # of a map of one pixel a cell: walls, floor, marks; a scan has more


def read_picture(path: str | pathlib.Path) -> np.ndarray:
    """Returns the picture in a file, as `grid_of_image` takes it.

    Raises:
      InputError: if the file can't be read or has more than 128 MiB.
      MazeError: if it is no picture, or has too many pixels.
    """
    content = read_at_most(path, _MAX_BYTES, "picture")
    try:
        with warnings.catch_warnings(action="ignore"), PIL.Image.open(io.BytesIO(content), formats=_FORMATS) as picture:
            if picture.width * picture.height <= _MAX_PIXELS:  # as its head says, before they take memory
                return _as_array(picture)
            found = f"{picture.width} x {picture.height}"
    except PIL.Image.DecompressionBombError:
        found = "many more"
    except (OSError, ValueError, SyntaxError, EOFError, OverflowError, LookupError, struct.error) as error:
        kind = kind_of(content) or "a file of another kind"
        raise MazeError(
            f"{path}: expected a picture, found {kind}{' that is damaged' * (kind == 'a picture')}{way_out(kind)}"
        ) from error
    raise MazeError(f"{path}: expected at most {_MAX_PIXELS} pixels, found {found}; crop it, or lower its resolution")


def _as_array(picture: PIL.Image.Image) -> np.ndarray:
    """Returns a picture as its camera was held, as `grid_of_image` takes it."""
    is_png = picture.format == "PNG"  # the only format whose opacity counts
    picture = PIL.ImageOps.exif_transpose(picture)
    if picture.mode == "1":
        return np.asarray(picture.convert("L"))
    if picture.mode == "L" and "transparency" not in picture.info:
        return np.asarray(picture)
    if picture.mode.startswith("I"):
        return np.asarray(picture).astype(np.uint16)
    return np.asarray(picture.convert("RGBA" if is_png and picture.has_transparency_data else "RGB"))


def grid_of_image(image: np.ndarray, size: int | None, name: str) -> OccupancyGrid:
    """Returns the cells of a pixel map, in which each cell is a block of k x k pixels, k >= 1; dark is wall.

    Where `size` is given, edges may be soft and k may be a fraction. A map of R x C cells that is not square is padded
    with wall, see `locate_maze`. Marks in colour on a map with gray walls are floor, and so is what is transparent.

    Args:
      image: `[H, W]` gray, `[H, W, 3]` RGB or `[H, W, 4]` RGB and opacity, uint8 or uint16.
      size: N, the cells on the longer side; by default, the largest blocks of one shade are cells.
      name: of the maze, also in errors.

    Raises:
      InputError: if `size` is out of range.
      MazeError: if it is no pixel map of a legal maze.
    """
    if size is not None and not MIN_SIZE <= size <= MAX_CHOSEN_SIZE:
        raise InputError(f"{name}: expected a size of {MIN_SIZE} to {MAX_CHOSEN_SIZE} cells, found {size}")
    gray = to_gray(image, name)
    walls = _pixel_map(gray, size)
    if walls is None and size is not None:
        walls = _cells_of(gray, size)
    if walls is None:
        raise MazeError(
            f"{name}: expected dark walls on a light ground and each cell as a block of pixels"
            f"{'; where edges are soft, --size is the number of cells on the longer side' if size is None else ''}"
            f"{f', {size} cells on the longer side' if size else ''}; a drawn or scanned plan needs "
            "--pixel-size, its metres a pixel"
        )
    require_closed_border(walls, name)
    require_connected(walls, name)
    return OccupancyGrid(np.where(walls, OCCUPIED, FREE).astype(np.int8), is_cells=True)


def to_gray(image: np.ndarray, name: str) -> np.ndarray:
    """Returns the luminance of a picture on white paper, without its markers in colour: `[H, W]` uint8.

    Raises:
      MazeError: if `image` is not of a kind that `grid_of_image` takes, or too small.
    """
    shape = image.shape
    if not (len(shape) == 2 or shape[2:] in ((3,), (4,))) or image.dtype not in (np.uint8, np.uint16):
        raise MazeError(f"{name}: expected a gray, RGB or RGBA picture of uint8 or uint16, found {shape} {image.dtype}")
    if min(shape[:2]) < _MIN_SIDE or max(shape[:2]) < MIN_SIZE:
        raise MazeError(f"{name}: expected at least {MIN_SIZE} x {_MIN_SIDE} pixels, found {shape[1]} x {shape[0]}")
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    if len(shape) == 2:
        return image
    colours = np.ascontiguousarray(image[..., :3])
    gray = cv2.cvtColor(colours, cv2.COLOR_RGB2GRAY)

    # Make pixels in strong colours white, which are marks, unless they may be paper or walls.
    is_mark = colours.max(axis=2) - colours.min(axis=2) >= _MARK_SATURATION
    dark = gray < 128
    if is_mark.mean() < _MAX_MARK_SHARE and is_mark[dark].mean() < _MAX_MARK_SHARE:
        gray[is_mark] = 255

    # Lay the picture on white paper.
    if shape[2] == 3:
        return gray
    opacity = image[..., 3].astype(np.uint16)
    return ((gray * opacity + 255 * (255 - opacity)) // 255).astype(np.uint8)


def _pixel_map(gray: np.ndarray, size: int | None) -> np.ndarray | None:
    """Returns the walls of a pixel map, `[R, C]` bool; None if the picture isn't one."""
    shades = np.flatnonzero(cv2.calcHist([gray], [0], None, [256], [0, 256]))
    if len(shades) < 2:
        return None
    dark = gray < shades[[0, -1]].mean()

    # The side of a block. If the border does not alternate as in a drawing of ours, only dark and light count: JPEG may
    # have made several shades of two.
    block = _block(gray)
    border = gray[0, ::block]
    if not (border[1:] != border[:-1]).all():
        block = _block(dark)

    # The side of a cell, of which a block has one or more.
    longer, shorter = max(gray.shape), min(gray.shape)
    num_cells = size or longer // block
    cell = longer // num_cells
    if (
        not MIN_SIZE <= num_cells <= MAX_CHOSEN_SIZE
        or cell * num_cells != longer
        or block % cell
        or shorter < _MIN_SIDE * cell
    ):
        return None
    if block == 1 and len(shades) > _MAX_MAP_SHADES:
        return None

    walls = dark[::cell, ::cell]
    has_margin = not (walls[0].any() or walls[-1].any() or walls[:, 0].any() or walls[:, -1].any())
    return None if has_margin else walls


def _cells_of(gray: np.ndarray, size: int) -> np.ndarray | None:
    """Returns the walls of a picture with `size` cells on the longer side; None if one is neither dark nor light."""
    height, width = np.maximum(np.round(np.array(gray.shape) * size / max(gray.shape)).astype(int), _MIN_SIDE).tolist()
    lightest, darkest = float(gray.max()), float(gray.min())
    shades = cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA).astype(float)
    shares = (shades - darkest) / max(lightest - darkest, 1.0)
    return None if ((shares > _DARK_CELL) & (shares < 1 - _DARK_CELL)).any() else shares <= _DARK_CELL


def _block(picture: np.ndarray) -> int:
    """Returns the side in pixels of the largest blocks of one shade that a picture consists of."""
    rows = np.flatnonzero((picture[1:] != picture[:-1]).any(axis=1)) + 1
    columns = np.flatnonzero((picture[:, 1:] != picture[:, :-1]).any(axis=0)) + 1
    return int(np.gcd.reduce([*rows, *columns, *picture.shape]))
