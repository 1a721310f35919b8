"""Exact any-angle shortest paths of a disc in a maze: the `l` of SPL (Anderson et al. 2018).

A taut path is made of straight pieces and of arcs of the disc's radius about corners of walls that stick out into free
space: it is a path in the tangent graph (Liu and Arimoto 1992). Such a corner has one wall among its four cells: with
two in a row the wall is flat there, with two on the diagonal or three the free cells see only concave angles. It
carries a circle that a path can touch only in the quadrant opposite to the wall. The disc fits everywhere on that
quadrant, because all other walls are a cell away.

Lengths are in cells here, except those that `DiscPaths` takes and returns. Lattice points are (x, y), with walls
indexed `[x, y]`. `K` is the number of circles, `P` of straight pieces and `S` of segments tested together.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterator
from typing import NamedTuple, TypeVar

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse import csgraph

from mazebench.maps.maze import Cell, Maze
from mazebench.maps.sight import clear_segments, taut_pairs

# Cells (radians in a component of a unit vector) by which a contact may miss; rounding errors are below 1e-12.
_TOLERANCE = 1e-9
_PAIRS_AT_ONCE = 2**18  # so that temporary arrays take some ten megabytes
_LARGEST_WHOLE = 127  # cells a side of mazes whose paths are all found at once


def length_between(maze: Maze, radius: float, start: Cell, goal: Cell) -> float:
    """Returns the metres of a shortest path of a disc from the middle of a cell to a goal cell.

    In a large maze, only the cells are searched that the path can pass. It is no longer than one from cell to cell, so
    that they lie in an ellipse about start and goal.

    Args:
      radius: of the disc, in metres.
    """
    if maze.size <= _LARGEST_WHOLE:
        return _whole(maze, radius).length(maze.point(start), goal)
    cells = np.indices(maze.walls.shape)
    to_start, to_goal = (np.hypot(cells[0] - row, cells[1] - column) for row, column in (start, goal))
    is_near = to_start + to_goal <= maze.distance(start, goal) + 2 * math.sqrt(2)  # with a cell's extent at both ends

    # What the path can't pass is wall, and so are cells that only a way around leads to.
    components, _ = ndimage.label(~maze.walls & is_near)
    part = dataclasses.replace(maze, walls=components != components[start])
    return DiscPaths(part, radius).length(maze.point(start), goal)


class _Circles(NamedTuple):
    """Circles that a path may touch from outside; a point is a circle of radius 0."""

    centre: np.ndarray  # [K, 2] float
    quadrant: np.ndarray  # [K, 2] float, signs (x, y) of the exposed normals; (0, 0) allows every normal
    radius: np.ndarray  # [K] float


class _Pieces(NamedTuple):
    """Straight pieces of paths, each between two contacts."""

    circle: np.ndarray  # [P, 2] int, the circles that the two ends touch
    offset: np.ndarray  # [P, 2] float, along each circle, anticlockwise from the middle of its quadrant
    end: np.ndarray  # [P, 2, 2] float, the two ends (x, y)


_Table = TypeVar("_Table", _Circles, _Pieces)


class _Side(NamedTuple):
    """The free part of a side of a cell: x is `level` and y from `low` to `high`, or the other way round."""

    axis: int  # 0 if x is constant along the side, 1 if y is
    level: float
    low: float
    high: float


class DiscPaths:
    """Shortest paths of a disc of one radius in one maze.

    A path is a curve of the disc's centre that stays at least `radius` away from every wall and ends as soon as it is
    in the closed goal cell. The pieces between the maze's own corners are found once, here; each query adds those that
    touch the start or the goal. Time and memory grow with the number of pairs of corners that see each other.

    Args:
      radius: metres, above 0 and below half a cell.
    """

    def __init__(self, maze: Maze, radius: float):
        self._maze = maze
        self._radius = float(radius) / maze.cell_size
        self._walls = maze.walls[::-1].T  # [x, y]
        self._corners = _exposed_corners(self._walls, self._radius)

        # [x, y]: whether one of the four cells at a lattice point is a wall.
        padded = np.pad(self._walls, 1, constant_values=True)
        left_or_right, upper_or_lower = padded[:-1] | padded[1:], padded[:, :-1] | padded[:, 1:]
        self._is_near_wall = left_or_right[:, :-1] | left_or_right[:, 1:]
        # [2, x, y], for flat and, with the axes exchanged, for steep segments: whether a wall is at the lattice point
        # (x, y), and whether one is left or right of the line from there to (x, y + 1).
        self._has_corner = np.stack([self._is_near_wall, self._is_near_wall.T])
        self._has_edge = np.stack([left_or_right[:, 1:], upper_or_lower[1:].T])

        # The tangents that no wall cuts: of circles whose quadrants share a normal and, between two circles, of those
        # that have opposite normals.
        points, normals = (array.astype(np.int64) for array in self._corners[:2])
        pairs = np.stack(taut_pairs(self._walls, points, normals))
        num_batches = pairs.shape[1] // _PAIRS_AT_ONCE + 1
        agreement = (normals[pairs[0]] * normals[pairs[1]]).sum(axis=1)
        self._pieces = _concatenate(
            [
                self._clear(_tangents(self._corners, first, second, side))
                for side in (1, -1)
                for first, second in np.array_split(pairs[:, side * agreement >= 0], num_batches, axis=1)
            ]
        )

    def length(self, start: np.ndarray, goal: Cell) -> float:
        """Returns the metres from `start` to a free goal cell; 0 if `start` is in it.

        Args:
          start: `[2]` m, the disc's centre, at least the radius away from every wall.
          goal: row and column.
        """
        start = start / self._maze.cell_size
        corner = np.array([goal[1], self._maze.size - 1 - goal[0]])  # the lower left one
        if ((corner <= start) & (start <= corner + 1)).all():
            return 0.0
        pieces = _concatenate([self._pieces, self._clear(self._query_pieces(start, corner))])

        # The corners' circles come first, then the start; all beyond are points where a path may end.
        circle, source = pieces.circle.ravel(), len(self._corners.radius)
        distances = csgraph.dijkstra(_graph(pieces), indices=int(np.argmax(circle == source)))
        return self._maze.cell_size * float(distances[circle > source].min())

    def _clear(self, pieces: _Pieces) -> _Pieces:
        """Returns those of some pieces that no wall cuts."""
        clearance = self._radius - min(_TOLERANCE, self._radius / 2)
        keep = clear_segments(self._has_corner, self._has_edge, pieces.end, self._radius, clearance)
        return _Pieces(*(array[keep] for array in pieces))

    def _query_pieces(self, start: np.ndarray, corner: np.ndarray) -> _Pieces:
        """Returns straight pieces from the start to the circles and from both to the goal, not tested for walls.

        The last piece meets a side of the goal cell at a right angle, or at a corner that is in the open: near a corner
        of a wall, the disc can be on the side up to where the wall's circle meets it, and it does so at a right angle.
        """
        source = len(self._corners.radius)
        corners = corner + np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
        in_open = corners[~self._is_near_wall[tuple(corners.T)]]  # those that touch no wall
        circles = _concatenate([self._corners, _points(start[None]), _points(in_open)])

        # From the circles and the start to a side of the goal cell, where each piece ends at a point of its own.
        to_side = _concatenate([_perpendiculars(circles, source + 1, side) for side in self._sides(corner)])
        to_side.circle[:, 1] += np.arange(len(to_side.circle))

        # From the start to the circles.
        corners = np.arange(source)
        from_start = _tangents(circles, np.full_like(corners, source), corners, side=1)

        # From the circles and the start to the corners of the goal cell.
        first, last = np.meshgrid(np.arange(source + 1), np.arange(source + 1, len(circles.radius)))
        to_corner = _tangents(circles, first.ravel(), last.ravel(), side=1)
        return _concatenate([from_start, to_corner, to_side])

    def _sides(self, corner: np.ndarray) -> Iterator[_Side]:
        """Yields the sides that a cell (lower left corner `[2]`) shares with a free cell, without what is too near."""
        for axis, step in np.ndindex(2, 2):
            across, along = np.eye(2, dtype=np.int64)[[axis, 1 - axis]]
            first = corner + step * across
            if self._walls[tuple(corner + (2 * step - 1) * across)]:
                continue
            before, after = (self._radius * self._is_near_wall[tuple(point)] for point in (first, first + along))
            low, high = first[1 - axis] + before, first[1 - axis] + 1 - after
            yield _Side(axis, level=first[axis], low=low, high=high)


def _exposed_corners(walls: np.ndarray, radius: float) -> _Circles:
    """Returns the circles about all lattice points that touch exactly one wall (`walls` is `[x, y]`)."""
    count = walls.astype(np.int64)
    lower_left, lower_right = count[:-1, :-1], count[1:, :-1]  # of each lattice point
    upper_left, upper_right = count[:-1, 1:], count[1:, 1:]
    left, right = lower_left + upper_left, lower_right + upper_right
    below, above = lower_left + lower_right, upper_left + upper_right
    exposed = left + right == 1
    away_from_wall = np.stack([left - right, below - above], axis=-1)
    centre = np.argwhere(exposed) + 1.0
    return _Circles(centre, away_from_wall[exposed].astype(np.float64), np.full(len(centre), radius))


def _points(points: np.ndarray) -> _Circles:
    return _Circles(points, np.zeros_like(points, dtype=np.float64), np.zeros(len(points)))


def _tangents(circles: _Circles, first: np.ndarray, second: np.ndarray, side: int) -> _Pieces:
    """Returns the common tangents of pairs of circles that touch both in their exposed quadrants, not tested for walls.

    `side` is 1 for tangents that have both circles on one side, -1 for those that pass between them. With normal n at
    the first circle and side * n at the second, D . n = r1 - side * r2, where D joins the centres.
    """
    # The unit vectors along the line of centres, and to its left.
    joint = circles.centre[second] - circles.centre[first]
    distance = np.hypot(joint[:, 0], joint[:, 1])
    unit = joint / distance[:, None]
    left = np.stack([-unit[:, 1], unit[:, 0]], axis=1)

    # The normals' components along the two.
    along = ((circles.radius[first] - side * circles.radius[second]) / distance)[:, None]
    across = np.sqrt(np.maximum(1 - along * along, 0))

    # Of the two tangents of a pair, those with normals in the exposed quadrants.
    found = []
    for turn in (1, -1):
        normal = along * unit + turn * across * left
        fits = np.all(normal * circles.quadrant[first] >= -_TOLERANCE, axis=1)
        fits &= np.all(side * normal * circles.quadrant[second] >= -_TOLERANCE, axis=1)
        circle = np.stack([first[fits], second[fits]], axis=1)
        normals = np.stack([normal[fits], side * normal[fits]], axis=1)
        end = circles.centre[circle] + circles.radius[circle][..., None] * normals
        found.append(_Pieces(circle=circle, offset=_offset(circles, circle, normals), end=end))
    return _concatenate(found)


def _perpendiculars(circles: _Circles, num_sources: int, side: _Side) -> _Pieces:
    """Returns tangents of the first `num_sources` circles that meet a side at a right angle.

    Where an arc itself ends on the side, its piece has length 0.
    """
    # Where the tangents touch the circles.
    normal = (circles.quadrant * np.eye(2)[1 - side.axis])[:num_sources]
    contact = circles.centre[:num_sources] + circles.radius[:num_sources, None] * normal

    # Those that meet the side, and where they do.
    height = contact[:, 1 - side.axis]
    source = np.flatnonzero((height >= side.low - _TOLERANCE) & (height <= side.high + _TOLERANCE))
    end = contact[source, None].repeat(2, axis=1)
    end[:, 1, side.axis] = side.level
    offset = np.stack([_offset(circles, source, normal[source]), np.zeros(len(source))], axis=1)
    circle = np.stack([source, np.full_like(source, len(circles.radius))], axis=1)
    return _Pieces(circle=circle, offset=offset, end=end)


def _offset(circles: _Circles, index: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Returns lengths along circles `[...]` from the middle of their quadrant to the normals `[..., 2]`: `[...]`."""
    x, y = np.moveaxis(circles.quadrant[index], -1, 0)
    angle = np.arctan2(x * normal[..., 1] - y * normal[..., 0], x * normal[..., 0] + y * normal[..., 1])
    return circles.radius[index] * angle


