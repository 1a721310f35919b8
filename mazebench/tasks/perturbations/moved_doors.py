"""Doors that have moved since the map was drawn."""

from __future__ import annotations

import dataclasses

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.benchmark import KINDS_SIZE
from mazebench.maps.doors import num_swappable, swap_doors
from mazebench.maps.maze import Cell, Maze
from mazebench.tasks.perturbations.perturbation import Of, Perturbation, ShownMap
from mazebench.tasks.streams import Stream

# How many doors of a maze of 31 x 31 cells move, by kind, so that so many per cent of the shortest paths on the map are
# blocked in the maze; `python -m benchmarks.measures doors` counts it on mazes that are in no split.
SWAPS_BY_PERCENT = {
    "dfs": {45: 9, 70: 18, 85: 29},
    "house": {45: 3, 70: 7, 85: 12},
    "rooms": {45: 6, 70: 13, 85: 21},
    "office": {45: 4, 70: 8, 85: 15},
    "hospital": {45: 5, 70: 10, 85: 17},
    "museum": {45: 3, 70: 6, 85: 10},
}
_STRENGTHS = {45: 1, 70: 2, 85: 3}  # by per cent, see `mazebench.maps.changes`


@dataclasses.dataclass(frozen=True)
class MovedDoors(Perturbation):
    """Doors that have moved since the map was drawn: some are closed that were open, and as many are open.

    A maze of a user's own is the plan. Its building is a changed one, of the strength that stands for these doors.
    """

    percent: int  # of the shortest paths on the map that are blocked

    of = Of.BUILDING
    stream = Stream.MOVED_DOORS

    def require(self, maze: Maze) -> None:
        if maze.kind not in SWAPS_BY_PERCENT:
            found = f"kind {maze.kind!r}" if maze.kind else "none"
            raise InputError(f"{maze.name}: expected a kind of {', '.join(SWAPS_BY_PERCENT)}, found {found}")
        needed, movable = self.num_swaps(maze), num_swappable(maze) - 2  # start and goal may be doors
        if movable < needed:
            raise InputError(f"{maze.name}: expected {needed} doors that can move, found {max(0, movable)}")

    def shown(self, shown: ShownMap, ends: tuple[Cell, ...], rng: np.random.Generator) -> ShownMap:
        walls = swap_doors(shown.walls, shown.kind, self.num_swaps(shown), ends, rng)
        return dataclasses.replace(shown, walls=walls)

    def building(self, plan: Maze, rng: np.random.Generator) -> Maze:
        from mazebench.maps.changes import changed  # which needs numba

        return changed(plan, _STRENGTHS[self.percent], rng)

    def num_swaps(self, maze: Maze | ShownMap) -> int:
        """Returns how many doors of a maze move; in mazes of other sizes, as many for each cell."""
        swaps = SWAPS_BY_PERCENT[maze.kind][self.percent]
        return max(1, round(swaps * (len(maze.walls) / KINDS_SIZE) ** 2))
