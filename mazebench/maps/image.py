"""Mazes as pictures: drawn exactly, and read back from drawings and photographs.

`H` and `W` are the rows and columns of a picture, `N` the cells along a side of the maze. Row 0 of both is on top.
"""

from __future__ import annotations

import pathlib
import struct
from collections.abc import Iterator

import cv2
import numpy as np

from mazebench.errors import InputError
from mazebench.files import open_whole, read_at_most
from mazebench.maps.maze import MAX_SIZE, MIN_SIZE, Cell, Maze, MazeError

_MAX_BYTES = 32 * 2**20
_MAX_SIDE = 8192  # pixels of a drawing's side
_MAX_PIXELS = _MAX_SIDE**2  # of a picture read: above any phone's 50 megapixels, and every drawing can be read back
_PNG_START = b"\x89PNG\r\n\x1a\n"
_JPEG_SCAN = b"\xff\xda"  # begins a scan, and stands nowhere else in the coded picture
_MAX_SCANS = 100  # of a JPEG: progressive photographs have about ten, and a decoder goes over the whole picture in each

# Neighbouring wall cells differ by a shade that hardly shows: it makes the cells of every drawing countable.
_WALL_SHADES = np.array([[30, 32, 38], [34, 36, 42]], dtype=np.uint8)
_START_SHADE = (64, 160, 100)
_GOAL_SHADE = (214, 60, 60)
_PATH_SHADES = np.array([[70, 90, 200], [200, 80, 160], [250, 160, 50]])  # at the path's start, middle and end
_SUBPIXEL_BITS = 4  # cv2 draws at sixteenths of a pixel

_MAX_MAP_SHADES = 8  # a map of one pixel a cell has few shades (walls, floor, marks), a photograph has many
_WORKING_SIDE = 2400  # pixels; larger photographs are shrunk to it
_LIGHT_SIDE = 128  # pixels of the small copy in which the light on the paper is estimated
_MIN_LIGHT = 0.6  # of the best lit paper: what is darker over a wide area is wall, not paper in the shade
_MARGIN = 8  # pixels of paper laid around a photograph: a drawing cut out along its outer walls needs an outside
_MIN_FRAME_AREA = 0.05  # of the picture
_MIN_FRAME_FILL = 0.9  # ratio, either way, of the areas of a frame's outline and of the square fitted to it
_SQUARE_SIDE = 2048  # pixels of the deskewed drawing: 8 a cell for the largest maze
# Of edges on the grid. On synthetic photographs of 13 and 21 cells the true N had 0.6 to 0.95, any other at most 0.39.
_MIN_FIT = 0.4
_NEARLY_BEST = 0.97  # of the best fit
_CORE = 0.5  # part of a cell's side that decides what the cell is
_MIN_CONTRAST = 64  # between walls and floor, of 255
_MIN_LINE = 0.22  # of the contrast: what is drawn as a line, fainter than which are those of squared paper
_LINE_WIDTH, _LINE_LENGTH = 0.6, 0.9  # of a cell's side: what is a line and not a wall, nor a letter in a cell
_MIN_CLARITY = 0.1  # of the contrast: how far a core's shade is from the middle between wall and floor


def draw_maze(
    maze: Maze,
    cell_pixels: int = 16,
    start: Cell | None = None,
    goal: Cell | None = None,
    path: np.ndarray | None = None,
) -> np.ndarray:
    """A picture of `maze`, `[H, W, 3]` uint8 RGB with H = W = N * cell_pixels: walls near-black, floor white.

    `start` is marked by a green disc, `goal` by a red one; `path`, `[T, 2]` points (x, y) in metres equally spaced in
    time, is a line from blue (first) to orange (last). Without these, `maze_from_image` gives back the same maze.

    Raises:
      InputError: if the picture would be larger than 8192 pixels a side or `path` is no list of finite points.
      MazeError: if `start` or `goal` is not free.
    """
    if not 1 <= cell_pixels <= _MAX_SIDE // maze.size:
        raise InputError(f"expected 1 to {_MAX_SIDE // maze.size} pixels a cell for this maze, found {cell_pixels}")
    for cell in (start, goal):
        if cell is not None:
            maze.require_free(cell)
    return draw_grid(maze.walls, cell_pixels, start, goal, path)


