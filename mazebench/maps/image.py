"""Mazes as pictures: drawn exactly, and read back from drawings and photographs.

`H` and `W` are the rows and columns of a picture, `N` the cells along a side of the maze. Pictures are RGB, row 0 on top.
"""

from __future__ import annotations

import pathlib
import struct
from collections.abc import Iterator

import cv2
import numpy as np

from mazebench.errors import InputError
from mazebench.maps.maze import MAX_SIZE, MIN_SIZE, Cell, Maze, MazeError

_MAX_BYTES = 32 * 2**20
_MAX_SIDE = 8192  # pixels of a drawing's side
_MAX_PIXELS = _MAX_SIDE**2  # of a picture read; above any phone's 50 megapixels, and every drawing can be read back

# Neighbouring wall cells differ by a shade no eye sees: it makes the cells of every drawing countable.
_WALL_SHADES = np.array([[30, 32, 38], [34, 36, 42]], dtype=np.uint8)
_FREE_SHADE = (255, 255, 255)
_START_SHADE = (64, 160, 100)
_GOAL_SHADE = (214, 60, 60)
_PATH_SHADES = np.array([[70, 90, 200], [200, 80, 160], [250, 160, 50]])  # at the path's start, middle and end
_SUBPIXEL_BITS = 4  # cv2 draws at sixteenths of a pixel

_MAX_EXACT_SHADES = 8  # a map of one pixel a cell has few shades (walls, floor, marks); a photograph has many
_WORKING_SIDE = 2400  # pixels; a photograph is shrunk to it
_BACKGROUND_SIDE = 128  # pixels of the small copy in which the light on the paper is estimated
_MIN_LIGHT = 0.6  # of the brightest paper: what is darker over a wide area is wall, not paper in the shade
_SQUARE_SIDE = 2048  # pixels of the deskewed drawing: 8 a cell for the largest maze
_MARGIN = 8  # pixels of paper laid around a photograph, so that a drawing cut out along its walls has an outside
_MIN_FRAME_AREA = 0.05  # of the picture
_MIN_FRAME_FILL = 0.9  # share of the fitted frame that the drawing's outline fills, and the other way round
_MIN_FIT = 0.4  # of edges on the grid; true grids measured 0.6 to 0.95, false ones at most 0.39
_NEARLY_BEST = 0.97
_MIN_CONTRAST = 64  # between walls and floor; the paper is 255
_CORE = 0.5  # of a cell's side
_UNCLEAR_BAND = 0.1  # half width, in parts of the contrast, of the band in which a cell is neither wall nor floor


def draw_maze(
    maze: Maze,
    cell_pixels: int = 16,
    start: Cell | None = None,
    goal: Cell | None = None,
    path: np.ndarray | None = None,
) -> np.ndarray:
    """A picture of `maze`, `[H, W, 3]` uint8 RGB with H = W = N * cell_pixels: walls near-black, floor white.

    Without `start`, `goal` and `path`, `maze_from_image` gives back the same maze.

    Args:
      maze: what to draw.
      cell_pixels: the side of a cell in pixels.
      start: a free cell to mark by a green disc.
      goal: a free cell to mark by a red disc.
      path: `[T, 2]` points (x, y) in metres, drawn as a line from blue (first) to orange (last).

    Raises:
      InputError: if the picture would be larger than 8192 pixels a side or `path` is no list of finite points.
      MazeError: if `start` or `goal` is not free.
    """
    if not 1 <= cell_pixels <= _MAX_SIDE // maze.size:
        raise InputError(f"expected 1 to {_MAX_SIDE // maze.size} pixels a cell for this maze, found {cell_pixels}")
    chequered = _WALL_SHADES[np.indices(maze.walls.shape).sum(axis=0) % 2]
    cells = np.where(maze.walls[..., None], chequered, np.array(_FREE_SHADE, dtype=np.uint8))
    image = np.ascontiguousarray(cells.repeat(cell_pixels, axis=0).repeat(cell_pixels, axis=1))
    if path is not None:
        _draw_path(image, path, maze.size, cell_pixels)
    for cell, shade in ((start, _START_SHADE), (goal, _GOAL_SHADE)):
        if cell is not None:
            row, column = maze.require_free(cell)
            _draw_disc(image, np.array([column + 0.5, row + 0.5]) * cell_pixels, 0.36 * cell_pixels, shade)
    return image