def _graph(pieces: _Pieces) -> sparse.csr_array:
    """Returns the graph of the ends of all pieces, `[2 P, 2 P]`.

    Ends are joined along their piece and, on each circle, to the next end either way.
    """
    circle, offset = pieces.circle.ravel(), pieces.offset.ravel()
    num_nodes = len(circle)

    # Neighbours on a circle. An offset is at most pi / 4 * 0.5 cells, so the sum sorts by circle first.
    order = np.argsort(circle + offset)
    joined = circle[order[1:]] == circle[order[:-1]]
    before, after = order[:-1][joined], order[1:][joined]
    arc = np.abs(offset[after] - offset[before])

    # The two ends of each piece, whose indices differ in the last bit.
    nodes = np.arange(num_nodes)
    straight = np.hypot(*(pieces.end[:, 1] - pieces.end[:, 0]).T).repeat(2)
    row = np.concatenate([nodes, before, after])
    column = np.concatenate([nodes ^ 1, after, before])
    length = np.concatenate([straight, arc, arc])
    return sparse.csr_array((length, (row, column)), shape=(num_nodes, num_nodes))


def _concatenate(parts: list[_Table]) -> _Table:
    return type(parts[0])(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


_whole = functools.lru_cache(maxsize=2)(DiscPaths)
