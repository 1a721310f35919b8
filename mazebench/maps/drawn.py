"""Mazes of some kinds that are drawn, not read: a fixed number of each kind, or a new one for every episode."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze

NUM_FRESH = 2**31  # mazes, so that an episode hardly ever meets one of another episode
# First numbers of the seeds: no maze of one purpose is another one of another purpose.
_SEEDS = {"train": 41_000, "dev": 42_000, "fresh": 43_000}
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


@functools.lru_cache(maxsize=_NUM_KEPT)
def _fresh_maze(kinds: tuple[str, ...], size: int, number: int) -> Maze:
    rng = _rng("fresh", size, number)
    kind = kinds[rng.integers(len(kinds))]
    return generate(kind, size, rng, f"{kind}-{size}-fresh-{number}")


def _rng(purpose: str, *numbers: int) -> np.random.Generator:
    return np.random.default_rng([_SEEDS[purpose], *numbers])
