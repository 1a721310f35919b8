"""A track: a named way in which the map or the senses are imperfect, and the task in which it is measured."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import ClassVar

from mazebench.maps.maze import Maze
from mazebench.tasks.perturbations.perturbation import Perturbation

LEVELS = (1, 2, 3)
DISTANCES = tuple(range(15, 41))  # cells between start and goal


class Track(abc.ABC):
    """One way in which the map or the senses are imperfect, in three levels, and the task in which it is measured.

    A track is played as the local task with one goal, in mazes of 31 x 31 cells of several kinds. It offers the sensor
    `lidar`, that of a TurtleBot3. It fixes mazes, distances, context size and time limit, so that results of one track
    and level can be compared.
    """

    help: ClassVar[str]  # what is imperfect, in one line
    levels: ClassVar[tuple[str, str, str]]  # what each level means, in words
    hides_pose: ClassVar[bool] = False  # whether the observed pose is odometry, which does not tell where the body is
    odometry_noise: ClassVar[tuple[float, float, float]] = (0.0, 0.0, 0.0)  # alpha of `NoisyMotion`, by level
    pixels_per_cell: ClassVar[int] = 1  # of the shown map, along each axis

    @abc.abstractmethod
    def parts(self, level: int) -> Sequence[tuple[Perturbation, float]]:
        """Returns what is wrong at a level with the strength of each part, in the order in which they apply."""

    def require(self, maze: Maze, levels: Sequence[int]) -> None:
        """Raises `InputError` if the track can't be played in `maze`."""
        for level in levels:
            for part, strength in self.parts(level):
                part.require(maze, strength)
