"""The look of a maze in an agent's pictures, and its camera: patterns, colours and light, for a kernel that draws them.

A pattern is a mask between two colours. In the look `plain`, all mazes have MuJoCo's colours and flat light. In
`varied`, a hash of the walls draws patterns, colours and light, so equal mazes look equal, and in a maze that was never
seen a pattern says nothing about the place on the map. Train, dev and eval mazes have patterns of their own.
"""

from __future__ import annotations

import colorsys
import functools
import hashlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mazebench.maps.benchmark import DEV
from mazebench.maps.maze import Maze

# It increases when pictures in `varied` change. Since version 2, eval mazes have patterns and exposures of their own.
LOOKS_VERSION = 2

PLAIN, VARIED = LOOKS = ("plain", "varied")

# The colours of `plain` and of MuJoCo's models, red, green and blue in [0, 1], and their light.
WALL_COLOR = (0.36, 0.47, 0.60)
FLOOR_COLOR, LINE_COLOR = (0.86, 0.84, 0.80), (0.70, 0.68, 0.64)
SKY_COLOR, HORIZON_COLOR = (0.62, 0.76, 0.90), (0.93, 0.96, 0.98)
AMBIENT, HEADLIGHT, SUN = 0.35, 0.25, 0.55
SUN_DIRECTION = (0.3, 0.4, -1.0)

# The darkest and the brightest of pictures in `varied`, by split.
EXPOSURES = {"train": (0.3, 2.2), DEV: (0.3, 2.2), "eval": (0.25, 2.6)}
NOISE = 4.0  # levels, the standard deviation of the noise of a pixel in `varied`
NUM_NOISE = 2**18  # places in a table at which the noise of a picture may begin

MAX_DEPTH = 10.0  # m; what is farther, and the sky, read it
LABELS = ("sky", "floor", "wall", "goal")
# The kinds of pictures: the shape and the type of a pixel, and its largest value.
PICTURES: dict[str, tuple[tuple[int, ...], type, float]] = {
    "egocentric": ((3,), np.uint8, 255),  # red, green, blue
    "depth": ((), np.float32, MAX_DEPTH),  # m along the view's axis, of a wide camera along a column's
    "labels": ((), np.uint8, len(LABELS) - 1),  # indices of `LABELS`
}

TEXELS = 64  # a side of a pattern, which spans a metre of a wall, or a cell of the floor
NUM_SURFACES = 4  # patterns on the walls of a maze
FLOOR, SKY, SIGN = range(NUM_SURFACES, NUM_SURFACES + 3)  # after the surfaces, among the colours of a look
_CELLS_PER_REGION = 4  # a side
_SIGN_SHARE = 0.15  # of the wall cells

_NUM_SIGNS = 32
# Where the patterns are among `patterns()`, by split.
_PLAIN_WALL, _PLAIN_FLOOR = 0, 1
WALLS = {"train": range(2, 10), DEV: range(10, 14), "eval": range(51, 55)}
FLOORS = {"train": range(14, 17), DEV: range(17, 19), "eval": range(55, 57)}
_SIGNS = range(19, 19 + _NUM_SIGNS)


class Camera(NamedTuple):
    """The agent's camera, whose pictures are square. Up to 120 degrees it is a pinhole, beyond that its columns are at
    equal angles and see 75 degrees from top to bottom."""

    size: int = 64  # pixels on a side
    fov: float = 75.0  # degrees, from the left to the right
    height: float = 0.45  # m, below the top of the walls
    offset: float = 0.12  # m, ahead of the body's centre
    pitch: float = 0.0  # degrees, up; walls stay upright, as by a lens that is shifted


class Look(NamedTuple):
    """The look of one maze, or of several, along a first axis."""

    # [N, N] int8, rows from the bottom. Of a free cell: the surface of the walls that are seen from it. Of a wall: -1,
    # or minus the number of its sign's pattern.
    grid: np.ndarray
    patterns: np.ndarray  # [NUM_SURFACES + 1] int64, of the surfaces and the floor
    # [NUM_SURFACES + 3, 2, 3] float32, of the surfaces, floor, sky and signs: the colour where the mask is 0, and what
    # is added for each of its 255 steps; 0 to 255.
    colors: np.ndarray
    # [6] float32, factors: everywhere, on what faces the camera, from the sun on faces towards -x, +x, -y and +y.
    light: np.ndarray
    fading: np.ndarray  # [] float32, 1/m^2: light at depth d is divided by 1 + fading d^2


