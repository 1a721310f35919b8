"""Pictures of mazes: exact drawings, synthetic scans and files from outside."""

import io
import pathlib
import struct
import tempfile
import warnings
import zlib

import cv2
import hypothesis
import numpy as np
import PIL.Image
import pytest
from hypothesis import strategies as st

from mazebench.errors import InputError
from mazebench.maps.kinds import generate
from mazebench.maps.kinds.kind import largest_area
from mazebench.maps.maze import Maze, MazeError
from mazebench.maps.maze_files import read_maze
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.pictures import draw_grid, draw_maze
from mazebench.maps.readers.image import grid_of_image
from mazebench.maps.readers.occupancy_grid import locate_maze

SEEDS = st.integers(0, 2**32 - 1)
FEW = hypothesis.settings(max_examples=100, deadline=None)


def maze_from_image(image: np.ndarray, size: int | None = None, name: str = "maze") -> Maze:
    return locate_maze(grid_of_image(image, size, name), ReadOptions(), name).maze


def blocks(walls: np.ndarray, cell_pixels: int) -> np.ndarray:
    """A black and white gray picture of `walls`."""
    return np.where(walls, 0, 255).astype(np.uint8).repeat(cell_pixels, axis=0).repeat(cell_pixels, axis=1)


def encode(image: np.ndarray, extension: str = ".png") -> bytes:
    return cv2.imencode(extension, image)[1].tobytes()


def read_bytes(content: bytes, size: int | None = None) -> Maze:
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "plan.png"
        path.write_bytes(content)
        return read_maze(path, size)


@pytest.fixture(scope="module")
def maze() -> Maze:
    return generate("dfs", 13, np.random.default_rng(0))


def test_drawing_has_a_dark_block_for_each_wall_when_plain(maze):
    image = draw_maze(maze, cell_pixels=4)
    assert image.shape == (52, 52, 3)
    assert image.dtype == np.uint8
    cells = image.reshape(13, 4, 13, 4, 3).transpose(0, 2, 1, 3, 4).reshape(13, 13, -1)
    assert (cells[maze.walls] < 48).all()
    assert (cells[~maze.walls] == 255).all()


@hypothesis.given(SEEDS, st.integers(5, 40), st.integers(1, 20))
@FEW
def test_drawing_is_read_back_for_any_maze_and_scale(seed, size, cell_pixels):
    drawn = generate("obstacles", size, np.random.default_rng(seed))
    image = draw_maze(drawn, cell_pixels)
    assert maze_from_image(image) == drawn
    assert maze_from_image(image, size) == drawn


def test_drawing_marks_start_goal_and_path_when_given(maze):
    path = np.array([[1.5, 11.5], [1.5, 10.5], [11.5, 10.5], [11.5, 1.5]])
    image = draw_grid(maze.walls, 16, start=(1, 1), goal=(11, 11), path=path).astype(int)
    red, green, blue = image[1 * 16 + 8, 1 * 16 + 8]
    assert green > max(red, blue)
    red, green, blue = image[11 * 16 + 8, 11 * 16 + 8]
    assert red > max(green, blue)
    red, green, blue = image[2 * 16, 1 * 16 + 8]  # half a metre from the path's start
    assert blue > max(red, green)
    red, green, blue = image[10 * 16, 11 * 16 + 8]  # a metre and a half from its end
    assert red > green > blue
    assert (image[5, 5] == draw_maze(maze, 16)[5, 5]).all()


@pytest.mark.parametrize("extension", [".png", ".bmp", ".jpg", ".pgm", ".ppm", ".tif", ".webp"])
@pytest.mark.parametrize("cell_pixels", [8, 16])
def test_map_is_read_from_each_format(maze, tmp_path, extension, cell_pixels):
    path = tmp_path / f"plan{extension}"
    drawing = draw_maze(maze, cell_pixels)
    path.write_bytes(encode(drawing[..., 0] if extension == ".pgm" else drawing, extension))
    assert read_maze(path) == maze
    assert read_maze(path).name == "plan"


def test_map_is_read_when_pixels_are_gray_deep_or_transparent(maze):
    gray = blocks(maze.walls, 3)
    deep = gray.astype(np.uint16) * 257
    transparent = np.zeros((*gray.shape, 4), dtype=np.uint8)  # black everywhere, the floor seen through
    transparent[..., 3] = 255 - gray
    for image in (gray, deep, np.dstack([deep] * 3), transparent, transparent.astype(np.uint16) * 257):
        assert maze_from_image(image) == maze
        assert read_bytes(encode(image)) == maze


@pytest.mark.parametrize(
    ("format", "mode"),
    [("PNG", "RGBA"), ("PNG", "LA"), ("WEBP", "RGBA"), ("TIFF", "RGBA"), ("TIFF", "LA"), ("GIF", "RGBA")],
)
def test_opacity_counts_in_every_format_that_has_it(maze, tmp_path, format, mode):
    transparent = np.zeros((52, 52, 4), dtype=np.uint8)  # black everywhere, the floor seen through
    transparent[..., 3] = 255 - blocks(maze.walls, 4)
    kept = {"lossless": True, "exact": True} if format == "WEBP" else {}
    PIL.Image.fromarray(transparent).convert(mode).save(tmp_path / "plan.png", format, **kept)
    assert read_maze(tmp_path / "plan.png") == maze


