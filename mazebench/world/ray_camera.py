"""Pictures of mazes through the eyes of bodies, without a graphics driver: a ray for each column of a picture.

All walls have one height, above the camera, so behind the first wall that a column's ray meets nothing is seen. From
top to bottom, a column is sky, wall and floor, and the disc that marks the goal.

`B` is the number of pictures, `H` the pixels on a side.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from mazebench.kernels import compiled, num_threads
from mazebench.maps import colors
from mazebench.maps.drawn import MazeRows
from mazebench.maps.maze import WALL_HEIGHT
from mazebench.maps.moving_doors import StandingMazes
from mazebench.world import looks
from mazebench.world.looks import MAX_DEPTH, NUM_NOISE, TEXELS, Camera, Look

_WIDEST_PINHOLE = 120.0  # degrees
_FEWEST_PER_THREAD = 8  # pictures
_SKY, _FLOOR, _WALL, _GOAL = range(len(looks.LABELS))
_DISC_RADIUS, _DISC_HEIGHT, _DISC_OPACITY = 0.3, 0.04, 0.91  # cells, m; MuJoCo blends its opacity of .7 twice
_DISC_TOP, _DISC_RIM = 0.59, 0.2  # light on it besides that everywhere
_DISC_COLOR = np.array(colors.to_bytes(colors.GOAL), dtype=np.float32)
_NEAREST = 0.01  # m
_SIGN_WIDTH, _SIGN_BOTTOM, _SIGN_HEIGHT = 0.5, 0.3, 0.5  # cells, m, m
_ROW_OF_NOISE = 7919  # places from one row of a picture to the next

kernel = functools.partial(compiled, fused=True, nogil=True)
inlined = functools.partial(compiled, fused=True, inline=True)


class Lens(NamedTuple):
    """The rays of a camera's columns and rows. Depths are along the view's axis, of a wide camera along a column's."""

    ahead: np.ndarray  # [H] of a column's direction, the part along the body's heading
    right: np.ndarray  # [H] and the part to its right
    slope: float  # m that the first row's ray rises on 1 m of depth
    pixel: float  # and how much less each next row's rises
    floor_depth: np.ndarray  # [H] float32, m, where a row meets the floor
    floor_side: np.ndarray  # [H] int, texels on a side of a pattern that is as coarse as the row sees the floor
    sky: np.ndarray  # [H, H] float32, 0 at the horizon to 255 above


def lens_of(camera: Camera, cell_size: float) -> Lens:
    """Returns the rays of a camera in mazes with cells of a size in m."""
    places = 1 - (2 * np.arange(camera.size) + 1) / camera.size  # from 1 to -1: left to right, top to bottom
    is_pinhole = camera.fov <= _WIDEST_PINHOLE
    tangent = math.tan(math.radians(camera.fov if is_pinhole else Camera().fov) / 2)
    angles = math.radians(camera.fov) / 2 * places
    ahead, right = (np.ones(camera.size), -tangent * places) if is_pinhole else (np.cos(angles), -np.sin(angles))
    slopes = math.tan(math.radians(camera.pitch)) + tangent * places
    pixel = 2 * tangent / camera.size

    # The floor that a row sees grows with the square of its distance.
    with np.errstate(divide="ignore"):
        floor_depth = -camera.height / slopes
    texels = np.clip(floor_depth**2 / camera.height * pixel / cell_size * TEXELS, 1, TEXELS)
    floor_side = TEXELS >> np.log2(texels).round().astype(np.int64)

    # MuJoCo's gradient of the sky: a sigmoid of the elevation.
    elevation = np.arctan2(slopes[:, None], np.hypot(ahead, right)) * 2 / np.pi
    sky = np.clip(127.5 * (1 + elevation / np.sqrt((1 + elevation**2) / 2)), 0, 255)
    return Lens(ahead, right, slopes[0], pixel, floor_depth.astype(np.float32), floor_side, sky.astype(np.float32))