def look_of(maze: Maze, look: str, split: str) -> Look:
    """Returns a look, "plain" or "varied", of a maze, with the patterns of a split, one of `WALLS`."""
    if look == PLAIN:
        return _plain_look(maze)
    rng = rng_of(maze)

    surfaces = regions_of(maze, NUM_SURFACES, rng)
    signs = np.where(rng.random(maze.walls.shape) < _SIGN_SHARE, -rng.choice(_SIGNS, maze.walls.shape), -1)

    # Two colours for each of them, of any hue but the goal's.
    def color(saturation: float, darkest: float, brightest: float) -> tuple[float, float, float]:
        return colorsys.hsv_to_rgb(rng.uniform(0.07, 0.93), rng.uniform(0, saturation), rng.uniform(darkest, brightest))

    pairs = [(color(0.7, 0.1, 0.45), color(0.6, 0.55, 1.0)) for _ in range(NUM_SURFACES)]
    pairs += [
        (color(0.3, 0.25, 0.5), color(0.3, 0.55, 0.9)),  # floor
        (color(0.6, 0.2, 1.0), color(0.6, 0.2, 1.0)),  # horizon and sky
        (color(0.9, 0.1, 0.4), color(0.25, 0.9, 1.0)),  # signs
    ]

    angle, sun = rng.uniform(0, 2 * np.pi), rng.uniform(0.2, 0.6)
    return Look(
        grid=np.where(maze.walls, signs, surfaces)[::-1].astype(np.int8),
        patterns=np.array([*rng.choice(WALLS[split], NUM_SURFACES), rng.choice(FLOORS[split])]),
        colors=_steps(pairs),
        light=_light(rng.uniform(0.4, 0.75), rng.uniform(0.1, 0.35), sun * np.cos(angle), sun * np.sin(angle)),
        fading=np.array(rng.uniform(0, 0.03), dtype=np.float32),
    )


def exposures_of(rng: np.random.Generator, count: int, split: str = "train") -> tuple[np.ndarray, np.ndarray]:
    """Returns the exposures of `count` pictures in `varied`, `[B]` float32, and where their noise begins, `[B]` int."""
    darkest, brightest = np.log(EXPOSURES[split])
    return np.exp(rng.uniform(darkest, brightest, count)).astype(np.float32), rng.integers(NUM_NOISE, size=count)


def rng_of(maze: Maze) -> np.random.Generator:
    """Returns a generator of what is drawn from a hash of the walls, before any door moved."""
    return np.random.default_rng(list(hashlib.sha256(np.packbits(maze.as_built.walls).tobytes()).digest()))


