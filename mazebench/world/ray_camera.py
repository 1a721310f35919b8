"""Pictures of mazes through the eyes of bodies, without a graphics driver: a ray for each column of a picture.

All walls have one height, above the camera, so behind the first wall that a column's ray meets nothing is seen. From
top to bottom, a column is sky, wall and floor, and the disc that marks the goal.

`B` is the number of pictures, `H` the pixels on a side, `S` the number of mazes whose looks are kept.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from mazebench.kernels import compiled, num_threads
from mazebench.maps import colors
from mazebench.maps.drawn import Mazes
from mazebench.maps.maze import WALL_HEIGHT
from mazebench.world.looks import (
    FLOOR,
    LABELS,
    MAX_DEPTH,
    NOISE,
    NUM_NOISE,
    NUM_SURFACES,
    PLAIN,
    SIGN,
    SKY,
    TEXELS,
    Camera,
    Look,
    look_of,
    patterns,
)

_SKY_LABEL, _FLOOR_LABEL, _WALL_LABEL, _GOAL_LABEL = range(len(LABELS))
_WIDEST_PINHOLE = 120.0  # degrees
_MOST_KEPT = 512  # looks, unless more mazes are seen at once
_FEWEST_PER_THREAD = 8  # pictures
_DISC_RADIUS, _DISC_HEIGHT, _DISC_OPACITY = 0.3, 0.04, 0.91  # cells, m; MuJoCo blends its opacity of .7 twice
_DISC_COLOR = np.array(colors.to_bytes(colors.GOAL), dtype=np.float32)
_NEAREST = 0.01  # m
_SIGN_WIDTH, _SIGN_BOTTOM, _SIGN_HEIGHT = 0.5, 0.3, 0.5  # cells, m, m

kernel = functools.partial(compiled, fused=True, nogil=True)
inlined = functools.partial(compiled, fused=True, inline=True)


class Lens(NamedTuple):
    """The rays of a camera's columns and rows. Depths are along the view's axis, of a wide camera along a column's."""

    ahead: np.ndarray  # [H] parts of a column's direction: along the body's heading
    right: np.ndarray  # [H] and to its right
    tangent: float  # of half the angle that is seen from top to bottom
    shift: float  # tangent of the pitch
    slope: np.ndarray  # [H] float32, m a row's ray rises on 1 m of depth
    floor_depth: np.ndarray  # [H] float32, m, where a row meets the floor
    floor_side: np.ndarray  # [H] int64, texels on a side of the pattern that is as coarse as the row sees the floor
    sky: np.ndarray  # [H, H] uint8, from the horizon to above
    height: float  # m
    offset: float  # m, ahead of the body's centre


def lens_of(camera: Camera, cell_size: float) -> Lens:
    """Returns the rays of a camera in mazes whose cells have one size, in m."""
    places = 1 - (2 * np.arange(camera.size) + 1) / camera.size  # from 1 to -1: left to right, top to bottom
    if camera.fov <= _WIDEST_PINHOLE:
        tangent = math.tan(math.radians(camera.fov) / 2)
        ahead, right = np.ones(camera.size), -tangent * places
    else:
        tangent = math.tan(math.radians(Camera().fov) / 2)
        angles = math.radians(camera.fov) / 2 * places
        ahead, right = np.cos(angles), -np.sin(angles)
    shift = math.tan(math.radians(camera.pitch))
    slope = shift + tangent * places

    # The floor's part that a row sees grows with the square of its distance.
    with np.errstate(divide="ignore"):
        floor_depth = -camera.height / slope
    texels = np.minimum(floor_depth**2, 1e6) / camera.height * 2 * tangent / camera.size / cell_size * TEXELS
    side = TEXELS >> np.clip(np.log2(np.maximum(texels, 1)).round().astype(np.int64), 0, 6)

    # MuJoCo's gradient: a sigmoid of the elevation.
    elevation = np.arctan2(slope[:, None], np.hypot(ahead, right)) / (np.pi / 2)
    sky = 127.5 * (1 + elevation / np.sqrt(1 + elevation**2) * math.sqrt(2))
    return Lens(
        ahead,
        right,
        tangent,
        shift,
        slope.astype(np.float32),
        floor_depth.astype(np.float32),
        side,
        sky.clip(0, 255).round().astype(np.uint8),
        camera.height,
        camera.offset,
    )


@inlined
def _row(rise, depth, lens):  # type: ignore[no-untyped-def]
    """Returns the first row whose ray is not above what is `rise` (m) above the camera at a depth."""
    size = len(lens.slope)
    row = math.ceil(size / 2 * (1 - (rise / depth - lens.shift) / lens.tangent) - 0.5)
    return int(min(max(row, 0.0), float(size)))


