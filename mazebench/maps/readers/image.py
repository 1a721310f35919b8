"""Mazes in pictures in which each cell is a block of pixels, as drawings of this package are.

`H` and `W` are the numbers of rows and columns of a picture, `N` of cells along a side of the maze. Row 0 is on top.
"""

from __future__ import annotations

import contextlib
import io
import pathlib
import struct
import warnings

import cv2
import numpy as np
import PIL.Image
import PIL.ImageFile
import PIL.ImageOps

from mazebench.errors import InputError, remark
from mazebench.maps.file_kinds import kind_of, way_out
from mazebench.maps.maze import MAX_CHOSEN_SIZE, MIN_SIZE, MazeError, require_closed_border, require_connected
from mazebench.maps.pictures import MAX_SIDE
from mazebench.maps.readers.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from mazebench.storage.files import open_file, read_at_most

_MAX_BYTES = 2**27  # of a picture's file; _MAX_PIXELS gray pixels take half of it
_MAX_PIXELS = MAX_SIDE**2  # of a picture that is read: every drawing of this package
_FORMATS = ("PNG", "JPEG", "BMP", "GIF", "PPM", "TIFF", "WEBP")
_DAMAGED = (OSError, ValueError, SyntaxError, EOFError, OverflowError, LookupError, TypeError, struct.error)  # Pillow's
_LEAST_WHITE = 0.25  # of the lightest shade there can be; in a deep picture with less, another one means white
_MIN_SIDE = 3  # cells on the shorter side: wall, floor, wall
_MARK_SATURATION = 90  # of 255, between the strongest and the weakest channel of a marker
_MAX_MARK_SHARE = 0.15  # of the picture, and of its dark pixels; if more are coloured, the paper or the walls are
_DARK_CELL = 0.35  # of the lightest shade, up to which a cell with soft edges is dark; as much below it, it is light
_MAX_MAP_SHADES = 8  # of a map of one pixel a cell: walls, floor, marks; a scan has more


def is_picture(path: str | pathlib.Path) -> bool:
    """Returns whether a file begins as a picture that is read, whatever its name says.

    Raises:
      InputError: if it can't be read.
    """
    with open_file(path, "map") as file:
        return kind_of(file.read(1000)) == "a picture"


def read_picture(path: str | pathlib.Path) -> np.ndarray:
    """Returns the picture in a file, as `grid_of_image` takes it.

    Raises:
      InputError: if the file can't be read or has more than 128 MiB.
      MazeError: if it is no picture, has too many pixels, or more than 8 bits of which only the lowest are used.
    """
    content, image, num_pages = read_at_most(path, _MAX_BYTES, "picture"), None, 1
    try:
        with warnings.catch_warnings(action="ignore"), PIL.Image.open(io.BytesIO(content), formats=_FORMATS) as picture:
            found = f"{picture.width} x {picture.height}"
            if picture.width * picture.height <= _MAX_PIXELS:  # as its head says, before they take memory
                image = _as_array(picture, content, str(path))
                with contextlib.suppress(*_DAMAGED):  # of pages after the first
                    num_pages = getattr(picture, "n_frames", 1)
    except MazeError:
        raise
    except PIL.Image.DecompressionBombError:
        found = "many more"
    except _DAMAGED as error:
        kind = kind_of(content) or "a file of another kind"
        raise MazeError(
            f"{path}: expected a picture, found {kind}{' that is damaged' * (kind == 'a picture')}{way_out(kind)}"
        ) from error
    if image is None:
        raise MazeError(
            f"{path}: expected at most {_MAX_PIXELS} pixels, found {found}; crop it, or lower its resolution"
        )
    if num_pages > 1:
        remark(f"{path}: the first of {num_pages} pages is read; save another one as a picture of its own")
    return image


def _as_array(picture: PIL.ImageFile.ImageFile, content: bytes, name: str) -> np.ndarray:
    """Returns a picture, in a file of `content`, as its camera was held, as `grid_of_image` takes it.

    Raises:
      MazeError: if it has more than 8 bits and none of its shades is light.
    """
    is_deep = picture.mode[0] in "IF" or ";16" in str(picture.tile)
    if picture.format == "PPM":
        (tile,) = picture.tile
        if content[tile.offset - 1 : tile.offset + 1] == b"\r\n":  # the head's last line end, of which one is expected
            picture.tile = [tile._replace(offset=tile.offset + 1)]
    upright = PIL.ImageOps.exif_transpose(picture)
    mode, has_opacity = upright.mode, upright.has_transparency_data
    white = 65535 if mode[0] == "I" else 255
    if mode[0] in "IF" or (mode in ("1", "L") and not has_opacity):
        image = np.asarray(upright if mode != "1" else upright.convert("L"))
    else:
        image = np.asarray(upright.convert("RGBA" if has_opacity else "RGB"))

    # Which number is white is certain only if the lightest shade is near to it.
    if is_deep and not has_opacity and image.any():
        low, high = float(image.min()), float(image.max())
        if not (low >= 0 and _LEAST_WHITE * white <= high <= white):
            found = f"{low:g} to {high:g} in a picture of 16 or 32 bits; save it with 8 bits"
            raise MazeError(f"{name}: expected shades of which the lightest is near {white}, found {found}")
    image = image.astype(np.uint16 if white > 255 else np.uint8)
    if has_opacity and image.ndim == 2:  # one of the shades is transparent
        return np.dstack([image] * 3 + [np.where(image == upright.info["transparency"], 0, white).astype(image.dtype)])
    return image


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
    if is_mark.mean() < _MAX_MARK_SHARE and dark.any() and is_mark[dark].mean() < _MAX_MARK_SHARE:
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