@inlined
def _row(rise, depth, lens):  # type: ignore[no-untyped-def]
    """Returns the first row whose ray is not above what is `rise` (m) above the camera at a depth."""
    row = math.ceil(min(max((lens.slope - rise / depth) / lens.pixel, 0.0), float(len(lens.sky))))
    return int(row)


@inlined
def _mix(picture, i, j, tones, texel, lit):  # type: ignore[no-untyped-def]
    """Colours a pixel where the mask of a pattern is `texel`."""
    for k in range(3):
        picture[i, j, k] = np.uint8(min((tones[0, k] + tones[1, k] * texel) * lit + np.float32(0.5), np.float32(255)))


@inlined
def _paint(picture, j, begin, end, pattern, side, across, up, fall, tones, lit):  # type: ignore[no-untyped-def]
    """Paints rows of a column with a pattern at `side` texels, from `up` downwards (in repeats, as `across`)."""
    first = (4 * TEXELS * TEXELS - 4 * side * side) // 3 + (int(across * side) & (side - 1))
    height, step = np.float32(up * side), np.float32(fall * side)
    for i in range(begin, end):
        _mix(picture, i, j, tones, np.float32(pattern[first + (int(height) & (side - 1)) * side]), lit)
        height -= step


@inlined
def _add_noise(picture, place, noise):  # type: ignore[no-untyped-def]
    """Adds noise from a place in the table to a picture; each row begins at a place of its own."""
    for i in range(len(picture)):
        line, first = picture[i].reshape(-1), (place + _ROW_OF_NOISE * i) % NUM_NOISE
        levels = noise[first : first + len(line)]
        for k in range(len(line)):  # in 16 bits, so that a vector of the processor holds many
            level = np.int16(np.int16(line[k]) + np.int16(levels[k]))
            line[k] = np.uint8(min(max(level, np.int16(0)), np.int16(255)))


