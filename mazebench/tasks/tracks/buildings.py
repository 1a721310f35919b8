"""What the tracks of v3 have in common: large mazes of several kinds, and senses as a small robot has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from mazebench.constants import KINDS_VERSION
from mazebench.maps.benchmark import KINDS_SIZE, load_kind_mazes
from mazebench.maps.maze import Cell, Maze
from mazebench.tasks.perturbations.base import ShownMap
from mazebench.tasks.tracks.base import Track
from mazebench.tasks.tracks.stale import is_blocked
from mazebench.world.lidar import TURTLEBOT3, LidarModel


class BuildingTrack(Track):
    """A track in mazes of 31 x 31 cells of several kinds, with goals 15 to 40 cells away and a TurtleBot3's lidar."""

    version = KINDS_VERSION
    sizes = (KINDS_SIZE, KINDS_SIZE, KINDS_SIZE)
    lidar: ClassVar[LidarModel] = TURTLEBOT3
    spare_steps: ClassVar[int] = 50  # of the time limit, beside six a cell

    def _load_mazes(self, size: int, split: str) -> tuple[Maze, ...]:
        return load_kind_mazes(split)

    def distances(self, level: int) -> tuple[int, ...]:
        return tuple(range(15, 41))

    def time_limit(self, level: int, distance: int) -> int:
        return 6 * distance + self.spare_steps

    def check(self, maze: Maze, levels: Sequence[int]) -> None:
        for level in levels:
            for part, strength in self.parts(level):
                part.require(maze, strength)

    def facts(self, maze: Maze, shown: ShownMap, ends: tuple[Cell, Cell]) -> dict[str, bool | str]:
        """Returns as `blocked` whether a shortest path on the map leads through a wall, and the maze's `kind`."""
        kind = {"kind": maze.kind} if maze.kind else {}
        return {"blocked": is_blocked(maze.walls, shown.walls, ends)} | kind
