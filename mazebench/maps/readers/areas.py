"""Cells laid over the pixels of a map, the connected areas of free ones, and which of them becomes the maze.

`H` and `W` are the numbers of rows and columns of pixels, `R` and `C` of cells.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
import scipy

from mazebench.maps.maze import MAX_SIZE
from mazebench.maps.places import cell_of_place

# Shares of the free cells: of an area that may be the building, and of one that is preferred to the ground around it.
_WORTH_LISTING, _FAIR_SIZE = 0.02, 0.05
_GROUND_EDGE = 0.2  # share of the edge from which an area is ground; a building reaches the edge at its doors
_OPENING = 2.4  # m, the widest door between a building and the ground around it
_MOST_LISTED = 5
_MOST_PHASES = 8  # along an axis
_WORTH_SHIFTING = 1.1  # times the floor of cells from the corner on, for which they begin elsewhere


class Cells(NamedTuple):
    """Cells laid over the pixels of a map."""

    walls: np.ndarray  # [R, C] bool
    pixels: int  # on a side of a cell
    down: int  # pixels above the first row of cells
    right: int  # pixels on the left of the first column


@dataclasses.dataclass(frozen=True, eq=False)
class Area:
    """A connected area of free cells."""

    cells: np.ndarray  # [R, C] bool
    num_cells: int
    edge_share: float  # of the cells at the edge of the map that are in it

    @property
    def is_ground(self) -> bool:
        """True if the area lies around a building, rather than in it."""
        return self.edge_share >= _GROUND_EDGE


class Rim(NamedTuple):
    """The edge of a picture that cells lie over at an angle: pixels as far from it as cells beside it are free."""

    rows: np.ndarray  # [E] int, of the pixels on which the cells are laid; -1 where the edge is blocked
    columns: np.ndarray  # [E] int


class Enclosed(NamedTuple):
    """A free area with walls around it, and where it lies in a grid of cells."""

    row: int  # of the grid that is the first one here; -1 is a row of wall above it
    column: int
    height: int  # in cells, without what makes it square
    width: int
    walls: np.ndarray  # [N, N] bool; N is at most MAX_SIZE + 1, so that a larger area takes no memory


def lay_cells(blocked: np.ndarray, pixels: int, rim: Rim | None) -> Cells:
    """Returns cells of `pixels` x `pixels`, wall where one is blocked or beyond the end.

    They begin at the upper left corner, or where clearly more free cells of the building are left. `rim` is the edge of
    the picture if that is not the edge of `blocked`.
    """
    # The pixels that are the upper left ones of squares in which none is blocked.
    square = np.ones((min(pixels, max(blocked.shape) + 1),) * 2, np.uint8)  # no larger one lies on the map
    free = cv2.erode((~blocked).astype(np.uint8), square, anchor=(0, 0), borderType=cv2.BORDER_CONSTANT, borderValue=0)
    offsets = range(0, pixels, math.ceil(pixels / _MOST_PHASES))
    laid = [
        Cells(free[down::pixels, right::pixels] == 0, pixels, down, right)
        for down, right in itertools.product(offsets, offsets)
    ]
    kept = [_building(areas).num_cells if (areas := areas_of(cells, blocked, rim)) else 0 for cells in laid]
    best = int(np.argmax(kept))
    return laid[best if kept[best] > _WORTH_SHIFTING * kept[0] else 0]


def areas_of(cells: Cells, blocked: np.ndarray, rim: Rim | None) -> list[Area]:
    """Returns the areas that may be the building, by falling size: the largest, and others of a fair share.

    The arguments are those of `lay_cells`.
    """
    labels, _ = scipy.ndimage.label(~cells.walls)
    sizes = np.bincount(labels.ravel(), minlength=1)
    sizes[0] = 0
    if not sizes.any():
        return []
    least = min(_WORTH_LISTING * sizes.sum(), sizes.max())
    numbers = [number for number in np.argsort(-sizes, kind="stable") if sizes[number] >= least]
    if rim is None:
        edge = np.concatenate(
            [
                *_edges(labels, blocked, cells.pixels, cells.down, cells.right),
                *_edges(labels.T, blocked.T, cells.pixels, cells.right, cells.down),
            ]
        )
    else:
        rows, columns = (rim.rows - cells.down) // cells.pixels, (rim.columns - cells.right) // cells.pixels
        is_laid = (rows >= 0) & (rows < len(labels)) & (columns >= 0) & (columns < labels.shape[1])
        edge = np.where(is_laid, labels[rows * is_laid, columns * is_laid], 0)
    return [
        Area(labels == number, int(sizes[number]), float((edge == number).mean())) for number in numbers[:_MOST_LISTED]
    ]


def _edges(labels: np.ndarray, blocked: np.ndarray, pixels: int, down: int, right: int) -> Iterator[np.ndarray]:
    """Yields the labels of the cells to which each pixel of the upper, then of the lower edge leads straight on."""
    num_rows, num_columns = (
        (length - skip) // pixels for length, skip in zip(blocked.shape, (down, right), strict=True)
    )
    last = down + num_rows * pixels
    for row, between in ((0, blocked[:down]), (num_rows - 1, blocked[last:])):
        line = np.zeros(blocked.shape[1], dtype=labels.dtype)
        line[right : right + num_columns * pixels] = labels[row, :num_columns].repeat(pixels)
        yield np.where(between.any(axis=0), 0, line)


def enclose(free: np.ndarray, smallest: int) -> Enclosed:
    """Returns one free area (`[R, C]` bool) in a square of walls of at least `smallest` cells.

    The square has the whole grid, and a row or column more where the area is open. If that is too large for a maze, it
    has the area and the cells around it.
    """
    spans = []
    for axis in (1, 0):
        indices = np.flatnonzero(free.any(axis=axis))
        first, last = int(indices[0]) - 1, int(indices[-1]) + 2
        if max(free.shape) <= MAX_SIZE:
            first, last = min(first, 0), max(last, free.shape[1 - axis])
        spans.append((first, last - first))
    (row, height), (column, width) = spans
    size = min(max(height, width, smallest), MAX_SIZE + 1)
    walls = np.ones((size, size), dtype=bool)
    rows, columns = np.nonzero(free[: row + size, : column + size])
    walls[rows - row, columns - column] = False
    return Enclosed(row, column, height, width, walls)


def choose(areas: list[Area], enclosed: list[Enclosed], place: str | None, cell_size: float) -> tuple[int, bool]:
    """Returns the index of the area that becomes the maze, and whether the place that was asked for is in it."""
    default = areas.index(_building(areas))
    if place is None:
        return default, True
    for number in sorted(range(len(areas)), key=lambda number: number != default):
        walls = enclosed[number].walls
        cell = np.array(cell_of_place(place, len(walls), cell_size))
        if (cell >= 0).all() and (cell < len(walls)).all() and not walls[tuple(cell)]:
            return number, True
    return default, False


def outside_of(free: np.ndarray, beyond: np.ndarray, cell_size: float) -> np.ndarray:
    """Returns the free cells that lie outside of the walls: not behind a door, as seen from beyond the picture.

    Args:
      free: `[R, C]` bool.
      beyond: `[R, C]` bool, cells that the picture does not show; around all cells is more of it.
      cell_size: in metres.
    """
    around = np.pad(beyond, 1, constant_values=True)
    around = cv2.dilate(around.astype(np.uint8), np.ones((3, 3))) > 0
    open_ground = np.pad(free, 1) | around
    far = _OPENING / 2 / cell_size
    wide = cv2.distanceTransform(
        np.pad(open_ground, 1, mode="edge").astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
    )
    core, _ = scipy.ndimage.label((wide[1:-1, 1:-1] > far) | around)
    ground = np.isin(core, core[around])
    near = cv2.distanceTransform((~ground).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) <= far
    return near[1:-1, 1:-1] & free


def _building(areas: list[Area]) -> Area:
    """Returns the largest area, or the largest of a fair size that is not ground."""
    num_cells = sum(area.num_cells for area in areas)
    inside = (area for area in areas if not area.is_ground and area.num_cells >= _FAIR_SIZE * num_cells)
    return next(inside, areas[0])


def describe_areas(areas: list[Area], enclosed: list[Enclosed], number: int, cell_size: float) -> str:
    """Returns the sizes of some areas, of each a cell that chooses it, and which is the maze."""
    parts, taken = [], enclosed[number].walls
    for area, (*_, walls) in zip(areas, enclosed, strict=True):
        common = min(len(walls), len(taken))
        own = ~walls
        own[:common, :common] &= taken[:common, :common] | (walls is taken)
        row, column = np.argwhere(own if own.any() else ~walls)[0]
        where = f"at {100 * area.edge_share:.0f} % of the edge" if area.edge_share else "enclosed"
        parts.append(f"{area.num_cells * cell_size**2:,.5g} m2 with cell {row},{column}, {where}")
    return (
        f"{len(areas)} separate areas ({'; '.join(parts)}); number {number + 1} is the maze, --area chooses by a cell"
    )
