"""The track `rebuilt`: doors have moved since the map was drawn."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.benchmark import KINDS_SIZE
from mazebench.maps.doors import door_slots, num_swappable, swap_doors
from mazebench.maps.maze import Cell, Maze
from mazebench.tasks.perturbations.perturbation import Perturbation, ShownMap
from mazebench.tasks.streams import Stream
from mazebench.tasks.tracks.track import Track

# How many doors of a maze of 31 x 31 cells move, by kind, so that this share of the shortest paths on the map is
# blocked in the maze (`python -m benchmarks.tracks_checks swaps`). Mazes of no kind are taken for houses.
SWAPS: dict[str, dict[float, int]] = {
    "dfs": {0.45: 9, 0.7: 18, 0.85: 29},
    "house": {0.45: 3, 0.7: 7, 0.85: 12},
    "rooms": {0.45: 6, 0.7: 13, 0.85: 21},
    "office": {0.45: 4, 0.7: 8, 0.85: 15},
    "hospital": {0.45: 5, 0.7: 10, 0.85: 17},
    "museum": {0.45: 3, 0.7: 6, 0.85: 10},
}
_DEFAULT_KIND = "house"


class Rebuilt(Track):
    """Shows a building in which some doors are closed that are open in the world, and as many are open that are closed.

    The pose is exact.
    """

    help = "Doors have moved since the map was drawn."
    levels = (
        "doors have moved: .45 of the shortest paths on the map are blocked",
        "doors have moved: .7 of the paths are blocked",
        "doors have moved: .85 of the paths are blocked",
    )

    def parts(self, level: int) -> Sequence[tuple[Perturbation, float]]:
        return ((MovedDoors(), (0.45, 0.7, 0.85)[level - 1]),)


class MovedDoors(Perturbation):
    """Shows an earlier state of the building; the level is the share of shortest paths on the map that are blocked."""

    stream = Stream.MOVED_DOORS

    def require(self, maze: Maze, level: float) -> None:
        needed, movable = num_swaps(maze, level), num_swappable(maze) - 2  # start and goal may be doors
        if movable < needed:
            raise InputError(f"{maze.name}: expected {needed} doors that can move, found {max(0, movable)}")

    def show(self, shown: ShownMap, level: float, ends: tuple[Cell, Cell], rng: np.random.Generator) -> ShownMap:
        maze = Maze(shown.walls, "shown", kind=shown.kind)
        walls = swap_doors(maze.walls, door_slots(maze), num_swaps(maze, level), ends, rng)
        return dataclasses.replace(shown, walls=walls)


def num_swaps(maze: Maze, share: float) -> int:
    """Returns how many doors of a maze move so that this share of the shortest paths on the map is blocked.

    In mazes of other sizes, as many move for each cell.
    """
    swaps = SWAPS.get(maze.kind, SWAPS[_DEFAULT_KIND])[share]
    return max(1, round(swaps * (maze.size / KINDS_SIZE) ** 2))
