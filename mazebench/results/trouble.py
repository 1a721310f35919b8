"""Trouble spots: the places of an old map at which it costs the most metres.

`E` is the number of trips, `N` the number of cells on a side of a maze.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.ndimage
import scipy.spatial
from scipy.sparse.csgraph import connected_components

from mazebench.maps.maze import Cell, path_through_walls
from mazebench.maps.older_map import OlderMap
from mazebench.maps.readers.occupancy_grid import points_from
from mazebench.maps.search import search
from mazebench.results.records import Record

# What a place is now: a wall on the way of the map, free where the map has a wall, or where trips leave the right way.
CLOSED, OPENED, DETOUR = "closed", "open", "detour"
LEAST = 0.5  # m that a trip loses, from which on a place is looked for
_NEAR = 1.0  # m; places that are no farther apart are one, and so are ways
_SMALL = 3.0  # m, the longer side of a change that is one place, such as a closed passage


class Spot(NamedTuple):
    """A place at which the old map and the building differ, on the ways of some trips."""

    maze: str
    point: tuple[float, float]  # x, y (m) in the frame of the old map
    cell: tuple[float, float]  # row and column in the maze, in the middle of the places of its trips
    kind: str  # CLOSED, OPENED or DETOUR
    trips: tuple[int, ...]  # numbers of the trips whose way leads through it, the one that loses most first
    metres: float  # that they lose together


class _Place(NamedTuple):
    """A crossing of a trip's way and walls of the other map."""

    cell: Cell  # of these walls, the middle one on the way
    kind: str
    around: float = math.inf  # cells, by which the way around is longer


def find_spots(
    records: Sequence[Record],
    lost: np.ndarray,
    older: Sequence[OlderMap],
    drives: Sequence[tuple[np.ndarray, np.ndarray]],
) -> list[Spot]:
    """Returns the trouble spots of trips, the one with the most metres first.

    A trip loses its metres at one place: of all walls on the shortest way of the old map, and of all walls of the old
    map on the shortest way of the building, at those which take the longest way around. If none takes a metre, it is
    where the trip leaves the way that it takes with the right map, before it is farthest from it.

    Args:
      records: of the trips with the old map.
      lost: `[E]` m, more than with the right map.
      older: the old map of each maze.
      drives: of each trip, the points (x, y) that were driven in the maze with the old map and with the right one:
        `[L, 2]` m.
    """
    places: dict[str, dict[int, _Place]] = {}  # by maze and number of the trip
    maps = {each.maze.name: each for each in older}
    for number, record in enumerate(records):
        maze = maps[record.maze].maze
        found = _places(maps[record.maze], record.start, record.goal)
        place = max(found, key=lambda each: each.around, default=None)
        if lost[number] >= LEAST and (place is None or place.around * maze.cell_size < _NEAR):
            row, column = maze.cell(_parting(*drives[number])).tolist()
            place = _Place((row, column), DETOUR)
        if place is not None:
            places.setdefault(record.maze, {})[number] = place
    spots = [spot for maze, own in places.items() for spot in _joined(maps[maze], own, lost)]
    return sorted(spots, key=lambda spot: -spot.metres)


def _joined(older: OlderMap, places: dict[int, _Place], lost: np.ndarray) -> list[Spot]:
    """Returns the spots of the trips of one maze: places of a kind that are near, or in one small change, are one."""
    maze, trips = older.maze, list(places)
    changes, _ = scipy.ndimage.label(older.walls != maze.walls, np.ones((3, 3)))
    boxes = scipy.ndimage.find_objects(changes)
    sides = [max(rows.stop - rows.start, columns.stop - columns.start) for rows, columns in boxes]
    is_small = np.array([False, *(side * maze.cell_size <= _SMALL for side in sides)])
    cells = np.array([places[trip].cell for trip in trips])
    kinds, change = np.array([places[trip].kind for trip in trips]), changes[tuple(cells.T)]
    is_near = (scipy.spatial.distance.cdist(cells, cells) - 1) * maze.cell_size <= _NEAR  # between their sides
    is_one = is_near | ((change[:, None] == change) & is_small[change])
    num_spots, spot_of = connected_components(is_one & (kinds[:, None] == kinds))
    spots = []
    for spot in range(num_spots):
        chosen = np.flatnonzero(spot_of == spot)
        own = sorted((trips[index] for index in chosen), key=lambda trip: -lost[trip])
        row, column = cells[chosen].mean(axis=0).tolist()
        x, y = points_from(older.origin, *maze.point(np.array([row, column])).tolist())
        metres = float(lost[own].sum())
        spots.append(Spot(maze.name, (float(x), float(y)), (row, column), places[own[0]].kind, tuple(own), metres))
    return spots


def _parting(driven: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Returns the last point (x, y) of a drive that is near another one, before the point that is farthest from it."""
    gaps, _ = scipy.spatial.cKDTree(right).query(driven)
    near = np.flatnonzero(gaps[: gaps.argmax() + 1] <= _NEAR)  # both begin in one place
    return np.asarray(driven[near[-1]])


def _places(older: OlderMap, start: Cell, goal: Cell) -> list[_Place]:
    """Returns where the map's shortest way meets walls of the maze, and where the maze's way meets those of the map."""
    found = []
    on_map, in_maze = (path_through_walls(walls, start, goal) for walls in (older.walls, older.maze.walls))
    saved = len(on_map) - len(in_maze)  # cells, at most, by what is open now
    for kind, way, other in ((CLOSED, on_map, older.maze.walls), (OPENED, in_maze, older.walls)):
        is_wall = other[tuple(np.array(way).T)]
        edges = np.flatnonzero(np.diff(is_wall))  # both ends are free on both maps
        for before, last in edges.reshape(-1, 2).tolist():
            around = _num_steps(other, way[before], way[last + 1]) - (last + 1 - before)
            if kind == OPENED:
                around = min(around, saved)
            if kind == CLOSED or around > 0:
                found.append(_Place(way[(before + 1 + last) // 2], kind, around))
    return found


def _num_steps(walls: np.ndarray, start: Cell, goal: Cell) -> float:
    """Returns the cells of a shortest way, infinite if there is none."""
    last = goal[0] * len(walls) + goal[1]
    cells, ends = search(walls, start[0] * len(walls) + start[1], last, walls.size)
    return len(ends) - 1 if last in cells[ends[-2] if len(ends) > 1 else 0 :] else math.inf
