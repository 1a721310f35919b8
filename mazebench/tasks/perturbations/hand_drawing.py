"""A map as it is drawn by hand: a grey picture of 2 N x 2 N pixels.

- A smooth displacement bends the maze, by a share of the width of its doors.
- Each axis is scaled by uniform(0.85, 1.15), where 1.15 fills the picture. The drawing lies anywhere on the picture.
- Walls are drawn up to a pixel thicker or thinner, where a cell is two pixels.
- A pixel has the share of wall in it, to 8 bits. The paper around the maze is wall.
- Marks are displaced as the maze is, and are never inside a wall.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import NamedTuple

import numpy as np

from mazebench.maps.maze import Cell
from mazebench.tasks.perturbations.perturbation import Drawing, Perturbation, ShownMap
from mazebench.tasks.streams import Stream

PIXELS = 2  # pixels of the picture per cell of the maze, along each axis
LARGEST_BEND = 1.5  # m
LARGEST_STRETCH = 0.15  # each axis is scaled by 1 - this to 1 + this
LARGEST_THICKENING = 0.5  # cells, one pixel where a cell is PIXELS of them; negative for thin walls
SIGMA = 3.0  # m; the displacement is white noise on squares of 1 m, smoothed by a Gaussian of this deviation

_REACH = 3 * SIGMA  # m outside of the maze whose noise is still smoothed into it
_SAMPLES = 12  # sample points per cell along each axis that are drawn; more than 5 a pixel at any stretch
_NODES = 4  # points per cell along each axis where the displacement's size and folds are looked at
_ROWS_AT_A_TIME = 8  # of a product of matrices
_WHITE = 255  # the largest of the grey values, which are multiples of 1 / 255


@dataclasses.dataclass(frozen=True)
class HandDrawnMap(Perturbation):
    """Draws the map by hand; the draws are the same for all bends."""

    bend: float  # the largest displacement, in widths of a door, and at most LARGEST_BEND

    stream = Stream.DRAWN_SHEET
    pixels_per_cell = PIXELS

    def shown(self, shown: ShownMap, ends: tuple[Cell, ...], rng: np.random.Generator) -> ShownMap:
        from mazebench.maps.passages import door_width  # which needs numba

        size, cell_size = len(shown.walls), shown.cell_size
        # A drawn or frozen maze has doors of one cell, of 1 m on the tracks.
        door = cell_size if shown.kind else door_width(shown.walls, cell_size)
        displacement = draw_displacement(size, rng, cell_size).scaled(min(self.bend * door, LARGEST_BEND))
        stretch = rng.uniform(1 - LARGEST_STRETCH, 1 + LARGEST_STRETCH, size=2)
        margin = rng.uniform(size=2)
        thickening = float(rng.uniform(-LARGEST_THICKENING, LARGEST_THICKENING))
        share = stretch / (1 + LARGEST_STRETCH)
        drawing = fitted_drawing(size, displacement, share, margin, thickening, cell_size)
        return dataclasses.replace(shown, drawing=drawing)


class Line(NamedTuple):
    """Points at equal distances along an axis of the maze."""

    number: int
    per_cell: int
    offset: float = 0.0  # of the first one, in distances between points
    cell_size: float = 1.0  # m

    def coordinates(self) -> np.ndarray:
        """Returns `[T]` float64, in metres; T is `number`."""
        return (np.arange(self.number) + self.offset) / self.per_cell * self.cell_size


@dataclasses.dataclass(frozen=True)
class Displacement:
    """A smooth displacement of the points of an N x N maze: Gaussian-smoothed white noise (Simard et al. 2003).

    Points here are (down, right) in metres from the maze's upper left corner. `K` is 18 more than the metres on the
    maze's side: the squares of 1 m with noise.
    """

    noise: np.ndarray  # [2, K, K] float64: down and right; square (i, j) has its centre at i - 8.5, j - 8.5
    mean: np.ndarray  # [2] float64, over the maze, in metres; subtracted, for a shift of the whole is no distortion

    def on_grid(self, line: Line) -> np.ndarray:
        """Returns `[2, T, T]` float64: the displacements at all points of `line` x `line`."""
        smooth = _gaussians_on(line, self.noise.shape[-1])
        moved = _weighted(smooth, self.noise, smooth)
        moved -= self.mean[:, None, None]  # in place: a second array of this size would take longer than the products
        return moved

    def at(self, points: np.ndarray) -> np.ndarray:
        """Returns `[T, 2]` float64: the displacements at `points` `[T, 2]`."""
        rows, columns = (_gaussians(coordinate, self.noise.shape[-1]) for coordinate in points.T)
        return np.einsum("ti, kij, tj -> tk", rows, self.noise, columns) - self.mean

    def scaled(self, factor: float) -> Displacement:
        """Returns the displacement times `factor`."""
        return Displacement(factor * self.noise, factor * self.mean)

    def folds(self, nodes: Line) -> bool:
        """Returns whether the displaced picture lies over itself somewhere, or one of its axes runs backwards."""
        count = self.noise.shape[-1]
        smooth = _gaussians_on(nodes, count)
        slope = -(nodes.coordinates()[:, None] - _noise_centres(count)) / SIGMA**2 * smooth

        # By how much each component changes along rows and along columns.
        row_row, column_row = _weighted(slope, self.noise, smooth)
        row_column, column_column = _weighted(smooth, self.noise, slope)
        jacobian = (1 + row_row) * (1 + column_column) - row_column * column_row
        return bool(min(jacobian.min(), 1 + row_row.min(), 1 + column_column.min()) <= 0)


def draw_displacement(size: int, rng: np.random.Generator, cell_size: float = 1.0) -> Displacement:
    """Draws a displacement whose largest value in a maze of `size` cells of `cell_size` m is 1 m.

    It does not fold at the largest bend, so that `rng` gives the same one for all bends. Of 20,000 draws, none folded.
    """
    nodes, count = _nodes(size, cell_size), math.ceil(size * cell_size) + 2 * int(_REACH)
    while True:
        noise = Displacement(rng.standard_normal((2, count, count)), np.zeros(2))
        moved = noise.on_grid(nodes)
        mean = moved.mean(axis=(1, 2))
        largest = np.sqrt(((moved - mean[:, None, None]) ** 2).sum(axis=0)).max()
        displacement = dataclasses.replace(noise, mean=mean).scaled(1 / float(largest))
        if not displacement.scaled(LARGEST_BEND).folds(nodes):
            return displacement


@dataclasses.dataclass(frozen=True)
class HandDrawing(Drawing):
    """A hand drawing of a maze of N x N cells in a picture of P x P pixels, P = 2 N.

    A point (down, right) of the maze, in metres, is displaced, and then drawn at `origin + scale * point`, in pixels.
    """

    pixels_per_cell = PIXELS

    displacement: Displacement
    scale: np.ndarray  # [2] float64, pixels per metre along rows and columns
    origin: np.ndarray  # [2] float64, pixels
    thickening: float  # cells; how much thicker walls are drawn, half of it on each side
    cell_size: float = 1.0  # m

    def picture(self, walls: np.ndarray) -> np.ndarray:
        """Returns `[P, P]` float32: the share of wall in each pixel, a multiple of 1 / 255; bare paper is wall."""
        size, pixels = len(walls), PIXELS * len(walls)
        # How many samples of the maze, and how many of its walls, fall into each pixel.
        samples = Line(_SAMPLES * size, _SAMPLES, 0.5, self.cell_size)
        drawn_at = _moved(samples, self.displacement)
        drawn_at *= self.scale[:, None, None]
        drawn_at += self.origin[:, None, None]
        row, place = np.clip(drawn_at, 0, pixels - 1, out=drawn_at).astype(np.intp)
        row *= pixels
        place += row
        place *= 2
        place += self._thick_walls(walls, samples.coordinates() / self.cell_size)
        free, wall = np.bincount(place.ravel(), minlength=2 * pixels**2).reshape(-1, 2).T
        drawn = free + wall

        # In whole numbers, so that every machine draws the same picture. Paper is `_WHITE` of `_WHITE`.
        grey = np.where(drawn > 0, (2 * _WHITE * wall + drawn) // np.maximum(2 * drawn, 1), _WHITE)
        return (grey / np.float32(_WHITE)).astype(np.float32).reshape(pixels, pixels)

    def pixel(self, cell: Cell, picture: np.ndarray) -> Cell:
        """Returns the pixel of the centre of `cell`; if that is more wall than free, the nearest free one.

        Of several, it is the first in reading order. If no pixel is free, those with the least wall count as free.
        """
        centre = self._drawn(np.array([cell]) + 0.5)[0]
        row, column = np.clip(np.floor(centre), 0, len(picture) - 1).astype(int)
        if picture[row, column] > 0.5:
            free = np.argwhere(picture <= max(0.5, picture.min()))
            row, column = free[np.argmin(((free + 0.5 - centre) ** 2).sum(axis=1))]
        return int(row), int(column)

    def points(self, points: np.ndarray, size: int) -> np.ndarray:
        drawn = self._drawn(np.column_stack([size - points[:, 1], points[:, 0]]))
        return np.column_stack([drawn[:, 1], PIXELS * size - drawn[:, 0]])

    def _drawn(self, points: np.ndarray) -> np.ndarray:  # [T, 2] to [T, 2]: points of the maze in cells to pixels
        points = points * self.cell_size
        return self.origin + self.scale * (points + self.displacement.at(points))

    def _thick_walls(self, walls: np.ndarray, samples: np.ndarray) -> np.ndarray:
        """Returns `[T, T]` bool: which points of `samples` x `samples` (`[T]`, in cells) are drawn as wall.

        A square around the point, as wide as the change, meets a wall (thickened) or nothing but walls (thinned). The
        square is smaller than a cell, so that its corners meet all that it meets.
        """
        half = abs(self.thickening) / 2
        before, after = (np.clip(np.floor(samples + side), 0, len(walls) - 1).astype(np.intp) for side in (-half, half))
        if self.thickening > 0:
            by_rows = walls[before] | walls[after]
            return by_rows[:, before] | by_rows[:, after]
        by_rows = walls[before] & walls[after]
        return by_rows[:, before] & by_rows[:, after]


def fitted_drawing(
    size: int,
    displacement: Displacement,
    share: np.ndarray,
    margin: np.ndarray,
    thickening: float,
    cell_size: float = 1.0,
) -> HandDrawing:
    """Returns a drawing that takes `share` `[2]` of the picture along rows and columns.

    Of the paper that it leaves bare, the share `margin` `[2]` lies above the drawing, and on its left.
    """
    points, pixels = _moved(_nodes(size, cell_size), displacement), PIXELS * size
    first, last = points.min(axis=(1, 2)), points.max(axis=(1, 2))
    scale = share * pixels / (last - first)
    origin = margin * (1 - share) * pixels - scale * first
    return HandDrawing(displacement, scale, origin, thickening, cell_size)


def _moved(line: Line, displacement: Displacement) -> np.ndarray:
    """Returns `[2, T, T]` float64: where all points of `line` x `line` are moved to."""
    moved, coordinates = displacement.on_grid(line), line.coordinates()
    moved[0] += coordinates[:, None]
    moved[1] += coordinates
    return moved


def _nodes(size: int, cell_size: float) -> Line:
    return Line(_NODES * size + 1, _NODES, cell_size=cell_size)


@functools.lru_cache(maxsize=8)  # two for mazes of one size
def _gaussians_on(line: Line, count: int) -> np.ndarray:
    return _gaussians(line.coordinates(), count)


def _gaussians(coordinates: np.ndarray, count: int) -> np.ndarray:
    """Returns `[T, count]` float64: the weight of each square's noise at `coordinates` `[T]` along one axis."""
    return np.exp(-(((coordinates[:, None] - _noise_centres(count)) / SIGMA) ** 2) / 2)


def _weighted(rows: np.ndarray, noise: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Returns `[2, T, T]`: the noise `[2, K, K]` weighted by `[T, K]` along rows and columns.

    It multiplies a few rows at a time: BLAS then starts no threads, which wait where other work keeps the cores busy.
    """
    num_rows, count = rows.shape
    padded = np.zeros((num_rows + -num_rows % _ROWS_AT_A_TIME, count))  # np.pad would take as long as the products
    padded[:num_rows] = rows
    by_rows = padded.reshape(-1, _ROWS_AT_A_TIME, count) @ noise[:, None]
    return (by_rows @ columns.T).reshape(2, len(padded), len(columns))[:, :num_rows]


def _noise_centres(count: int) -> np.ndarray:
    return np.arange(count) - _REACH + 0.5
