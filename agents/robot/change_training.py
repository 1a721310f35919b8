"""Trains the network that tells what has changed since a map was made, on fresh train mazes with doors moved or not.

python -m mazebench_agents.robot.change_training --out map-changes.safetensors
"""

from __future__ import annotations

import contextlib
from typing import NamedTuple

import numpy as np
import torch

from mazebench.errors import InputError
from mazebench.kernels import compiled
from mazebench.maps.follower import sight_lines
from mazebench.maps.kinds import KNOWN, generate
from mazebench.maps.search import distances
from mazebench.tasks.perturbations.moved_doors import MovedDoors
from mazebench.tasks.perturbations.perturbation import ShownMap

from ..common.lessons import KeptLessons, main
from ..common.symmetry import turn_planes
from .change_network import NAME, ChangeNetwork

_SIZE = 31  # cells a side
_SAME_MAZE = 4  # maps of a maze, one for each of these changes
_MOVED = (None, MovedDoors(45), MovedDoors(70), MovedDoors(85))
_SIGHT = 3.5  # m
_LONGEST = 300  # cells of a walk; the logs of their numbers are as likely as each other
_UNSEEN = 0.1  # share of maps of which nothing was seen yet
_SEED = 76_000  # of mazes in no split


class Seen(NamedTuple):
    """A shown map, its building, and what was seen of that; `[N, N]` bool each."""

    shown: np.ndarray
    true: np.ndarray
    seen: np.ndarray


class Walks:
    """A stream of maps of mazes of some kinds, and of what a robot has seen that walks from place to place."""

    def __init__(self, seed: int, begin: int = 0, kinds: tuple[str, ...] = KNOWN):
        """Draws from a seed of two numbers; each maze is a new one."""
        self._rng, self._kinds = np.random.default_rng([_SEED, seed, begin]), kinds
        self._offsets, self._before = sight_lines(_SIGHT)
        self._num_drawn = 0

    def draw(self) -> Seen:
        """Returns the next map with what was seen."""
        rng, change = self._rng, _MOVED[self._num_drawn % _SAME_MAZE]
        if self._num_drawn % _SAME_MAZE == 0:
            self._maze = generate(self._kinds[rng.integers(len(self._kinds))], _SIZE, rng)
        self._num_drawn += 1
        walls, shown = self._maze.walls, ShownMap(self._maze.walls, kind=self._maze.kind)
        free = np.flatnonzero(~walls)
        start, goal = rng.choice(free, 2, replace=False)
        if change is not None:
            with contextlib.suppress(InputError):  # of a maze with few doors
                shown = change.shown(shown, (divmod(int(start), _SIZE), divmod(int(goal), _SIZE)), rng)

        # Along shortest ways, to the goal and then on.
        seen = np.zeros(walls.shape, dtype=bool)
        left = 0 if rng.random() < _UNSEEN else int(np.exp(rng.uniform(0, np.log(_LONGEST))))
        while left > 0:
            left -= _walk(walls, distances(walls, int(goal)), start, left, self._offsets, self._before, seen)
            start, goal = goal, rng.choice(free)
        return Seen(shown.walls, walls, seen)


@compiled
def _walk(
    walls: np.ndarray,
    to_goal: np.ndarray,
    start: int,
    most: int,
    offsets: np.ndarray,
    before: np.ndarray,
    seen: np.ndarray,
) -> int:
    """Marks in `seen` what is in sight of the first cells of a shortest way, at most `most`; returns how many."""
    size, is_clear = len(walls), np.ones(len(offsets), np.bool_)
    row, column, count = start // size, start % size, 0
    while count < most:
        count += 1
        for index in range(len(offsets)):
            r, c = row + offsets[index, 0], column + offsets[index, 1]
            is_clear[index] = is_clear[before[index]]
            if is_clear[index]:
                seen[r, c] = True
                is_clear[index] = not walls[r, c]
        if to_goal[row, column] == 0:
            break
        for down, right in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            if to_goal[row + down, column + right] == to_goal[row, column] - 1:
                row, column = row + down, column + right
                break
    return count


class ChangeLessons(KeptLessons):
    """Maps, their buildings and what was seen of these."""

    name, num_updates, learning_rate, batch = NAME, 12_000, 3e-3, 16

    def __init__(self, seed: int, begin: int = 0):
        super().__init__(seed, begin)
        self._walks = Walks(seed, begin)

    def make_network(self) -> ChangeNetwork:
        return ChangeNetwork()

    def sample(self) -> tuple[np.ndarray, ...]:
        return self._walks.draw()

    def loss(self, network: ChangeNetwork, parts: list[torch.Tensor], symmetry: int) -> torch.Tensor:
        return network.loss(*(turn_planes(part, symmetry) for part in parts))


if __name__ == "__main__":
    main(ChangeLessons, __doc__)
