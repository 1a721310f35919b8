"""Mazes of some kinds that are drawn, not read: a fixed number of each kind, or a new one for every episode."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
from collections.abc import Callable, Sequence

import numpy as np

from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze

NUM_FRESH = 2**31  # mazes, so that an episode hardly ever meets one of another episode
# First numbers of the seeds: no maze of one purpose is another one of another purpose.
_SEEDS = {"train": 41_000, "dev": 42_000, "fresh": 43_000}
_NUM_ROWS = 512  # of `MazeRows`, unless more mazes are met at once
_NUM_KEPT = 1024  # fresh mazes; with its distances one of 31 x 31 takes some 40 kB


def draw_mazes(kinds: tuple[str, ...], size: int, split: str, num_mazes: int) -> tuple[Maze, ...]:
    """Returns `num_mazes` mazes of each of some kinds, the same ones at every call.

    They do not depend on the other kinds, and the first ones do not depend on `num_mazes`.

    Args:
      kinds: of `mazebench.maps.kinds`.
      size: N, cells on a side.
      split: "train" or "dev".
      num_mazes: of each kind.

    Raises:
      InputError: if a kind can't make mazes of this size.
    """
    return tuple(
        generate(kind, size, _rng(split, size, number, *kind.encode()), f"{kind}-{size}-{split}-{number:02d}")
        for kind in kinds
        for number in range(num_mazes)
    )


@dataclasses.dataclass(frozen=True)
class FreshMazes:
    """As many mazes of some kinds as there are numbers below 2**31; each is drawn when it is asked for.

    A maze follows from its number, so that nobody has to store it.
    """

    kinds: tuple[str, ...]
    size: int  # N, cells on a side

    cell_size = 1.0  # m

    def __len__(self) -> int:
        return NUM_FRESH

    def __getitem__(self, number: int) -> Maze:
        return _fresh_maze(self.kinds, self.size, int(number))


# The mazes of a task.
Mazes = tuple[Maze, ...] | FreshMazes


class MazeRows:
    """Arrays with a row for each maze that was met of late; `K` is the number of mazes that are asked for."""

    def __init__(self, row_of: Callable[[int], Sequence[np.ndarray]]):
        """Takes a function that returns the row of a maze, by its index, in each of the arrays."""
        self._row_of = row_of
        self._place_of: dict[int, int] = {}
        self.arrays: tuple[np.ndarray, ...] = ()  # `[P, ...]` each; replaced where they grow

    def places(self, maze: np.ndarray) -> np.ndarray:
        """Returns where the rows of some mazes are, `[K]` int, and makes those that are not there."""
        numbers = maze.tolist()
        with contextlib.suppress(KeyError):
            return np.array([self._place_of[number] for number in numbers])
        wanted = set(numbers)
        new = wanted - self._place_of.keys()
        if len(self._place_of) + len(new) > max(_NUM_ROWS, 2 * len(wanted)):  # begin again with those of now
            self._place_of, new = {}, wanted
        for number in new:
            place, row = len(self._place_of), self._row_of(number)
            if not self.arrays:
                self.arrays = tuple(np.array(values)[None] for values in row)
            elif place == len(self.arrays[0]):
                self.arrays = tuple(np.resize(kept, (2 * place, *kept.shape[1:])) for kept in self.arrays)
            for kept, values in zip(self.arrays, row, strict=True):
                kept[place] = values
            self._place_of[number] = place
        return np.array([self._place_of[number] for number in numbers])


@functools.lru_cache(maxsize=_NUM_KEPT)
def _fresh_maze(kinds: tuple[str, ...], size: int, number: int) -> Maze:
    rng = _rng("fresh", size, number)
    kind = kinds[rng.integers(len(kinds))]
    return generate(kind, size, rng, f"{kind}-{size}-fresh-{number}")


def _rng(purpose: str, *numbers: int) -> np.random.Generator:
    return np.random.default_rng([_SEEDS[purpose], *numbers])