def draw_grid(
    walls: np.ndarray,
    cell_pixels: int,
    start: Cell | None = None,
    goal: Cell | None = None,
    path: np.ndarray | None = None,
) -> np.ndarray:
    """The picture that `draw_maze` makes, of any `[N, N]` bool walls, such as those of a perturbed map.

    Raises:
      InputError: if `path` is no list of finite points.
    """
    chequered = _WALL_SHADES[np.indices(walls.shape).sum(axis=0) % 2]
    cells = np.where(walls[..., None], chequered, np.uint8(255))
    image = np.ascontiguousarray(cells.repeat(cell_pixels, axis=0).repeat(cell_pixels, axis=1))
    if path is not None:
        _draw_path(image, path, cell_pixels)
    for cell, shade in ((start, _START_SHADE), (goal, _GOAL_SHADE)):
        if cell is not None:
            centre = _to_subpixels(np.array([cell[1] + 0.5, cell[0] + 0.5]) * cell_pixels)
            radius = round(0.36 * cell_pixels * 2**_SUBPIXEL_BITS)
            cv2.circle(image, centre.tolist(), radius, shade, cv2.FILLED, cv2.LINE_AA, _SUBPIXEL_BITS)
    return image


def write_image(image: np.ndarray, path: str | pathlib.Path) -> None:
    """Writes `image` (`[H, W, 3]` uint8 RGB) as PNG, whatever the name ends in, all or nothing.

    Raises:
      InputError: if the file can't be written.
    """
    _, content = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    try:
        with open_whole(path) as file:
            file.write(content.tobytes())
    except OSError as error:
        raise InputError(f"{path}: can't write the picture: {error.strerror}") from error


def read_image_maze(path: str | pathlib.Path, size: int | None = None) -> Maze:
    """The maze in a PNG, JPEG or BMP file, named after the file; `maze_from_image` says what can be read.

    Raises:
      InputError: if the file can't be read or `size` is no size of a maze.
      MazeError: if it is too large, no such picture, or shows no legal maze.
    """
    path = pathlib.Path(path)
    content = read_at_most(path, _MAX_BYTES, "picture")
    return maze_from_image(_decode(content, str(path)), size, path.stem)


def maze_from_image(image: np.ndarray, size: int | None = None, name: str = "maze") -> Maze:
    """The maze that a picture of a floor plan shows; dark is wall, light or transparent is floor.

    Two kinds of plan are read, both with filled walls at least as thick as a cell:

    * a pixel map, in which each cell is a block of k x k pixels, k >= 1, is read exactly;
    * a scan or photograph of a drawn or printed plan: on paper or cut out along its outer walls, turned by less than 45
      degrees, in perspective, unevenly lit. The outer walls must form a closed square, the cells a regular grid.

    Thin-line plans, whose walls are lines between the cells, are not supported, nor are light walls on dark paper.

    Args:
      image: `[H, W]` gray, `[H, W, 3]` RGB or `[H, W, 4]` RGB and opacity, uint8 or uint16.
      size: N; estimated from the drawing if None.
      name: what the maze, and an error, calls the picture.

    Raises:
      InputError: if `size` is no size of a maze.
      MazeError: if no legal maze is found. Nothing is repaired, but the outer ring of a photographed plan is all wall.
    """
    if size is not None and not MIN_SIZE <= size <= MAX_SIZE:
        raise InputError(f"{name}: expected a size of {MIN_SIZE} to {MAX_SIZE} cells, found {size}")
    gray = _to_gray(image, name)
    walls = _pixel_map(gray, size)
    if walls is not None:
        return Maze(walls, name)
    paper, fine = _flatten(gray)
    problem = f"{name}: expected a drawing whose dark outer walls form a closed square, found none"
    for corners in _frames(_ink(paper)):
        try:
            return _read_plan(_deskew(paper, corners), _deskew(fine, corners), size, name)
        except MazeError as error:
            problem = str(error)
    advice = "give the number of cells a side" if size is None else f"are there {size} cells a side?"
    raise MazeError(f"{problem} ({advice})")


