"""Trains the network that writes maps, on scans along random walks in fresh mazes of the kinds of the split `train`.

python -m mazebench_agents.neural_mapper.scan_training --out scan-walls.safetensors
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from mazebench.maps.kinds import KNOWN, generate
from mazebench.tasks.sensors.lidar import read
from mazebench.world.ray_casting import NUM_RAYS, TURTLEBOT3, Lidar

from ..common.lessons import Lessons, main
from .network import NAME, REACH, SIDE, WallWriter, rows_of

_SIZE = 31  # cells a side
_NUM_MAZES = 256  # that walks are in at a time
_SAME_MAZES = 100  # batches of walks
_LENGTH = 8  # scans of a part of a walk, through which the gradient goes
_PARTS = 6  # of a walk
_EDGE, _OFF = 0.5, 0.35  # cells from the middle of a cell, at most, along an axis: to an open side, and to a wall
_STAYS = 0.5  # share of steps within a cell
_TURN = 0.6  # rad, standard deviation of a turn
_SEED = 77_000  # of mazes in no split
_HALF = SIDE // 2
_SIDES = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)])  # right, down, left, up
_ALONG = np.arange(0, REACH + 0.2, 0.2)  # m, points of a ray
_INTO = 0.05  # m behind the face of a wall


class Walked(NamedTuple):
    """Walks, each in a maze with walls around it, `H` cells a side; `T` scans each."""

    cells: np.ndarray  # [T, B, 2] int, of the bodies, in the maze without these walls
    rows: np.ndarray  # [T, B, R + 3] float32, see `rows_of`
    seen: np.ndarray  # [T, B, H, H] bool, the cells that a ray has reached so far
    walls: np.ndarray  # [B, H, H] bool


class Walks:
    """A stream of random walks in fresh mazes, with the scans of the lidar of the tracks."""

    def __init__(self, seed: int, begin: int = 0):
        """Draws from a seed of two numbers."""
        self._rng, self._num_drawn = np.random.default_rng([_SEED, seed, begin]), 0

    def begin(self, count: int) -> None:
        """Begins so many walks."""
        rng = self._rng
        if self._num_drawn % _SAME_MAZES == 0:
            self._mazes = tuple(generate(kind, _SIZE, rng) for kind in rng.choice(KNOWN, _NUM_MAZES))
            self._lidar = Lidar(self._mazes, TURTLEBOT3.max_range)
        self._num_drawn += 1
        self._maze = rng.integers(_NUM_MAZES, size=count)
        walls = [self._mazes[number].walls for number in self._maze]
        free = [np.argwhere(~each) for each in walls]
        self._cell = np.array([cells[rng.integers(len(cells))] for cells in free])
        self._walls = np.pad(np.stack(walls), ((0, 0), (_HALF, _HALF), (_HALF, _HALF)), constant_values=True)
        self._yaw, self._seen = rng.uniform(-np.pi, np.pi, count), np.zeros(self._walls.shape, dtype=bool)

    def go_on(self) -> Walked:
        """Returns the next part of the walks."""
        rng, maze, walls, count = self._rng, self._maze, self._walls, len(self._maze)
        walk, steps = np.arange(count), []
        for _ in range(_LENGTH):
            # It stays in its cell, or goes to one beside it.
            beside = self._cell[:, None] + _SIDES
            is_wall = walls[walk[:, None], beside[..., 0] + _HALF, beside[..., 1] + _HALF]  # [B, 4]
            side = rng.integers(4, size=count)
            goes = ~is_wall[walk, side] & (rng.random(count) > _STAYS)
            self._cell = np.where(goes[:, None], beside[walk, side], self._cell)
            self._yaw = self._yaw + rng.normal(0, _TURN, count)

            # Anywhere in the cell, but not near a wall.
            beside = self._cell[:, None] + _SIDES
            is_wall = walls[walk[:, None], beside[..., 0] + _HALF, beside[..., 1] + _HALF]
            right, down, left, up = np.where(is_wall, _OFF, _EDGE).T
            off = np.clip(rng.uniform(-_EDGE, _EDGE, (2, count)), [-left, -down], [right, up])
            x, y = self._cell[:, 1] + 0.5 + off[0], _SIZE - 0.5 - self._cell[:, 0] + off[1]
            pose = np.column_stack([x, y, self._yaw])

            # Points along the rays, as far as into the cells of walls.
            true = self._lidar.ranges(maze, pose)
            angles = self._yaw[:, None] + np.arange(NUM_RAYS) * (2 * np.pi / NUM_RAYS)
            length = np.minimum(_ALONG, np.where(true < REACH, true + _INTO, REACH)[..., None])
            column = np.floor(x[:, None, None] + np.cos(angles)[..., None] * length).astype(int)
            level = np.floor(y[:, None, None] + np.sin(angles)[..., None] * length).astype(int)
            self._seen[walk[:, None, None], _SIZE - 1 - level + _HALF, column + _HALF] = True
            ranges = read(true, TURTLEBOT3, [rng] * count).astype(np.float64)
            steps.append((self._cell, rows_of(pose, ranges), self._seen.copy()))
        cells, rows, seen = (np.stack(parts) for parts in zip(*steps, strict=True))
        return Walked(cells, rows, seen, walls)


class ScanLessons(Lessons):
    """Walks, in which the network reads what it wrote."""

    name, num_updates, learning_rate, batch = NAME, 14_000, 1e-3, 128

    def __init__(self, seed: int, begin: int = 0):
        self._walks, self._num_parts = Walks(seed, begin), 0
        self._written = torch.zeros(())

    def make_network(self) -> WallWriter:
        return WallWriter()

    def next_loss(self, network: WallWriter) -> torch.Tensor:
        if self._num_parts % _PARTS == 0:
            self._walks.begin(self.batch)
        *steps, walls = (torch.from_numpy(part) for part in self._walks.go_on())
        written = torch.zeros(walls.shape) if self._num_parts % _PARTS == 0 else self._written
        self._num_parts += 1
        window, number, loss = torch.arange(SIDE), torch.arange(self.batch)[:, None, None], torch.zeros(())
        for cell, rows, seen in zip(*steps, strict=True):
            around = number, cell[:, 0, None, None] + window[:, None], cell[:, 1, None, None] + window
            patch = network(written[around], rows)
            loss = loss + network.loss(patch, walls[around], seen[around]) / _LENGTH
            written = written.index_put(around, patch)
        self._written = written.detach()
        return loss


if __name__ == "__main__":
    main(ScanLessons, __doc__)