@inlined
def _paint(picture, j, begin, end, pattern, side, across, up, fall, tones, lit):  # type: ignore[no-untyped-def]
    """Paints rows of a column with a pattern at `side` texels, from `up` downwards (in repeats, as `across`)."""
    red, green, blue = np.int32(tones[0, 0] * lit), np.int32(tones[0, 1] * lit), np.int32(tones[0, 2] * lit)
    more_red, more_green, more_blue = (
        np.int32(tones[1, 0] * lit),
        np.int32(tones[1, 1] * lit),
        np.int32(tones[1, 2] * lit),
    )
    first = (4 * TEXELS * TEXELS - 4 * side * side) // 3 + (int(across * side) & (side - 1))
    height, step = np.float32(up * side), np.float32(fall * side)
    for i in range(begin, end):
        texel = pattern[first + (int(height) & (side - 1)) * side]
        height -= step
        picture[i, j, 0] = min((red + texel * more_red + 128) >> 8, 255)
        picture[i, j, 1] = min((green + texel * more_green + 128) >> 8, 255)
        picture[i, j, 2] = min((blue + texel * more_blue + 128) >> 8, 255)


@kernel
def _draw(begin, end, lens, looks, slots, pose, marker, cell, masks, disc, gain, noise_at, noise, rgb, depth, labels):  # type: ignore[no-untyped-def]
    """Draws the pictures from `begin` to `end`; an output of length 0 is not drawn."""
    size = len(lens.slope)
    has_rgb, has_depth, has_labels = len(rgb) > 0, len(depth) > 0, len(labels) > 0
    one, scale = np.float32(1), np.float32(256)  # colours have 8 bits behind the point
    pixel = 2 * lens.tangent / size  # of a depth of 1
    floor, lamps = np.empty((size, 2, 3), np.int32), np.empty(4, np.float32)
    for b in range(begin, end):
        slot = slots[b]
        grid, light, fading = looks.grid[slot], looks.light[slot], looks.fading[slot]
        tones, bright = looks.colors[slot], scale * gain[b]
        x_ahead, y_ahead = math.cos(pose[b, 2]), math.sin(pose[b, 2])
        x, y = pose[b, 0] + lens.offset * x_ahead, pose[b, 1] + lens.offset * y_ahead

        # Light on the faces towards -x, +x, -y and +y, and on the rows of the floor.
        for face, facing in enumerate((x_ahead, -x_ahead, y_ahead, -y_ahead)):
            lamps[face] = light[0] + light[1] * np.float32(max(facing, 0.0)) + light[2 + face]
        if has_rgb:
            floor_mask = masks[looks.patterns[slot, NUM_SURFACES]]
            for i in range(size):
                lit = bright / (one + fading * lens.floor_depth[i] * lens.floor_depth[i])
                for k in range(3):
                    floor[i, 0, k] = np.int32(tones[FLOOR, 0, k] * lit) + 128
                    floor[i, 1, k] = np.int32(tones[FLOOR, 1, k] * lit)

        # A body that was never placed and stands outside does no harm.
        last = len(grid) - 1
        column = min(max(math.floor(x / cell), 0), last)
        row = min(max(math.floor(y / cell), 0), last)
        for j in range(size):
            # Go through the cells to the first wall (Amanatides and Woo, 1987).
            x_go = lens.ahead[j] * x_ahead + lens.right[j] * y_ahead
            y_go = lens.ahead[j] * y_ahead - lens.right[j] * x_ahead
            x_step, y_step = (1 if x_go > 0 else -1), (1 if y_go > 0 else -1)
            x_space, y_space = cell / max(abs(x_go), 1e-300), cell / max(abs(y_go), 1e-300)
            x_next = (column + 1 - x / cell if x_go > 0 else x / cell - column) * x_space
            y_next = (row + 1 - y / cell if y_go > 0 else y / cell - row) * y_space
            at_x, at_y, surface, far, is_x, code = column, row, max(grid[row, column], 0), 0.0, False, -1
            while True:
                is_x = x_next < y_next
                if is_x:
                    far = x_next
                    x_next += x_space
                    at_x += x_step
                else:
                    far = y_next
                    y_next += y_space
                    at_y += y_step
                if at_x < 0 or at_y < 0 or at_x > last or at_y > last:
                    code = -1
                    break
                code = grid[at_y, at_x]
                if code < 0:
                    break
                surface = code
            far = max(far, 1e-6)
            top, bottom = _row(WALL_HEIGHT - lens.height, far, lens), _row(-lens.height, far, lens)

            # The rows of the goal's disc: its upper side from its far edge to its near one, and its rim.
            x_disc, y_disc, radius = marker[b, 0] - x, marker[b, 1] - y, _DISC_RADIUS * cell
            squared, along = x_go * x_go + y_go * y_go, x_go * x_disc + y_go * y_disc
            root = along * along - squared * (x_disc * x_disc + y_disc * y_disc - radius * radius)
            disc_top, disc_rim, disc_bottom, near = size, size, 0, 0.0
            if root > 0:
                root = math.sqrt(root)
                near, beyond = max((along - root) / squared, _NEAREST), min((along + root) / squared, far)
                if beyond > near:
                    disc_top = _row(_DISC_HEIGHT - lens.height, beyond, lens)
                    disc_rim, disc_bottom = _row(_DISC_HEIGHT - lens.height, near, lens), _row(-lens.height, near, lens)

            if has_labels:
                labels[b, :top, j] = _SKY_LABEL
                labels[b, top:bottom, j] = _WALL_LABEL
                labels[b, bottom:, j] = _FLOOR_LABEL
                for i in range(disc_top, disc_bottom):
                    labels[b, i, j] = _GOAL_LABEL
            if has_depth:
                depth[b, :top, j] = MAX_DEPTH
                depth[b, top:bottom, j] = min(far, MAX_DEPTH)
                for i in range(bottom, size):
                    depth[b, i, j] = min(lens.floor_depth[i], np.float32(MAX_DEPTH))
                for i in range(disc_top, disc_bottom):
                    above = (_DISC_HEIGHT - lens.height) / lens.slope[i]
                    depth[b, i, j] = min(above if i < disc_rim else near, MAX_DEPTH)
            if not has_rgb:
                continue

            picture = rgb[b]
            for i in range(top):
                for k in range(3):
                    tone = bright * (tones[SKY, 0, k] + tones[SKY, 1, k] * lens.sky[i, j])
                    picture[i, j, k] = min((np.int32(tone) + 128) >> 8, 255)

            # The wall, its pattern as coarse as a pixel sees it, and its sign.
            if is_x:
                face, place = (0 if x_go > 0 else 1), y + far * y_go
                slant = abs(x_ahead + y_go * y_ahead / x_go)
            else:
                face, place = (2 if y_go > 0 else 3), x + far * x_go
                slant = abs(y_ahead + x_go * x_ahead / y_go)
            slant = min(slant, 1e3)
            lit = lamps[face] * bright / (one + fading * np.float32(far * far))
            texels = far * pixel * TEXELS * max(slant, 1.0)
            level = min(int(math.log2(max(texels, 1.0)) + 0.5), 6)
            fall, up = pixel * far, lens.height + lens.slope[min(top, size - 1)] * far
            pattern = masks[looks.patterns[slot, surface]]
            _paint(picture, j, top, bottom, pattern, TEXELS >> level, place, up, fall, tones[surface], lit)
            across = (place / cell - math.floor(place / cell) - 0.5) / _SIGN_WIDTH + 0.5
            if code < -1 and 0 <= across < 1:
                upper = _row(_SIGN_BOTTOM + _SIGN_HEIGHT - lens.height, far, lens)
                lower = _row(_SIGN_BOTTOM - lens.height, far, lens)
                up = (lens.height - _SIGN_BOTTOM + lens.slope[min(upper, size - 1)] * far) / _SIGN_HEIGHT
                side = TEXELS >> min(level + 1, 6)
                _paint(picture, j, upper, lower, masks[-code], side, across, up, fall / _SIGN_HEIGHT, tones[SIGN], lit)

            # The floor.
            x_floor, y_floor = np.float32(x / cell), np.float32(y / cell)
            x_grow, y_grow = np.float32(x_go / cell), np.float32(y_go / cell)
            for i in range(bottom, size):
                side = lens.floor_side[i]
                x_texel = int((x_floor + lens.floor_depth[i] * x_grow) * side) & (side - 1)
                y_texel = int((y_floor + lens.floor_depth[i] * y_grow) * side) & (side - 1)
                texel = floor_mask[(4 * TEXELS * TEXELS - 4 * side * side) // 3 + y_texel * side + x_texel]
                for k in range(3):
                    picture[i, j, k] = min((floor[i, 0, k] + texel * floor[i, 1, k]) >> 8, 255)

            # The disc lets some of what is behind it through.
            for i in range(disc_top, disc_bottom):
                shine = light[0] + np.float32(0.1)  # and what it gives off
                if i < disc_rim:
                    shine += np.float32(0.49)  # of the sun
                else:
                    x_out, y_out = (near * x_go - x_disc) / radius, (near * y_go - y_disc) / radius
                    shine += light[1] * np.float32(max(-x_out * x_ahead - y_out * y_ahead, 0.0))
                    shine += light[2 if x_out < 0 else 3] * np.float32(abs(x_out))
                    shine += light[4 if y_out < 0 else 5] * np.float32(abs(y_out))
                for k in range(3):
                    tone = min(disc[k] * shine * gain[b], np.float32(255))
                    tone = np.float32(_DISC_OPACITY) * tone + np.float32(1 - _DISC_OPACITY) * picture[i, j, k]
                    picture[i, j, k] = np.uint8(tone)

        if has_rgb and noise_at[b] >= 0:
            for i in range(size):
                line = rgb[b, i].reshape(-1)
                first = (noise_at[b] + 7919 * i) % NUM_NOISE
                for k in range(len(line)):
                    line[k] = min(max(np.int16(line[k]) + noise[first + k], 0), 255)


@functools.cache
def _noise() -> np.ndarray:
    """Returns normal noise in levels: int8, enough for a row that begins at any of the first `NUM_NOISE`."""
    values = np.random.default_rng(0).normal(0, NOISE, NUM_NOISE).round().clip(-20, 20).astype(np.int8)
    return np.concatenate([values, values[: 3 * 2048]])


class RayCamera:
    """The camera of bodies in some mazes of one size."""

    def __init__(self, mazes: Mazes, camera: Camera, look: str = PLAIN, is_unseen: bool = False):
        """Takes pictures of a look, as `look_of`."""
        self._mazes, self._look, self._is_unseen = mazes, look, is_unseen
        self._size, self._cell_size = camera.size, mazes[0].cell_size
        self._lens = lens_of(camera, self._cell_size)
        self._slot_of = {0: 0}  # where the look of a maze is among `_looks`
        self._looks = Look(*(np.asarray(values)[None] for values in self._draw(0)))
        self._threads: ThreadPoolExecutor | None = None

    def _draw(self, maze: int) -> Look:
        return look_of(self._mazes[maze], self._look, self._is_unseen)

    def take(
        self,
        names: Sequence[str],
        maze: np.ndarray,
        pose: np.ndarray,
        marker: np.ndarray,
        gain: np.ndarray,
        noise_at: np.ndarray,
        threads: int = 1,
    ) -> dict[str, np.ndarray]:
        """Returns pictures by name.

        - "egocentric": `[B, H, H, 3]` uint8.
        - "depth": `[B, H, H]` float32, m along the view's axis, of a wide camera along its column's; at most 10.
        - "labels": `[B, H, H]` uint8: 0 sky, 1 floor, 2 wall, 3 goal.

        Args:
          names: of these.
          maze: `[B]` int, the index of each body's maze.
          pose: `[B, 3]` float64, x, y (m) and yaw (rad).
          marker: `[B, 3]` float64, m, where the goal's disc lies.
          gain: `[B]` float32, by which colours are multiplied.
          noise_at: `[B]` int, below 2^18: where the noise of a picture begins; -1 for none.
          threads: that draw; 0 for all cores.
        """
        shapes = {"egocentric": (3,), "depth": (), "labels": ()}
        kinds = {"egocentric": np.uint8, "depth": np.float32, "labels": np.uint8}
        count = len(pose)
        drawn = [
            np.empty((count * (name in names), self._size, self._size, *shapes[name]), kinds[name]) for name in shapes
        ]
        slots = self._slots(maze)
        scene = (self._lens, self._looks, slots, pose, marker, self._cell_size, patterns(), _DISC_COLOR)

        def draw(begin: int, end: int) -> None:
            _draw(begin, end, *scene, gain, noise_at, _noise(), *drawn)

        parts = min(threads or num_threads(), count // _FEWEST_PER_THREAD)
        if parts > 1:
            self._threads = self._threads or ThreadPoolExecutor(threads or num_threads())
            ends = [count * part // parts for part in range(parts + 1)]
            list(self._threads.map(draw, ends[:-1], ends[1:]))
        else:
            draw(0, count)
        return {name: values for name, values in zip(shapes, drawn, strict=True) if name in names}

    def _slots(self, maze: np.ndarray) -> np.ndarray:
        """Returns where the looks of mazes are kept, `[B]` int, and draws those that are not there."""
        numbers = maze.tolist()
        new = set(numbers) - self._slot_of.keys()
        if len(self._slot_of) + len(new) > _MOST_KEPT:  # begin anew, with those that are needed now
            self._slot_of, new = {}, set(numbers)
        for number in new:
            slot = len(self._slot_of)
            if slot == len(self._looks.grid):
                self._looks = Look(*(np.resize(kept, (2 * slot, *kept.shape[1:])) for kept in self._looks))
            for kept, values in zip(self._looks, self._draw(number), strict=True):
                kept[slot] = values
            self._slot_of[number] = slot
        return np.array([self._slot_of[number] for number in numbers])

    def close(self) -> None:
        """Ends the threads; the next pictures start others."""
        if self._threads is not None:
            self._threads.shutdown()
            self._threads = None