def _draw_path(image: np.ndarray, path: np.ndarray, cell_pixels: int) -> None:
    points = np.asarray(path, dtype=np.float64)
    if points.shape != (len(points), 2) or len(points) == 0 or not np.isfinite(points).all():
        raise InputError(f"expected a path of finite points, shape [T, 2], found shape {points.shape}")
    side = len(image)
    pixels = np.clip(points * [cell_pixels, -cell_pixels] + [0, side], -side, 2 * side)
    travelled = np.r_[0, np.cumsum(np.hypot(*np.diff(pixels, axis=0).T))]
    # Two pixels a segment: many shorter ones, each blended into the image, would harden the soft edge of the line.
    kept = np.unique(np.r_[np.searchsorted(travelled, np.arange(0, travelled[-1], 2)), len(points) - 1])
    times = np.linspace(0, 1, len(points))[kept]
    shades = np.stack([np.interp(times, [0, 0.5, 1], shade) for shade in _PATH_SHADES.T], axis=1)
    corners = _to_subpixels(pixels[kept]).tolist()
    thickness = max(1, round(cell_pixels / 6))
    for before, after, shade in zip(corners[:-1], corners[1:], shades[1:], strict=True):
        cv2.line(image, before, after, shade.tolist(), thickness, cv2.LINE_AA, _SUBPIXEL_BITS)


def _to_subpixels(points: np.ndarray) -> np.ndarray:
    # cv2 puts the centre of a pixel at whole numbers, this module at halves.
    return np.round((points - 0.5) * 2**_SUBPIXEL_BITS).astype(np.int64)


def _decode(content: bytes, name: str) -> np.ndarray:
    """The picture in a file's bytes, as `maze_from_image` takes it; refused before it is decoded if it is too large."""
    if len(content) > _MAX_BYTES:
        raise MazeError(f"{name}: expected a picture of at most {_MAX_BYTES // 2**20} MiB, found more")
    dimensions = _dimensions(content)
    if dimensions is None:
        raise MazeError(f"{name}: expected a PNG, JPEG or BMP picture, found {len(content)} bytes: {content[:8]!r}...")
    width, height = dimensions
    if width < 1 or not 1 <= height <= _MAX_PIXELS // width:
        raise MazeError(f"{name}: expected a picture of 1 to {_MAX_PIXELS} pixels, found {width} x {height}")
    num_scans = content.count(_JPEG_SCAN) if content.startswith(b"\xff\xd8") else 0
    if num_scans > _MAX_SCANS:
        raise MazeError(f"{name}: expected a JPEG of at most {_MAX_SCANS} scans, found {num_scans}")
    # Opacity is read from PNG only. A photograph is turned as its camera was held, which UNCHANGED would leave undone.
    flags = cv2.IMREAD_COLOR
    if content.startswith(_PNG_START):
        content, flags = _bare_png(content), cv2.IMREAD_UNCHANGED
    try:
        image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), flags)
    except cv2.error:
        image = None
    if image is None:
        raise MazeError(f"{name}: expected a whole {width} x {height} picture, found a damaged one")
    if image.ndim == 2:
        return image
    return cv2.cvtColor(image, cv2.COLOR_BGRA2RGBA if image.shape[2] == 4 else cv2.COLOR_BGR2RGB)


def _dimensions(content: bytes) -> tuple[int, int] | None:
    """The width and height that a picture's header declares; None if it is no PNG, JPEG or BMP."""
    if content.startswith(_PNG_START) and content[12:16] == b"IHDR" and len(content) >= 24:
        return struct.unpack_from(">II", content, 16)
    if content.startswith(b"BM") and len(content) >= 26:
        (header_bytes,) = struct.unpack_from("<I", content, 14)
        width, height = struct.unpack_from("<HH" if header_bytes == 12 else "<ii", content, 18)
        return width, abs(height)  # a negative height says that the rows run downwards
    return _jpeg_dimensions(content) if content.startswith(b"\xff\xd8") else None


def _jpeg_dimensions(content: bytes) -> tuple[int, int] | None:
    """Walks the segments up to the frame's; stricter than decoders are, so that none can find another frame first."""
    position = 2
    while position + 9 <= len(content):
        prefix, marker, segment_bytes = struct.unpack_from(">BBH", content, position)
        if prefix != 0xFF or marker < 0xC0 or 0xD0 <= marker <= 0xDA or segment_bytes < 2:
            return None
        if marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):  # those are tables and a reserved one
            height, width = struct.unpack_from(">HH", content, position + 5)
            return width, height
        position += 2 + segment_bytes
    return None


