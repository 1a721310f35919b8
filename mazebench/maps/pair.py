"""The differences of a maze and an older map of it: what is wall now, what is free now, and what one of them lacks.

`N` is the number of cells on a side of the maze.
"""

from __future__ import annotations

import dataclasses
import math

import cv2
import numpy as np

from mazebench.maps.align import wall_distances
from mazebench.maps.maze import Maze
from mazebench.maps.pictures import draw_grid
from mazebench.maps.readers.occupancy_grid import FREE, OCCUPIED, UNKNOWN, Pose

# Of the picture: its longer side and the height of a line of its legend in pixels, and its colours.
_PAIR_SIDE, _LINE = 900, 24
OF_PAIR = {"wall_now": (214, 61, 61), "free_now": (64, 161, 99), "on_one_map": (168, 200, 236)}


@dataclasses.dataclass(frozen=True, eq=False)
class Pair:
    """The differences of a maze and an older map of it, in the cells of the maze. A cell is in one of them at most."""

    wall_now: np.ndarray  # [N, N] bool: a wall of the maze stands where the older map is free
    free_now: np.ndarray  # [N, N] bool: a wall of the older map stands where the maze is free
    on_one_map: np.ndarray  # [N, N] bool: free on one, unknown on the other
    cell_size: float  # m
    covered: float  # share of the free space of the map that has less of it which is free on the other one, too
    pose: Pose | None = None  # of the older map's frame in the maze's map, if it was found by its walls

    @property
    def areas(self) -> dict[str, float]:
        """The areas of the differences by their names, in m2."""
        names = ("wall_now", "free_now", "on_one_map")
        return {name: round(float(np.sum(getattr(self, name))) * self.cell_size**2, 2) for name in names}

    def describe(self, name: str) -> str:
        """Returns the differences in words; `name` is that of the maze."""
        areas, laid = self.areas, ""
        if self.pose is not None:
            x, y, yaw = self.pose
            laid = f"turned by {math.degrees(yaw):.2f} degrees, then moved by ({x:g}, {y:g}) m; "
        return (
            f"{laid}{self.covered:.2f} of the smaller free space is common with {name}; {areas['wall_now']:g} m2 "
            f"are wall now, {areas['free_now']:g} m2 are free now, {areas['on_one_map']:g} m2 are on one map only"
        )


def compared(
    shown: np.ndarray, built: np.ndarray, size: int, cell_size: float, covered: float, pose: Pose | None = None
) -> Pair:
    """Returns the differences of an older map, `shown`, and the map that a maze was made of, `built`.

    Both are states of `k` x `k` squares in each of `size` x `size` cells, `[N k, N k]`. What is unknown on either is
    neither wall now nor free now, and neither are walls that are at most half a cell away from one of the other map:
    maps are drawn, and laid on each other, with such errors.
    """
    squares = len(built) // size
    new, gone = (
        (walls == OCCUPIED) & (others == FREE) & (wall_distances(others == OCCUPIED) > squares / 2)
        for walls, others in ((built, shown), (shown, built))
    )

    def some(found: np.ndarray) -> np.ndarray:  # [N, N] bool: the cells that have some of these squares
        return np.asarray(found.reshape(size, squares, size, squares).any(axis=(1, 3)))

    wall_now = some(new)
    on_one_map = ~wall_now & (
        ~some(shown != FREE) & some(built == UNKNOWN) | ~some(built != FREE) & some(shown == UNKNOWN)
    )
    return Pair(wall_now, some(gone) & ~wall_now & ~on_one_map, on_one_map, cell_size, covered, pose)


def pair_of_walls(shown: np.ndarray, built: np.ndarray, cell_size: float) -> Pair:
    """Returns the differences of the walls (`[N, N]` bool) of an older map and of a maze, of which all is known."""
    older, newer = (np.where(walls, OCCUPIED, FREE) for walls in (shown, built))
    covered = np.sum(~(shown | built)) / max(1, min(np.sum(~shown), np.sum(~built)))
    return compared(older, newer, len(built), cell_size, float(covered))


def draw_pair(pair: Pair, maze: Maze) -> np.ndarray:
    """Draws the differences of `maze` and an older map of it, with a legend below: `[H, W, 3]` uint8 RGB.

    Red cells are wall now, green ones free now, and blue ones are on one map only. Walls at the right and at the bottom
    that only make the maze square are left out.
    """
    changed = {name: getattr(pair, name) for name in OF_PAIR}
    rows, columns = np.nonzero(~maze.walls | np.logical_or.reduce(list(changed.values())))
    height, width = rows.max() + 2, columns.max() + 2
    pixels = max(1, round(_PAIR_SIDE / max(height, width)))
    image = draw_grid(maze.walls, pixels)
    for name, cells in changed.items():
        image[cells.repeat(pixels, axis=0).repeat(pixels, axis=1)] = OF_PAIR[name]
    image = image[: height * pixels, : width * pixels]

    # A line of the legend for each difference, on white.
    legend = np.full((_LINE * len(changed) + _LINE // 2, max(image.shape[1], 18 * _LINE), 3), 255, np.uint8)
    for number, (name, area) in enumerate(pair.areas.items()):
        top = _LINE // 4 + number * _LINE
        legend[top + 4 : top + _LINE - 4, 4:_LINE] = OF_PAIR[name]
        place, text = (_LINE + 8, top + _LINE - 7), f"{name.replace('_', ' ')}: {area:g} m2"
        cv2.putText(legend, text, place, cv2.FONT_HERSHEY_SIMPLEX, _LINE / 44, (0, 0, 0), 1, cv2.LINE_AA)
    sides = [(0, 0), (0, legend.shape[1] - image.shape[1]), (0, 0)]
    return np.concatenate([np.pad(image, sides, constant_values=255), legend])
