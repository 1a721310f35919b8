"""What a track is: a named way in which the map or the senses are imperfect, and the task in which it is measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from mazebench.constants import TRACKS_VERSION
from mazebench.errors import InputError
from mazebench.maps.benchmark import load_track_mazes
from mazebench.maps.maze import Cell, Maze
from mazebench.tasks.perturbations.base import Perturbation, ShownMap
from mazebench.world.lidar import LidarModel

LEVELS = (1, 2, 3)


class Track(Perturbation):
    """One way in which the map or the senses are imperfect, in three levels, and the task in which it is measured.

    A track is played as the local task with one goal, and offers the sensor `lidar`. It fixes mazes, context size and
    time limit, so that results of one track and level can be compared. A subclass overrides what its imperfection is
    made of: `show`, `state_error`, or both, which take the level from 1 to 3; or `parts`, where several things are
    wrong at once.
    """

    version: ClassVar[int] = TRACKS_VERSION  # of the benchmark that the track belongs to
    levels: ClassVar[tuple[str, str, str]]  # what each level means, in words
    sizes: ClassVar[tuple[int, int, int]] = (13, 13, 13)  # N, cells a side of the benchmark's mazes, by level
    refused_sensors: ClassVar[tuple[str, ...]] = ()  # those that would give away what the track hides
    lidar: ClassVar[LidarModel] = LidarModel()

    @property
    def benchmark(self) -> str:
        """The name of the benchmark that the track belongs to, as "v2"."""
        return f"v{self.version}"

    def parts(self, level: int) -> Sequence[tuple[Perturbation, float]]:
        """Returns what is wrong at a level, in the order in which it applies; each part has a random stream."""
        return ((self, level),)

    def odometry_noise(self, level: int) -> float:
        """Returns alpha of the noise on the observed motion; see `mazebench.tasks.odometry.NoisyMotion`."""
        return 0.0

    def hides_pose(self, level: int) -> bool:
        """Returns whether the observed pose does not tell where on the map the body is."""
        return False

    def mazes(self, levels: Sequence[int], split: str) -> tuple[Maze, ...]:
        """Returns the benchmark's mazes for some levels.

        Raises:
          InputError: if the levels are not played in mazes of one size.
        """
        sizes = [self.sizes[level - 1] for level in levels]
        if len(set(sizes)) > 1:
            raise InputError(
                f"expected levels in mazes of one size, found levels {_in_words(levels)} with sizes {_in_words(sizes)}"
            )
        return self._load_mazes(sizes[0], split)

    def _load_mazes(self, size: int, split: str) -> tuple[Maze, ...]:
        return load_track_mazes(size, split)

    def distances(self, level: int) -> tuple[int, ...]:
        """Returns the distances between start and goal that are drawn, in cells."""
        return tuple(range(3, 21))

    def context_size(self, levels: Sequence[int], size: int) -> int:
        """Returns M for mazes of `size` cells a side.

        Raises:
          InputError: if the levels have contexts of different sizes.
        """
        sizes = [self._context_size(level, size) for level in levels]
        if len(set(sizes)) > 1:
            raise InputError(
                f"expected levels with one context_size, found levels {_in_words(levels)} with {_in_words(sizes)}"
            )
        return sizes[0]

    def _context_size(self, level: int, size: int) -> int:
        return size

    def time_limit(self, level: int, distance: int) -> int:
        """Returns the agent steps of an episode whose goal is `distance` cells away."""
        return 200

    def check(self, maze: Maze, levels: Sequence[int]) -> None:
        """Raises `InputError` if the track can't be played in `maze`."""

    def facts(self, maze: Maze, shown: ShownMap, ends: tuple[Cell, Cell]) -> dict[str, bool | str]:
        """Returns what records say of an episode beside its outcome; summaries report the groups.

        Args:
          maze: the true one.
          shown: the map that the agent is shown.
          ends: the start and the goal.
        """
        return {}


def _in_words(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers))