def write_image(image: np.ndarray, path: str | pathlib.Path) -> None:
    """Writes `image` (`[H, W, 3]` uint8 RGB) as PNG.

    Raises:
      InputError: if the file can't be written.
    """
    _, content = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    try:
        pathlib.Path(path).write_bytes(content.tobytes())
    except OSError as error:
        raise InputError(f"{path}: can't write the picture: {error.strerror}") from error


def read_image_maze(path: str | pathlib.Path, size: int | None = None) -> Maze:
    """The maze in a PNG, JPEG or BMP file, named after the file; `maze_from_image` says what can be read.

    Raises:
      InputError: if the file can't be read or `size` is no size of a maze.
      MazeError: if it is too large, no such picture, or shows no legal maze.
    """
    path = pathlib.Path(path)
    try:
        with path.open("rb") as file:
            content = file.read(_MAX_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: can't read the picture: {error.strerror}") from error
    return maze_from_image(_decode(content, str(path)), size, path.stem)


def maze_from_image(image: np.ndarray, size: int | None = None, name: str = "maze") -> Maze:
    """The maze that a picture of a floor plan shows; dark is wall, light and transparent are floor.

    Two kinds of plan are read, both with walls as thick as corridors, filled:

    * a pixel map, each cell a block of k x k pixels of one shade, is read exactly;
    * a scan or a photograph of a drawn or printed plan, with paper around it or cut out along its outer walls, turned by
      less than 45 degrees, in perspective, unevenly lit. The outer walls must form a closed frame, the cells one grid.

    Thin-line plans, whose walls are lines between the cells, are not supported, nor are light walls on dark paper.

    Args:
      image: `[H, W]` gray, `[H, W, 3]` RGB or `[H, W, 4]` RGB and opacity, uint8 or uint16.
      size: N; estimated from the drawing if None.
      name: of the maze, and what errors call the picture.

    Raises:
      InputError: if `size` is no size of a maze.
      MazeError: if the picture shows no legal maze. Nothing is repaired, except that a photographed frame is all wall.
    """
    if size is not None and not MIN_SIZE <= size <= MAX_SIZE:
        raise InputError(f"{name}: expected a size of {MIN_SIZE} to {MAX_SIZE} cells, found {size}")
    gray = _to_gray(image, name)
    walls = _pixel_map(gray, size)
    if walls is not None:
        return Maze(walls, name)
    paper = _flatten(gray)
    problem = f"{name}: expected a drawing whose dark outer walls form a closed square frame, found none"
    for corners in _frames(_ink(paper)):
        try:
            return _read_plan(_deskew(paper, corners), size, name)
        except MazeError as error:
            problem = str(error)
    advice = "give the number of cells a side" if size is None else f"are there {size} cells a side?"
    raise MazeError(f"{problem} ({advice})")


def _draw_disc(image: np.ndarray, centre: np.ndarray, radius: float, shade: tuple[int, int, int]) -> None:
    """Fills a disc in place; `centre` (x, y) and `radius` in pixels, pixel centres at halves."""
    x, y = _to_subpixels(centre)
    radius = max(1, round(radius * 2**_SUBPIXEL_BITS))
    cv2.circle(image, (int(x), int(y)), radius, shade, -1, cv2.LINE_AA, _SUBPIXEL_BITS)


def _draw_path(image: np.ndarray, path: np.ndarray, size: int, cell_pixels: int) -> None:
    points = np.asarray(path, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise InputError(f"expected a path of finite points, shape [T, 2], found shape {points.shape}")
    pixels = np.clip(np.stack([points[:, 0], size - points[:, 1]], axis=1), -1, size + 1) * cell_pixels
    times = _spaced(pixels, 2.0)
    middle = np.linspace(0, 1, len(_PATH_SHADES))
    shades = np.stack([np.interp(times / max(1, len(points) - 1), middle, shade) for shade in _PATH_SHADES.T], axis=1)
    corners = _to_subpixels(pixels[times])
    thickness = max(1, round(cell_pixels / 6))
    for before, after, shade in zip(corners[:-1], corners[1:], shades[1:], strict=True):
        cv2.line(image, before.tolist(), after.tolist(), shade.tolist(), thickness, cv2.LINE_AA, _SUBPIXEL_BITS)


def _spaced(points: np.ndarray, spacing: float) -> np.ndarray:
    """Indices of `points` at least `spacing` apart, and the last: short segments would blend away the soft edge of a line."""
    kept = list(range(min(1, len(points))))
    for i in range(1, len(points)):
        if i == len(points) - 1 or np.hypot(*(points[i] - points[kept[-1]])) >= spacing:
            kept.append(i)
    return np.array(kept, dtype=np.int64)


def _to_subpixels(points: np.ndarray) -> np.ndarray:
    # cv2 puts a pixel's centre at whole numbers, this module at halves.
    return np.round((points - 0.5) * 2**_SUBPIXEL_BITS).astype(np.int64)


def _decode(content: bytes, name: str) -> np.ndarray:
    """The picture in a file's bytes, as `maze_from_image` takes it. Its dimensions are checked before it is decoded."""
    if len(content) > _MAX_BYTES:
        raise MazeError(f"{name}: expected a picture of at most {_MAX_BYTES // 2**20} MiB, found more")
    dimensions = _dimensions(content)
    if dimensions is None:
        raise MazeError(f"{name}: expected a PNG, JPEG or BMP picture, found {content[:4]!r}... ({len(content)} bytes)")
    width, height = dimensions
    if not 0 < width * height <= _MAX_PIXELS:
        raise MazeError(f"{name}: expected a picture of 1 to {_MAX_PIXELS} pixels, found {width} x {height}")
    # Only PNG has opacity worth keeping; the others are turned as their camera was held, which UNCHANGED leaves undone.
    flags = cv2.IMREAD_UNCHANGED if content.startswith(b"\x89PNG") else cv2.IMREAD_COLOR
    try:
        image = cv2.imdecode(np.frombuffer(content, dtype=np.uint8), flags)
    except cv2.error as error:
        raise MazeError(f"{name}: expected a whole picture, found one that can't be decoded ({error.err})") from error
    if image is None:
        raise MazeError(f"{name}: expected a whole picture, found a damaged one ({len(content)} bytes)")
    if image.ndim == 2:
        return image
    return cv2.cvtColor(image, cv2.COLOR_BGRA2RGBA if image.shape[2] == 4 else cv2.COLOR_BGR2RGB)


def _dimensions(content: bytes) -> tuple[int, int] | None:
    """The width and height that a picture's header declares, None if it is no PNG, JPEG or BMP."""
    if content.startswith(b"\x89PNG\r\n\x1a\n") and content[12:16] == b"IHDR" and len(content) >= 24:
        return struct.unpack_from(">II", content, 16)
    if content.startswith(b"\xff\xd8"):
        return _jpeg_dimensions(content)
    if content.startswith(b"BM") and len(content) >= 26:
        (header_bytes,) = struct.unpack_from("<I", content, 14)
        width, height = struct.unpack_from("<HH" if header_bytes == 12 else "<ii", content, 18)
        return width, abs(height)  # a negative height says that the top row comes first
    return None


def _jpeg_dimensions(content: bytes) -> tuple[int, int] | None:
    """Walks the segments up to the frame header; stricter than decoders are, so that none finds another header than this."""
    position = 2
    while position + 9 <= len(content):
        prefix, marker, segment_bytes = struct.unpack_from(">BBH", content, position)
        if prefix != 0xFF or segment_bytes < 2 or marker < 0xC0 or 0xD0 <= marker <= 0xDA:
            return None
        if marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):  # all but tables and a reserved one
            height, width = struct.unpack_from(">HH", content, position + 5)
            return width, height
        position += 2 + segment_bytes
    return None


def _to_gray(image: np.ndarray, name: str) -> np.ndarray:
    """`[H, W]` uint8: the luminance of a picture laid on white paper."""
    image = np.asarray(image)
    known_shape = image.ndim == 2 or (image.ndim == 3 and image.shape[2] in (3, 4))
    if not known_shape or image.dtype not in (np.uint8, np.uint16):
        raise MazeError(
            f"{name}: expected [H, W], [H, W, 3] or [H, W, 4] of uint8 or uint16, found {image.shape} of {image.dtype}"
        )
    if min(image.shape[:2]) < MIN_SIZE:
        raise MazeError(
            f"{name}: expected at least {MIN_SIZE} x {MIN_SIZE} pixels, found {image.shape[1]} x {image.shape[0]}"
        )
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    if image.ndim == 2:
        return image
    gray = cv2.cvtColor(np.ascontiguousarray(image[..., :3]), cv2.COLOR_RGB2GRAY)
    if image.shape[2] == 3:
        return gray
    opacity = image[..., 3].astype(np.uint16)
    return ((gray * opacity + 255 * (255 - opacity)) // 255).astype(np.uint8)


def _pixel_map(gray: np.ndarray, size: int | None) -> np.ndarray | None:
    """`[N, N]` bool: the walls of a pixel map; None if the picture isn't one."""
    height, width = gray.shape
    shades = np.flatnonzero(np.bincount(gray.ravel(), minlength=256))
    if height != width or len(shades) < 2:
        return None
    rows = np.flatnonzero((gray[1:] != gray[:-1]).any(axis=1)) + 1
    columns = np.flatnonzero((gray[:, 1:] != gray[:, :-1]).any(axis=0)) + 1
    block = int(np.gcd.reduce(np.concatenate([rows, columns, [height]])))  # pixels; no shade changes inside of one
    cell = block if size is None else height // size
    if cell == 0 or block % cell or height % cell or not MIN_SIZE <= height // cell <= MAX_SIZE:
        return None
    if block == 1 and len(shades) > _MAX_EXACT_SHADES:
        return None
    walls = gray[::cell, ::cell] < (int(shades[0]) + int(shades[-1])) / 2
    has_margin = not np.concatenate([walls[0], walls[-1], walls[:, 0], walls[:, -1]]).any()
    return None if has_margin else walls


def _flatten(gray: np.ndarray) -> np.ndarray:
    """`[H', W']` uint8: a picture of at most `_WORKING_SIDE`, evenly lit: 255 is the paper, a margin of it all around."""
    gray = cv2.medianBlur(_shrink(gray, _WORKING_SIDE), 3)
    small = _shrink(gray, _BACKGROUND_SIDE)
    # A closing as wide as half the picture replaces the ink by the paper around it.
    light = cv2.morphologyEx(small, cv2.MORPH_CLOSE, np.ones((max(small.shape) // 2,) * 2, np.uint8)).astype(np.float32)
    light = cv2.GaussianBlur(np.maximum(light, _MIN_LIGHT * np.percentile(light, 95)), (0, 0), 3)
    light = cv2.resize(light, gray.shape[::-1], interpolation=cv2.INTER_LINEAR)
    paper = np.clip(255.0 * gray / np.maximum(light, 1), 0, 255).astype(np.uint8)
    return cv2.copyMakeBorder(paper, *(_MARGIN,) * 4, cv2.BORDER_CONSTANT, value=255)


def _shrink(gray: np.ndarray, side: int) -> np.ndarray:
    scale = min(1, side / max(gray.shape))
    height, width = (max(1, round(length * scale)) for length in gray.shape)
    return cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA)


def _ink(paper: np.ndarray) -> np.ndarray:
    """uint8 of the same shape: 255 at ink, 0 at paper."""
    return (paper < _middle(paper)).astype(np.uint8) * 255


def _middle(shades: np.ndarray) -> float:
    """The shade halfway between the dark and the light ones of `shades` (uint8, 2-D)."""
    threshold, is_light = cv2.threshold(shades, 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    # Otsu's threshold itself may lie at the edge of the dark shades.
    dark, light = (shades[is_light == side].mean() if (is_light == side).any() else threshold for side in (0, 1))
    return (dark + light) / 2


def _frames(ink: np.ndarray) -> Iterator[np.ndarray]:
    """The corners of the largest shape if it is a frame, then of the largest one that the picture's edge does not cut.

    The drawing is the first if it fills the picture, the second if the table around the paper is in the picture too.
    """
    inner = ink.copy()
    inner[:_MARGIN] = inner[-_MARGIN:] = inner[:, :_MARGIN] = inner[:, -_MARGIN:] = 255
    cv2.floodFill(inner, None, (0, 0), 0)
    for shapes in (ink, inner):
        shapes = cv2.morphologyEx(shapes, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))  # without specks of noise
        outlines, _ = cv2.findContours(shapes, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        outline = max(outlines, key=cv2.contourArea, default=None)
        if outline is None or cv2.contourArea(outline) < _MIN_FRAME_AREA * ink.size:
            continue
        corners = _fit_corners(outline)
        if (
            corners is not None
            and _MIN_FRAME_FILL <= cv2.contourArea(outline) / max(1.0, cv2.contourArea(corners)) <= 1 / _MIN_FRAME_FILL
        ):
            yield corners


def _fit_corners(outline: np.ndarray) -> np.ndarray | None:
    """`[4, 2]` float32: where the four straight sides fitted to an outline meet; None if it has not four sides."""
    hull = cv2.convexHull(outline)
    length = cv2.arcLength(hull, True)
    polygons = (cv2.approxPolyDP(hull, share * length, True)[:, 0] for share in np.arange(0.01, 0.1, 0.005))
    rough = next((polygon for polygon in polygons if len(polygon) == 4), None)
    if rough is None:
        return None
    rough = _clockwise_from_top_left(rough.astype(np.float64))
    points = outline[:, 0].astype(np.float64)
    lines = [_fit_side(points, rough[i], rough[(i + 1) % 4]) for i in range(4)]
    corners = np.array([np.cross(lines[i - 1], lines[i]) for i in range(4)])
    if (np.abs(corners[:, 2]) < 1e-9).any():
        return None
    return (corners[:, :2] / corners[:, 2:]).astype(np.float32)


def _clockwise_from_top_left(corners: np.ndarray) -> np.ndarray:
    x, y = (corners - corners.mean(axis=0)).T
    corners = corners[np.argsort(np.arctan2(y, x))]  # y is down: growing angles turn clockwise
    sides = np.roll(corners, -1, axis=0) - corners
    rightwards = sides[:, 0] - np.roll(sides[:, 0], 2)
    return np.roll(corners, -int(np.argmax(rightwards)), axis=0)


def _fit_side(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """`[3]` float: the line (homogeneous) through the `points` of an outline near the side from `start` to `end`."""
    along = (end - start) / max(1e-9, np.hypot(*(end - start)))
    share = (points - start) @ along / max(1e-9, np.hypot(*(end - start)))
    away = np.abs((points - start) @ np.array([-along[1], along[0]]))
    near = points[(share > 0.05) & (share < 0.95) & (away < 0.03 * np.hypot(*(end - start)))]
    if len(near) < 2:
        return np.cross([*start, 1.0], [*end, 1.0])
    along_x, along_y, x, y = (
        cv2.fitLine(near.astype(np.float32), cv2.DIST_HUBER, 0, 0.01, 0.01).ravel().astype(np.float64)
    )
    return np.cross([x, y, 1.0], [x + along_x, y + along_y, 1.0])


def _deskew(paper: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """`[_SQUARE_SIDE, _SQUARE_SIDE]` uint8: the inside of the frame as seen from straight above."""
    # Corners are given at pixel centres.
    target = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float32) * _SQUARE_SIDE - 0.5
    transform = cv2.getPerspectiveTransform(corners, target)
    return cv2.warpPerspective(paper, transform, (_SQUARE_SIDE, _SQUARE_SIDE), borderValue=255)


def _read_plan(square: np.ndarray, size: int | None, name: str) -> Maze:
    """The maze in a deskewed drawing."""
    fits = _grid_fits(_ink(square))
    if size is None:
        is_peak = (fits[1:-1] >= fits[:-2]) & (fits[1:-1] >= fits[2:]) & (fits[1:-1] >= _NEARLY_BEST * fits.max())
        size = int(np.flatnonzero(is_peak)[0]) + 1 if is_peak.any() else MIN_SIZE
    if fits[size] < _MIN_FIT:
        raise MazeError(f"{name}: expected walls on a grid of {size} x {size} cells, found edges off it")
    return Maze(_snap(square, size, name), name)


def _grid_fits(ink: np.ndarray) -> np.ndarray:
    """`[MAX_SIZE + 2]` float: for each N, how well the edges of the ink lie on its grid, at best 1; -1 below MIN_SIZE.

    It is the mean of `cos(2 pi N x)` over the edges' positions `x` in parts of the frame's side. Multiples of the true N
    fit as well, but for what inexact edges cost them: among nearly equal N the least is the true one.
    """
    ink = ink.astype(np.int16)
    edges = np.abs(np.diff(ink, axis=0)).sum(axis=1) + np.abs(np.diff(ink, axis=1)).sum(axis=0)
    positions = np.arange(1, len(ink)) / len(ink)
    edges[np.minimum(positions, 1 - positions) < 0.5 / MAX_SIZE] = 0  # the frame's own outside
    sizes = np.arange(MIN_SIZE, MAX_SIZE + 2)
    fits = np.cos(2 * np.pi * np.outer(sizes, positions)) @ edges / max(1, edges.sum())
    return np.concatenate([np.full(MIN_SIZE, -1.0), fits])


def _snap(square: np.ndarray, size: int, name: str) -> np.ndarray:
    """`[size, size]` bool: the cells whose core (the inner quarter) is dark; the outermost ring is the frame."""
    sums = cv2.integral(square)
    starts = np.round((np.arange(size) + 0.5 - _CORE / 2) * _SQUARE_SIDE / size).astype(np.int64)
    ends = np.round((np.arange(size) + 0.5 + _CORE / 2) * _SQUARE_SIDE / size).astype(np.int64)
    totals = sums[ends][:, ends] - sums[starts][:, ends] - sums[ends][:, starts] + sums[starts][:, starts]
    cores = totals / np.outer(ends - starts, ends - starts)
    walls = cores < _middle(np.round(cores).astype(np.uint8))
    walls[[0, -1], :] = walls[:, [0, -1]] = True
    if walls.all():
        raise MazeError(f"{name}: expected a free cell, found only walls")
    dark, light = np.median(cores[walls]), np.median(cores[~walls])
    if light - dark < _MIN_CONTRAST:
        raise MazeError(f"{name}: expected dark walls on light paper, found shades {dark:.0f} and {light:.0f} of 255")
    unclear = np.abs(cores - (dark + light) / 2) / (light - dark)
    unclear[[0, -1], :] = unclear[:, [0, -1]] = 1
    row, column = np.unravel_index(np.argmin(unclear), unclear.shape)
    if unclear[row, column] < _UNCLEAR_BAND:
        raise MazeError(
            f"{name}: expected cells that are wall or floor on a grid of {size}, found ({row}, {column}) between the two"
        )
    return walls