def regions_of(maze: Maze, count: int, rng: np.random.Generator) -> np.ndarray:
    """Returns a number below `count` for each cell, `[N, N]` int, the same in a square region of a few cells."""
    regions = rng.integers(count, size=(maze.size // _CELLS_PER_REGION + 1,) * 2)
    return np.kron(regions, np.ones((_CELLS_PER_REGION,) * 2, dtype=int))[: maze.size, : maze.size]


def _plain_look(maze: Maze) -> Look:
    towards_sun = -np.array(SUN_DIRECTION) / np.linalg.norm(SUN_DIRECTION)
    on_floor = AMBIENT + SUN * towards_sun[2]
    floor = on_floor * np.array([FLOOR_COLOR, LINE_COLOR])
    pairs = [(WALL_COLOR, WALL_COLOR)] * NUM_SURFACES + [floor, (HORIZON_COLOR, SKY_COLOR), (WALL_COLOR, WALL_COLOR)]
    return Look(
        grid=np.where(maze.walls, -1, 0)[::-1].astype(np.int8),
        patterns=np.array([_PLAIN_WALL] * NUM_SURFACES + [_PLAIN_FLOOR]),
        colors=_steps(pairs),
        light=_light(AMBIENT, HEADLIGHT, *SUN * towards_sun[:2]),
        fading=np.zeros((), dtype=np.float32),
    )


def _steps(pairs: Sequence[ArrayLike]) -> np.ndarray:
    """Returns `Look.colors` of pairs of colours where a mask is 0 and where it is 255, in [0, 1]."""
    low, high = 255 * np.array(pairs, dtype=np.float32).swapaxes(0, 1)
    return np.stack([low, (high - low) / 255], axis=1)


def _light(ambient: float, headlight: float, sun_x: float, sun_y: float) -> np.ndarray:
    return np.array([ambient, headlight, *np.maximum([-sun_x, sun_x, -sun_y, sun_y], 0)], dtype=np.float32)


@functools.cache
def patterns() -> np.ndarray:
    """Returns the masks of all patterns: `[25 + signs, T]` uint8, each at 64, 32, ... 1 texels a side, flattened.

    Rows are from the bottom to the top of a wall.
    """
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:TEXELS, :TEXELS]

    def each(height: int, width: int) -> np.ndarray:  # a value for each rectangle of texels
        return np.kron(rng.random((TEXELS // height, TEXELS // width)), np.ones((height, width)))

    def rough() -> np.ndarray:  # smooth noise of several wavelengths, from 0 to 1
        waves = [rng.random((cells, cells)) / cells for cells in (2, 4, 8, 16, 32)]
        total = sum(scipy.ndimage.zoom(w, TEXELS // len(w), order=1, mode="grid-wrap", grid_mode=True) for w in waves)
        return (total - np.min(total)) / np.ptp(total)

    def distances(count: int) -> np.ndarray:  # to the nearest and the second of some stones
        stones = rng.random((count, 2, 1, 1)) * TEXELS
        away = np.hypot(*(np.stack([x - stones[:, 0], y - stones[:, 1]]) + TEXELS // 2) % TEXELS - TEXELS // 2)
        return np.sort(away, axis=0)[:2]

    shifted = (x + 16 * (y // 8 % 2)) % 32  # every second row of bricks
    nearest, second = distances(24)
    frame = np.maximum(np.abs(x - 32), np.abs(y - 32))
    walls = [
        np.where((y % 8 == 0) | (shifted == 0), 0, 0.55 + 0.35 * each(8, 16)) * (0.8 + 0.2 * rough()),  # bricks
        np.where((y % 16 == 0) | (x % 16 == 0), 0.05, 0.8 + 0.2 * each(16, 16)),  # tiles
        np.where(x % 8 == 0, 0, 0.45 + 0.5 * each(64, 8)) * (0.75 + 0.25 * rough()),  # planks
        0.5 + 0.5 * rough(),  # plaster
        np.where(y > 24, 0.75 + 0.25 * rough(), 0.15 + 0.1 * rough()),  # wainscot
        0.85 * ((x // 16 + y // 16) % 2) + 0.1 * rough(),  # checks
        np.where(second - nearest < 2.5, 0, 0.45 + 0.5 * rough()),  # rubble
        np.where(frame > 28, 0.25, 0.75) + 0.2 * rough() - 0.2 * (frame == 27),  # panels
        # Those of dev mazes.
        0.9 * ((x + y) // 8 % 2),  # slanted bands
        0.7 * (y // 8 % 2) + 0.2 * rough(),  # level bands
        0.9 * (np.hypot(x % 16 - 8, y % 16 - 8) < 4.5) + 0.1 * rough(),  # dots
        0.5 + 0.5 * np.sin(x * np.pi / 8) * (0.7 + 0.3 * rough()),  # corrugated
    ]
    floors = [
        np.where((x == 0) | (y == 0), 0, 0.8 + 0.2 * rough()),  # cells
        np.where((x % 32 == 0) | (y % 32 == 0), 0.1, 0.6 + 0.3 * rough()),  # tiles
        0.7 * ((x // 32 + y // 32) % 2) + 0.2 * rough(),  # checks
        # Those of dev mazes.
        np.where(y % 8 == 0, 0, 0.5 + 0.4 * each(8, 64)) * (0.8 + 0.2 * rough()),  # boards
        0.3 + 0.7 * rough(),  # carpet
    ]
    # A sign is a symmetrical drawing of 5 x 5 squares in a frame.
    halves = rng.random((_NUM_SIGNS, 5, 3)) < 0.5
    drawings = np.pad(np.concatenate([halves, halves[..., 1::-1]], axis=2), ((0, 0), (1, 1), (1, 1)))
    signs = [np.pad(np.kron(drawing, np.ones((9, 9)))[:62, :62], 1, constant_values=1) for drawing in drawings]
    plain_lines = 0.5 * ((x % 63 == 0) | (y % 63 == 0))  # half of a texel on each side of a cell's border
    masks = [np.zeros_like(plain_lines), plain_lines, *walls, *floors, *signs]

    # Those of eval mazes, from a generator of their own, so that the others do not depend on them.
    rng = np.random.default_rng(1)
    is_level = (x // 16 + y // 16) % 2 == 0
    masks += [
        0.85 * ((y + abs(x % 32 - 16)) // 8 % 2) + 0.1 * rough(),  # chevrons
        np.where(((x + y) % 16 < 3) | ((x - y) % 16 < 3), 0.05, 0.55 + 0.4 * rough()),  # lattice
        np.hypot((x + 8 * (y // 8 % 2)) % 16 - 8, y % 8) / 12 * (0.8 + 0.2 * rough()),  # scales
        np.where(np.cumsum(rng.random(TEXELS) < 0.2)[x] % 2, 0.1, 0.7 + 0.2 * rough()),  # stripes of several widths
        np.where(np.where(is_level, y, x) % 4 == 0, 0.1, 0.3 + 0.6 * each(16, 16)),  # parquet
        np.where(distances(60)[0] < 3, 0.95, 0.15 + 0.25 * rough()),  # terrazzo
    ]
    return flattened(np.stack(masks).clip(0, 1) * 255)


def flattened(masks: np.ndarray) -> np.ndarray:
    """Returns masks `[P, 64, 64]` from 0 to 255 as `patterns` does, `[P, T]` uint8."""
    levels = [masks]
    while masks.shape[1] > 1:
        masks = (masks[:, ::2, ::2] + masks[:, 1::2, ::2] + masks[:, ::2, 1::2] + masks[:, 1::2, 1::2]) / 4
        levels.append(masks)
    return np.concatenate([level.reshape(len(level), -1) for level in levels], axis=1).round().astype(np.uint8)