@kernel
def _draw(begin, end, camera, lens, look, cell, slots, pose, marker, masks, disc, gain, noise_at, noise, pictures):  # type: ignore[no-untyped-def]
    """Draws the pictures from `begin` to `end`; those of length 0 are not drawn."""
    rgb, depth, labels = pictures
    size, one = camera.size, np.float32(1)
    dim = np.empty(size, np.float32)  # light on the floor, by rows
    for b in range(begin, end):
        slot = slots[b]
        grid, tones, light, fading = look.grid[slot], look.colors[slot], look.light[slot], look.fading[slot]
        x_ahead, y_ahead = math.cos(pose[b, 2]), math.sin(pose[b, 2])
        x, y = pose[b, 0] + camera.offset * x_ahead, pose[b, 1] + camera.offset * y_ahead
        floor = masks[look.patterns[slot, looks.FLOOR]]
        for i in range(size):
            dim[i] = gain[b] / (one + fading * lens.floor_depth[i] * lens.floor_depth[i])

        # A body that was never placed and stands outside the free cells does no harm.
        column = min(max(math.floor(x / cell), 1), len(grid) - 2)
        row = min(max(math.floor(y / cell), 1), len(grid) - 2)
        for j in range(size):
            # Go through the cells to the first wall (Amanatides and Woo, 1987).
            x_go = lens.ahead[j] * x_ahead + lens.right[j] * y_ahead
            y_go = lens.ahead[j] * y_ahead - lens.right[j] * x_ahead
            x_step, y_step = (1 if x_go > 0 else -1), (1 if y_go > 0 else -1)
            x_space, y_space = cell / max(abs(x_go), 1e-300), cell / max(abs(y_go), 1e-300)
            x_next = (column + 1 - x / cell if x_go > 0 else x / cell - column) * x_space
            y_next = (row + 1 - y / cell if y_go > 0 else y / cell - row) * y_space
            at_x, at_y, code, surface, is_x, far = column, row, max(grid[row, column], 0), 0, False, 0.0
            while code >= 0:
                surface, is_x = code, x_next < y_next
                if is_x:
                    far, at_x = x_next, at_x + x_step
                    x_next += x_space
                else:
                    far, at_y = y_next, at_y + y_step
                    y_next += y_space
                code = grid[at_y, at_x]
            far = max(far, 1e-6)
            top, bottom = _row(WALL_HEIGHT - camera.height, far, lens), _row(-camera.height, far, lens)

            # The rows of the goal's disc: its upper side from its far edge to its near one, and its rim.
            x_disc, y_disc, radius = marker[b, 0] - x, marker[b, 1] - y, _DISC_RADIUS * cell
            squared, along = x_go * x_go + y_go * y_go, x_go * x_disc + y_go * y_disc
            root = math.sqrt(max(along * along - squared * (x_disc * x_disc + y_disc * y_disc - radius * radius), 0.0))
            near, beyond = max((along - root) / squared, _NEAREST), min((along + root) / squared, far)
            disc_top = disc_rim = disc_end = size
            if root > 0 and near < beyond:
                disc_top = _row(_DISC_HEIGHT - camera.height, beyond, lens)
                disc_rim, disc_end = _row(_DISC_HEIGHT - camera.height, near, lens), _row(-camera.height, near, lens)

            if len(labels):
                labels[b, :top, j], labels[b, top:bottom, j], labels[b, bottom:, j] = _SKY, _WALL, _FLOOR
                labels[b, disc_top:disc_end, j] = _GOAL
            if len(depth):
                depth[b, :top, j], depth[b, top:bottom, j] = MAX_DEPTH, min(far, MAX_DEPTH)
                for i in range(bottom, size):
                    depth[b, i, j] = min(lens.floor_depth[i], MAX_DEPTH)
                for i in range(disc_top, disc_rim):
                    depth[b, i, j] = min((_DISC_HEIGHT - camera.height) / (lens.slope - i * lens.pixel), MAX_DEPTH)
                depth[b, disc_rim:disc_end, j] = min(near, MAX_DEPTH)
            if not len(rgb):
                continue
            picture = rgb[b]
            for i in range(top):
                _mix(picture, i, j, tones[looks.SKY], lens.sky[i, j], gain[b])

            # The wall, with a pattern as coarse as a pixel sees it, and its sign.
            face = (0 if x_go > 0 else 1) if is_x else (2 if y_go > 0 else 3)
            facing = max((x_ahead, -x_ahead, y_ahead, -y_ahead)[face], 0.0)
            lit = (light[0] + light[1] * np.float32(facing) + light[2 + face]) * gain[b]
            lit /= one + fading * np.float32(far * far)
            place = y + far * y_go if is_x else x + far * x_go
            fall, slant = lens.pixel * far, max((x_space if is_x else y_space) / cell, 1.0)
            level = int(math.log2(min(max(fall * slant * TEXELS, 1.0), float(TEXELS))) + 0.5)
            up = camera.height + (lens.slope - top * lens.pixel) * far
            mask = masks[look.patterns[slot, surface]]
            _paint(picture, j, top, bottom, mask, TEXELS >> level, place, up, fall, tones[surface], lit)
            across = (place / cell - math.floor(place / cell) - 0.5) / _SIGN_WIDTH + 0.5
            if code < -1 and 0 <= across < 1:
                begin_sign = _row(_SIGN_BOTTOM + _SIGN_HEIGHT - camera.height, far, lens)
                end_sign = _row(_SIGN_BOTTOM - camera.height, far, lens)
                up = (camera.height - _SIGN_BOTTOM + (lens.slope - begin_sign * lens.pixel) * far) / _SIGN_HEIGHT
                side, fall = TEXELS >> min(level + 1, 6), fall / _SIGN_HEIGHT
                _paint(picture, j, begin_sign, end_sign, masks[-code], side, across, up, fall, tones[looks.SIGN], lit)

            x_floor, y_floor = np.float32(x / cell), np.float32(y / cell)
            x_grow, y_grow = np.float32(x_go / cell), np.float32(y_go / cell)
            for i in range(bottom, size):
                side = lens.floor_side[i]
                x_texel = int((x_floor + lens.floor_depth[i] * x_grow) * side) & (side - 1)
                y_texel = int((y_floor + lens.floor_depth[i] * y_grow) * side) & (side - 1)
                texel = floor[(4 * TEXELS * TEXELS - 4 * side * side) // 3 + y_texel * side + x_texel]
                _mix(picture, i, j, tones[looks.FLOOR], np.float32(texel), dim[i])

            # The disc lets some of what is behind it through.
            for i in range(disc_top, disc_end):
                shine = (light[0] + np.float32(_DISC_TOP if i < disc_rim else _DISC_RIM)) * gain[b]
                for k in range(3):
                    tone = min(disc[k] * shine, np.float32(255))
                    picture[i, j, k] = np.uint8(_DISC_OPACITY * tone + (1 - _DISC_OPACITY) * picture[i, j, k])

        if len(rgb) and noise_at[b] >= 0:
            _add_noise(rgb[b], noise_at[b], noise)


@functools.cache
def _noise() -> np.ndarray:
    """Returns normal noise, int8 levels, for rows that begin at any of the first `NUM_NOISE` places."""
    values = np.random.default_rng(0).normal(0, looks.NOISE, NUM_NOISE).round().clip(-20, 20).astype(np.int8)
    return np.concatenate([values, values])


class RayCamera:
    """The camera of bodies in some mazes of one size."""

    def __init__(self, mazes: StandingMazes, camera: Camera, look: str = looks.PLAIN, split: str = "train"):
        """Takes pictures of a look, as `looks.look_of`."""
        self._camera, self._cell_size = camera, mazes[0].cell_size
        self._lens = lens_of(camera, self._cell_size)
        self._looks = MazeRows(lambda maze: looks.look_of(mazes[maze], look, split))
        self.masks = looks.patterns()  # for a learner that draws others
        self._threads: ThreadPoolExecutor | None = None  # which end with it

    def take(
        self,
        names: Collection[str],
        maze: np.ndarray,
        pose: np.ndarray,
        marker: np.ndarray,
        gain: np.ndarray,
        noise_at: np.ndarray,
        threads: int = 1,
    ) -> dict[str, np.ndarray]:
        """Returns pictures by name, as `looks.PICTURES` describes them: `[B, H, H, ...]`.

        Args:
          names: of `looks.PICTURES`.
          maze: `[B]` int, the index of each body's maze.
          pose: `[B, 3]` float64, x, y (m) and yaw (rad).
          marker: `[B, 3]` float64, m, where the goal's disc lies.
          gain: `[B]` float32, by which colours are multiplied.
          noise_at: `[B]` int below `looks.NUM_NOISE`, the place of a picture's noise; -1 for none.
          threads: that draw; 0 for all cores.
        """
        count, slots = len(pose), self._looks.places(maze)
        pictures: tuple[np.ndarray, ...] = tuple(
            np.empty((count * (name in names), self._camera.size, self._camera.size, *shape), kind)
            for name, (shape, kind, _) in looks.PICTURES.items()
        )
        scene = (self._camera, self._lens, Look(*self._looks.arrays), self._cell_size, slots, pose, marker)

        def draw(begin: int, end: int) -> None:
            _draw(begin, end, *scene, self.masks, _DISC_COLOR, gain, noise_at, _noise(), pictures)

        parts = min(threads or num_threads(), count // _FEWEST_PER_THREAD)
        if parts > 1:
            self._threads = self._threads or ThreadPoolExecutor(parts)
            ends = [count * part // parts for part in range(parts + 1)]
            list(self._threads.map(draw, ends[:-1], ends[1:]))
        else:
            draw(0, count)
        return {name: values for name, values in zip(looks.PICTURES, pictures, strict=True) if name in names}
