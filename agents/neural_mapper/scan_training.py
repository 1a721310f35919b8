"""Trains the network that writes maps, on scans along random walks in fresh mazes of the kinds of the split `train`.

python -m mazebench_agents.neural_mapper.scan_training --out scan-walls.safetensors
"""

from __future__ import annotations

import numpy as np
import torch

from mazebench.maps.kinds import KNOWN, generate
from mazebench.tasks.sensors.lidar import read
from mazebench.world.ray_casting import TURTLEBOT3, Lidar

from ..common.lessons import Lessons, main
from .network import NAME, SIDE, WallWriter, rows_of

_SIZE = 31  # cells a side
_NUM_MAZES = 256  # that walks are in at a time
_SAME_MAZES = 500  # updates
_LENGTH = 8  # scans of a walk
_OFF = 0.35  # cells from the middle of a cell, at most, along each axis
_STAYS = 0.5  # share of steps within a cell
_TURN = 0.6  # rad, standard deviation of a turn
_SEED = 77_000  # of mazes in no split
_HALF = SIDE // 2


class Walks:
    """A stream of walks: poses, scans and walls around them."""

    def __init__(self, seed: int, begin: int = 0):
        """Draws from a seed of two numbers."""
        self._rng, self._num_drawn = np.random.default_rng([_SEED, seed, begin]), 0

    def draw(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Returns mazes `[count]` int, cells `[T, count, 2]` int, inputs `[T, count, R + 3]` and all walls."""
        rng = self._rng
        if self._num_drawn % _SAME_MAZES == 0:
            kinds = rng.choice(KNOWN, _NUM_MAZES)
            self._mazes = tuple(generate(kind, _SIZE, rng) for kind in kinds)
            self._lidar = Lidar(self._mazes, TURTLEBOT3.max_range)
            self._walls = np.pad(
                np.stack([maze.walls for maze in self._mazes]),
                ((0, 0), (_HALF, _HALF), (_HALF, _HALF)),
                constant_values=True,
            )
        self._num_drawn += 1
        maze = rng.integers(_NUM_MAZES, size=count)
        free = [np.argwhere(~self._mazes[number].walls) for number in maze]
        cell = np.array([cells[rng.integers(len(cells))] for cells in free])
        yaw = rng.uniform(-np.pi, np.pi, count)
        cells, inputs = [], []
        sides = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)])
        for _ in range(_LENGTH):
            tried = cell + sides[rng.integers(4, size=count)]
            is_open = ~self._walls[maze, tried[:, 0] + _HALF, tried[:, 1] + _HALF] & (rng.random(count) > _STAYS)
            cell = np.where(is_open[:, None], tried, cell)
            yaw = yaw + rng.normal(0, _TURN, count)
            off = rng.uniform(-_OFF, _OFF, (count, 2))
            pose = np.column_stack([cell[:, 1] + 0.5 + off[:, 0], _SIZE - 0.5 - cell[:, 0] + off[:, 1], yaw])
            ranges = read(self._lidar.ranges(maze, pose), TURTLEBOT3, [rng] * count)
            cells.append(cell)
            inputs.append(rows_of(pose, ranges.astype(np.float64)))
        return maze, np.stack(cells), np.stack(inputs), self._walls


class ScanLessons(Lessons):
    """Walks, in which the network reads what it wrote."""

    name, num_updates, learning_rate, batch = NAME, 24_000, 1e-3, 128

    def __init__(self, seed: int, begin: int = 0):
        self._walks = Walks(seed, begin)

    def make_network(self) -> WallWriter:
        return WallWriter()

    def next_loss(self, network: WallWriter) -> torch.Tensor:
        maze, cells, inputs, walls = self._walks.draw(self.batch)
        is_wall, window = torch.from_numpy(walls)[torch.from_numpy(maze)], torch.arange(SIDE)
        written, number = torch.zeros(is_wall.shape), torch.arange(self.batch)[:, None, None]
        loss = torch.zeros(())
        for cell, rows in zip(torch.from_numpy(cells), torch.from_numpy(inputs), strict=True):
            around = number, cell[:, 0, None, None] + window[:, None], cell[:, 1, None, None] + window
            patch = network(written[around], rows)
            loss = loss + network.loss(patch, is_wall[around]) / _LENGTH
            written = written.index_put(around, patch)
        return loss


if __name__ == "__main__":
    main(ScanLessons, __doc__)