def _bare_png(content: bytes) -> bytes:
    """The chunks of a PNG that make the picture, up to the first that the file cuts short.

    A decoder would reserve the memory that a chunk cut short declares, and unpack texts of gigabytes.
    """
    kept = [_PNG_START]
    position = len(_PNG_START)
    while position + 12 <= len(content):
        data_bytes, kind = struct.unpack_from(">I4s", content, position)
        end = position + 12 + data_bytes
        if end > len(content):
            break
        if kind in (b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND"):
            kept.append(content[position:end])
        position = end
    return b"".join(kept)


def _to_gray(image: np.ndarray, name: str) -> np.ndarray:
    """`[H, W]` uint8: the luminance of a picture laid on white paper."""
    shape = image.shape
    if not (len(shape) == 2 or shape[2:] in ((3,), (4,))) or image.dtype not in (np.uint8, np.uint16):
        raise MazeError(f"{name}: expected a gray, RGB or RGBA picture of uint8 or uint16, found {shape} {image.dtype}")
    if min(shape[:2]) < MIN_SIZE:
        raise MazeError(f"{name}: expected at least {MIN_SIZE} x {MIN_SIZE} pixels, found {shape[1]} x {shape[0]}")
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    if len(shape) == 2:
        return image
    gray = cv2.cvtColor(np.ascontiguousarray(image[..., :3]), cv2.COLOR_RGB2GRAY)
    if shape[2] == 3:
        return gray
    opacity = image[..., 3].astype(np.uint16)
    return ((gray * opacity + 255 * (255 - opacity)) // 255).astype(np.uint8)


def _pixel_map(gray: np.ndarray, size: int | None) -> np.ndarray | None:
    """`[N, N]` bool: the walls of a pixel map; None if the picture isn't one."""
    height, width = gray.shape
    shades = np.flatnonzero(cv2.calcHist([gray], [0], None, [256], [0, 256]))
    if height != width or len(shades) < 2:
        return None
    dark = gray < shades[[0, -1]].mean()
    block = _block(gray)
    border = gray[0, ::block]
    if not (border[1:] != border[:-1]).all():  # not chequered as `draw_maze` does: shades may be what JPEG left of two
        block = _block(dark)
    num_cells = size or height // block
    cell = height // num_cells
    if not MIN_SIZE <= num_cells <= MAX_SIZE or cell * num_cells != height or block % cell:
        return None
    if block == 1 and len(shades) > _MAX_MAP_SHADES:
        return None
    walls = dark[::cell, ::cell]
    has_margin = not (walls[0].any() or walls[-1].any() or walls[:, 0].any() or walls[:, -1].any())
    return None if has_margin else walls


def _block(picture: np.ndarray) -> int:
    """The side in pixels of the largest square blocks of one shade that a square picture consists of."""
    rows = np.flatnonzero((picture[1:] != picture[:-1]).any(axis=1)) + 1
    columns = np.flatnonzero((picture[:, 1:] != picture[:, :-1]).any(axis=0)) + 1
    return int(np.gcd.reduce([*rows, *columns, len(picture)]))


def _flatten(gray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`[H', W']` uint8, twice: the picture at working size as if evenly lit, without its noise and with it.

    255 is the paper, also in a margin around it.
    """
    gray = _shrink(gray, _WORKING_SIDE)
    small = _shrink(gray, _LIGHT_SIDE)
    # A closing as wide as half the picture replaces the ink by the paper around it.
    closed = cv2.morphologyEx(small, cv2.MORPH_CLOSE, np.ones((max(small.shape) // 2,) * 2, np.uint8))
    light = np.maximum(closed, _MIN_LIGHT * np.percentile(closed, 95)).astype(np.float32)
    light = cv2.resize(cv2.GaussianBlur(light, (0, 0), 3), gray.shape[::-1], interpolation=cv2.INTER_LINEAR)
    fine = np.clip(255.0 * gray / np.maximum(light, 1), 0, 255).astype(np.uint8)
    fine = cv2.copyMakeBorder(fine, *(_MARGIN,) * 4, cv2.BORDER_CONSTANT, value=255)
    return cv2.medianBlur(fine, 3), fine


def _shrink(gray: np.ndarray, side: int) -> np.ndarray:
    scale = min(1, side / max(gray.shape))
    height, width = (max(1, round(length * scale)) for length in gray.shape)
    return cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA)


def _ink(paper: np.ndarray) -> np.ndarray:
    """uint8 of the same shape: 255 at ink, 0 at paper."""
    return (paper < np.mean(_dark_and_light(paper))).astype(np.uint8) * 255


def _dark_and_light(shades: np.ndarray) -> tuple[float, float]:
    """The means of the dark and of the light ones of `shades` (uint8, 2-D), by Otsu's method; equal if all are."""
    # Otsu's threshold may be the lightest of the dark shades: it parts them, but need not lie halfway between them.
    threshold, _ = cv2.threshold(shades, 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    counts = cv2.calcHist([shades], [0], None, [256], [0, 256]).ravel()
    levels = np.arange(256)
    everything = np.ones(256, dtype=bool)
    parts = (part if counts[part].any() else everything for part in (levels <= threshold, levels > threshold))
    dark, light = (float(counts[part] @ levels[part] / counts[part].sum()) for part in parts)
    return dark, light


def _frames(ink: np.ndarray) -> Iterator[np.ndarray]:
    """The corners of the largest shape, then of the largest clear of the picture's edge, as far as these are square.

    The second is the drawing where the picture shows a dark table around the paper.
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


def _fit_corners(outline: np.ndarray) -> np.ndarray | None:
    """`[4, 2]` float32: the corners (x, y), clockwise from top left, of an outline of four straight sides, or None."""
    hull = cv2.convexHull(outline, clockwise=False)  # clockwise if y points down
    tolerances = cv2.arcLength(hull, True) * np.arange(0.01, 0.1, 0.005)
    polygons = (cv2.approxPolyDP(hull, tolerance, True)[:, 0] for tolerance in tolerances)
    rough = next((polygon for polygon in polygons if len(polygon) == 4), None)
    if rough is None:
        return None
    rightwards = np.roll(rough, -1, axis=0)[:, 0] - rough[:, 0]  # of the side that starts at each corner
    rough = np.roll(rough, -int(np.argmax(rightwards - np.roll(rightwards, 2))), axis=0).astype(np.float64)
    points = outline[:, 0].astype(np.float64)
    sides = [_fit_side(points, rough[i], rough[(i + 1) % 4]) for i in range(4)]
    meetings = np.array([np.cross(sides[i - 1], sides[i]) for i in range(4)])  # homogeneous
    if (np.abs(meetings[:, 2]) < 1e-9).any():
        return None
    corners = (meetings[:, :2] / meetings[:, 2:]).astype(np.float32)
    smaller, larger = sorted((cv2.contourArea(outline), cv2.contourArea(corners)))
    return corners if smaller >= _MIN_FRAME_FILL * larger else None


def _fit_side(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """`[3]` float: the homogeneous line through the `points` of an outline near a side, away from its ends."""
    length = np.hypot(*(end - start))
    along = (end - start) / length
    share = (points - start) @ along / length
    away = np.abs((points - start) @ [-along[1], along[0]])
    near = points[(share > 0.05) & (share < 0.95) & (away < 0.03 * length)]
    near = np.concatenate([near, [start, end]])  # with the ends there is always a line
    direction, point = cv2.fitLine(near.astype(np.float32), cv2.DIST_HUBER, 0, 0.01, 0.01).reshape(2, 2).astype(float)
    return np.cross([*point, 1.0], [*(point + direction), 1.0])


def _deskew(paper: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """`[_SQUARE_SIDE, _SQUARE_SIDE]` uint8: the drawing as seen from straight above."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32) * (_SQUARE_SIDE - 1)
    transform = cv2.getPerspectiveTransform(corners, square)
    return cv2.warpPerspective(paper, transform, (_SQUARE_SIDE, _SQUARE_SIDE), borderValue=255)


def _read_plan(square: np.ndarray, fine: np.ndarray, size: int | None, name: str) -> Maze:
    """The maze in a deskewed drawing, `fine` with its noise; the outermost cells are the frame, walls all."""
    fits = _grid_fits(_ink(square))
    if size is None:
        is_best = (fits[1:-1] >= fits[:-2]) & (fits[1:-1] >= fits[2:]) & (fits[1:-1] >= _NEARLY_BEST * fits.max())
        size = 1 + int(np.argmax(is_best))
    if fits[size] < _MIN_FIT:
        raise MazeError(f"{name}: expected walls along the lines of a square grid of cells, found edges off it")
    cores = _cores(square, size)
    dark, light = _dark_and_light(np.round(cores).astype(np.uint8))
    if light - dark < _MIN_CONTRAST:
        raise MazeError(f"{name}: expected dark walls on light paper, found shades {dark:.0f} and {light:.0f} of 255")
    clarity = np.abs(cores - (dark + light) / 2) / (light - dark)
    clarity[[0, -1], :] = clarity[:, [0, -1]] = 1
    if clarity.min() < _MIN_CLARITY:
        cell = tuple(map(int, np.argwhere(clarity == clarity.min())[0]))
        raise MazeError(f"{name}: expected {size} x {size} cells of wall or floor, found cell {cell} between the two")
    walls = cores < (dark + light) / 2
    walls[[0, -1], :] = walls[:, [0, -1]] = True
    lines = _lines_in_floor(fine, walls, _MIN_LINE * (light - dark))
    if lines.any():
        cell = tuple(map(int, np.argwhere(lines)[0]))
        raise MazeError(
            f"{name}: expected filled walls as thick as a cell, found a thin line across the floor at {cell}"
        )
    return Maze(walls, name)


def _lines_in_floor(fine: np.ndarray, walls: np.ndarray, contrast: float) -> np.ndarray:
    """`[N, N]` bool: the floor cells through which, or along which, a dark line runs that is a cell long or longer."""
    size = len(walls)
    cell = _SQUARE_SIDE // size
    thick, long = max(3, round(_LINE_WIDTH * cell)), max(3, round(_LINE_LENGTH * cell))
    dark = cv2.morphologyEx(fine, cv2.MORPH_BLACKHAT, np.ones((thick, thick), np.uint8)) > contrast
    lines = np.zeros(fine.shape, dtype=bool)
    for kernel in (np.ones((1, long), np.uint8), np.ones((long, 1), np.uint8)):
        lines |= cv2.morphologyEx(dark.astype(np.uint8), cv2.MORPH_OPEN, kernel) > 0
    floor = cv2.resize((~walls).astype(np.uint8), fine.shape[::-1], interpolation=cv2.INTER_NEAREST)
    # The edges of walls are left out: a blur, or a drawing a little off its grid, casts shadows there.
    floor = cv2.erode(floor, np.ones((2 * (cell // 4) + 1,) * 2, np.uint8))
    rows, columns = np.nonzero(lines & (floor > 0))
    found = np.zeros_like(walls)
    found[rows * size // len(fine), columns * size // len(fine)] = True
    return found


def _grid_fits(ink: np.ndarray) -> np.ndarray:
    """`[MAX_SIZE + 2]` float: for each N, how well the edges of the ink lie on its grid, at best 1; -1 below MIN_SIZE.

    It is the mean of `cos(2 pi N x)` over the positions `x` of edges in parts of the frame's side. Multiples of the
    true N fit as well, but for what inexact edges cost them: of nearly equal N the least is the true one.
    """
    across = cv2.reduce(cv2.absdiff(ink[1:], ink[:-1]), 1, cv2.REDUCE_SUM, dtype=cv2.CV_64F)
    down = cv2.reduce(cv2.absdiff(ink[:, 1:], ink[:, :-1]), 0, cv2.REDUCE_SUM, dtype=cv2.CV_64F)
    edges = across.ravel() + down.ravel()
    positions = np.arange(1, len(ink)) / len(ink)
    edges[np.minimum(positions, 1 - positions) < 0.5 / MAX_SIZE] = 0  # the outside of the frame
    sizes = np.arange(MIN_SIZE, MAX_SIZE + 2)
    fits = np.cos(2 * np.pi * np.outer(sizes, positions)) @ edges / max(1, edges.sum())
    return np.concatenate([np.full(MIN_SIZE, -1.0), fits])


def _cores(square: np.ndarray, size: int) -> np.ndarray:
    """`[size, size]` float: the mean shade of the core of each cell."""
    sums = cv2.integral(square)
    bounds = (np.arange(size)[:, None] + [0.5 - _CORE / 2, 0.5 + _CORE / 2]) * _SQUARE_SIDE / size
    starts, ends = np.round(bounds).astype(int).T
    totals = sums[ends][:, ends] - sums[starts][:, ends] - sums[ends][:, starts] + sums[starts][:, starts]
    return totals / np.outer(ends - starts, ends - starts)