def test_a_shade_that_is_transparent_is_floor_at_any_depth(maze):
    for shades, bits in ((blocks(maze.walls, 4) // 5, np.uint8), (np.where(blocks(maze.walls, 4), 77, 0), np.uint16)):
        file = io.BytesIO()
        PIL.Image.fromarray(shades.astype(bits)).save(file, "PNG", transparency=int(shades.max()))
        assert read_bytes(file.getvalue()) == maze


@pytest.mark.parametrize(
    ("name", "format"), [("plan", "PNG"), ("plan.jfif", "JPEG"), ("plan.x", "TIFF"), ("p.txt", "PPM")]
)
def test_a_picture_is_read_whatever_its_suffix(maze, tmp_path, name, format):
    PIL.Image.fromarray(draw_maze(maze, 8)).save(tmp_path / name, format)
    assert read_maze(tmp_path / name) == maze


@pytest.mark.parametrize(
    ("head", "pixels"),
    [
        (b"P5\r\n52 52\r\n255\r\n", lambda gray: gray),
        (b"P5\r\n# drawn\r\n52 52\r\n65535\r\n", lambda gray: gray.astype(">u2") * 257),
        (b"P6\r\n52 52\r\n255\r\n", lambda gray: np.dstack([gray] * 3)),
        (b"P4\r\n52 52\r\n", lambda gray: np.packbits(gray == 0, axis=1)),
    ],
)
def test_line_ends_of_windows_in_a_head_shift_no_pixel(maze, head, pixels):
    data = pixels(blocks(maze.walls, 4)).tobytes()
    assert read_bytes(head + data) == read_bytes(head.replace(b"\r", b"") + data) == maze
    with pytest.raises(MazeError, match="found a picture that is damaged"):
        read_bytes(head + data[:-1])


@pytest.mark.parametrize("format", ["TIFF", "WEBP", "PNG", "GIF"])
def test_the_first_of_several_pages_is_read_and_a_line_says_so(maze, tmp_path, format, remarks):
    first, other = PIL.Image.fromarray(draw_maze(maze, 4)), PIL.Image.fromarray(255 - draw_maze(maze, 4))
    kept = {"lossless": True} if format == "WEBP" else {}
    first.save(tmp_path / "plan.png", format, save_all=True, append_images=[other], **kept)
    assert read_maze(tmp_path / "plan.png") == maze
    assert [line.partition(": ")[2][:19] for line in remarks()] == ["the first of 2 page"]


@pytest.mark.parametrize(
    ("kind", "white"),
    [
        *(("uint16", white) for white in (1, 255, 4095)),
        *(("int32", white) for white in (255, 2**30, -1)),
        *(("float32", white) for white in (1, 65535, np.nan)),
    ],
)
def test_a_deep_picture_whose_white_is_not_certain_is_refused_with_its_shades(maze, tmp_path, kind, white):
    shades = np.where(blocks(maze.walls, 4), white, 0).astype(kind)
    PIL.Image.fromarray(shades).save(tmp_path / "plan.tif")
    found = f"{shades.min():g} to {shades.max():g}".replace("+", ".")
    for options in ({}, {"pixel_size": 0.1}):
        with pytest.raises(MazeError, match=f"found {found} in a picture of 16 or 32 bits; save it with 8 bits"):
            read_maze(tmp_path / "plan.tif", **options)


@pytest.mark.parametrize("shade", [0, 130, 255, (255, 255, 255), (255, 0, 0), (0, 0, 255)])
def test_a_picture_of_one_colour_is_refused_in_a_line_alone(shade):
    image = np.full((64, 64, *np.shape(shade)), shade, dtype=np.uint8)
    with warnings.catch_warnings(action="error"), np.errstate(all="raise"), pytest.raises(MazeError, match=NOT_READ):
        maze_from_image(image, name="m")


def rectangle(rows: int, columns: int, num_bars: int, rng: np.random.Generator) -> np.ndarray:
    """A hall with bars of wall in it: `[rows, columns]` bool."""
    walls = np.ones((rows, columns), dtype=bool)
    walls[1:-1, 1:-1] = False
    for _ in range(num_bars):
        length = int(rng.integers(1, max(rows, columns)))
        row, column = int(rng.integers(1, rows - 1)), int(rng.integers(1, columns - 1))
        if rng.random() < 0.5:
            walls[row, column : column + length] = True
        else:
            walls[row : row + length, column] = True
    walls[1, 1] = False  # so that something is free
    return largest_area(walls)


def padded(walls: np.ndarray) -> Maze:
    """The maze that a rectangular plan becomes, worked in another way than `locate_maze` does."""
    square = np.ones((max(walls.shape),) * 2, dtype=bool)
    square[: walls.shape[0], : walls.shape[1]] = walls
    return Maze(square)


RECTANGLES = (st.integers(5, 28), st.integers(5, 28), st.integers(0, 12), SEEDS)


@hypothesis.given(*RECTANGLES, st.integers(1, 24), st.booleans())
@FEW
def test_rectangular_pixel_map_is_padded_and_never_distorted(rows, columns, num_bars, seed, cell_pixels, has_marks):
    walls = rectangle(rows, columns, num_bars, np.random.default_rng(seed))
    image = np.dstack([blocks(walls, cell_pixels)] * 3)
    if has_marks:
        row, column = np.argwhere(~walls)[0] * cell_pixels
        image[row : row + cell_pixels, column : column + cell_pixels] = (220, 30, 30)
    # All cells may be doubled: then the pixels do not tell how many there are.
    assert maze_from_image(image, max(rows, columns)) == padded(walls)


@pytest.mark.parametrize("shade", [(255, 0, 0), (0, 0, 255), (0, 160, 0), (255, 200, 0)])
def test_cells_in_colour_are_floor(maze, shade):
    image = np.dstack([blocks(maze.walls, 20)] * 3)
    row, column = maze.free_cells[5] * 20
    image[row : row + 20, column : column + 20] = shade
    assert maze_from_image(image) == maze


def test_a_jpeg_is_turned_upright_when_the_camera_was_held_sideways(maze):
    content = encode(np.rot90(draw_maze(maze, 16)), ".jpg")
    # One entry of a little-endian TIFF directory: orientation (0x0112) 6, "turn right to see it upright".
    exif = b"Exif\0\0II*\0" + struct.pack("<IHHHIII", 8, 1, 0x0112, 3, 1, 6, 0)
    assert read_bytes(content[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + content[2:]) == maze


@pytest.mark.parametrize("side", [150, 131, 67])
def test_a_picture_with_soft_edges_is_read_by_its_number_of_cells(maze, side):
    image = cv2.resize(blocks(maze.walls, 17), (side, side), interpolation=cv2.INTER_CUBIC)
    assert maze_from_image(cv2.GaussianBlur(image, (0, 0), 0.8), 13) == maze
    for size in (None, 12, 14):
        with pytest.raises(MazeError, match="expected dark walls on a light ground and each cell as a block"):
            maze_from_image(image, size)


MAZE = generate("dfs", 13, np.random.default_rng(0))
NOT_READ = "m: expected dark walls on a light ground and each cell as a block of pixels"
NOISE = np.random.default_rng(0).integers(0, 256, (120, 90, 3), dtype=np.uint8)


def with_open_border() -> np.ndarray:
    walls = MAZE.walls.copy()
    walls[0, 3] = False
    return blocks(walls, 16)


@pytest.mark.parametrize(
    ("image", "options", "message"),
    [
        (np.zeros((50, 50), np.uint8), {}, NOT_READ),
        (255 - blocks(MAZE.walls, 16), {}, NOT_READ),
        (np.pad(blocks(MAZE.walls, 16), 40, constant_values=255), {}, "a drawn or scanned plan needs --pixel-size"),
        (NOISE, {}, NOT_READ),
        (with_open_border(), {}, r"expected a closed border, found cell \(0, 3\) free"),
        (blocks(MAZE.walls, 1), {"size": 9}, "9 cells on the longer side"),
        *((blocks(MAZE.walls, 8), {"size": size}, f"size of 5 to 255 cells, found {size}") for size in (4, 256)),
    ],
)
def test_a_picture_that_is_not_read_gets_a_line_that_helps(image, options, message):
    with pytest.raises(InputError, match=message):
        maze_from_image(image, name="m", **options)


PICTURE = draw_maze(MAZE)


def of_size(width: int, height: int) -> bytes:
    """The head of a PNG, which says its size."""
    head = b"IHDR" + struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + head + struct.pack(">I", zlib.crc32(head)) + b"\0\0\0\1IDAT"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "a picture, found an empty file$"),
        (b"#####\n", "a picture, found a file of another kind"),
        (b"\x89PNG\r\n\x1a\n", "a picture, found a picture that is damaged$"),
        (b"%PDF-1.7\n", "a picture, found a PDF; export it as PNG"),
        (of_size(30000, 30000), "at most 67108864 pixels, found many more; crop it, or lower"),
        (of_size(10000, 10000), "at most 67108864 pixels, found 10000 x 10000; crop it, or lower"),
        (b"PK\x03\x04\x14\0", "a picture, found a ZIP archive; unpack it$"),
        *(
            (encode(PICTURE, extension)[:500], "a picture, found a picture that is damaged$")
            for extension in (".png", ".bmp", ".jpg")
        ),
    ],
)
def test_a_file_that_is_no_picture_is_named_in_one_line(content, message, capfd):
    with pytest.raises(InputError, match=rf"plan\.png: expected {message}"):
        read_bytes(content)
    assert capfd.readouterr() == ("", "")
