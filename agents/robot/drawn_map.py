"""Registers a map that is drawn by hand with the cells of a maze, and reads off which cells are walls.

The point of the maze at a pixel is affine in the pixel plus a Gaussian random field, in the field's main modes
(Karhunen-Loeve expansion). The parameters, the walls' thickness and the walls are estimated in turns:

- `compare` finds how grey pixels should be, blurred by the uncertainty of their points. So far from what is known
  nothing is compared, and the registration grows from the outline inwards.
- The probability of each cell to be a wall is updated by mean field.
- A Gauss-Newton step moves the points and changes the thickness (Lucas and Kanade 1981; Amit et al. 1991 for the prior
  of modes).

A guess of how far points are displaced, such as a network's, may be the start and the prior instead of no displacement.

Points are (row, column) in cells, with the maze's corners at 0 and N. `P` x `Q` are the pixels around the drawing, `D`
the parameters of an axis.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from typing import NamedTuple

import numpy as np
from scipy import special

from mazebench.maps.maze import Cell

from .drawing import compare, widths_of_pixels
from .gauss_newton import inverse, normal_equations, variances

GUESSED_SIZE = 31  # cells of 1 m on a side of the mazes for whose drawings a network ships that guesses their bends

_SMOOTHNESS = 4.2  # cells, deviation of the Gaussian by which displacements of two points are correlated
_DISPLACEMENT = 0.6  # cells, deviation
_NUM_MODES, _NUM_MODES_GUESSED = 24, 64  # without and with a guess
_MODES_PER_AXIS = {_NUM_MODES: 9, _NUM_MODES_GUESSED: 13}
_AFFINE = 1.0  # cells, deviation of what is off at first in the middle, and at the edges for the wrong scale
_THICKENING = 0.3  # cells, deviation
_LARGEST_THICKENING = 0.6  # cells

_WALL = 0.4  # prior probability of a wall
_LARGEST_LOG_ODDS = 30.0
_DAMPING = 0.5  # share of the new log odds in an update; all at once, neighbours would go back and forth

_ROWS = 64  # of a product of up to 140 columns
_LARGEST_STEP = 0.5  # cells that a point is moved at once
_WIDTHS = (0.2, 3.0)  # cells, the smallest and the largest side of a box
_NODES = 4  # per cell, at which modes are computed

_SHARP = 0.05  # root mean square difference of picture and expectation, below which a registration is right
_ERROR = 0.002  # probability that a cell is misread where the registration is right
_ERROR_SLOPE = 4.0  # by how much that grows with the difference of picture and expectation beyond `_SHARP`
_LARGEST_ERROR = 0.3
_CENTRE = 0.1  # pixels, smallest deviation of where a cell's centre is drawn
_FARTHEST_MARK = 4.0  # pixels from the centre of the cell that it marks
_UNEXPLAINED_MARK = 1e-3  # weight of cells that a marker should not mark, at no distance from it
# [25, 2] deviates of two normal variables, each of the same probability
_QUANTILES = np.array(list(itertools.product(special.ndtri(np.arange(0.1, 1, 0.2)), repeat=2)))


def _schedule(first: float, last: float, num_steps: int, blur: float) -> list[tuple[float, float]]:
    """Returns the coarseness of each step.

    It is the standard deviation of grey values, and by how much the variance of points is overestimated, 0 for no blur.
    """
    coarse = [(noise, blur) for noise in np.geomspace(first, last, num_steps).tolist()]
    return [*coarse, (0.15, 1.0), (0.12, 0.5), (0.1, 0.2), (0.08, 0.0), (0.08, 0.0), (0.08, 0.0)]


_RIGID_STEPS = 3  # before walls are estimated
# Tried in turn until a registration is right; the first is the fastest.
_SCHEDULES = (_schedule(0.8, 0.2, 12, 2.0), _schedule(0.8, 0.2, 24, 2.5), _schedule(0.5, 0.25, 24, 1.5))
_SCHEDULE_GUESSED = _schedule(0.3, 0.2, 8, 1.0)
_LEAST_VARIANCE = 0.02  # of a guess, cells squared
_ALIKE = 5.0  # places of a guess whose errors are about the same


@dataclasses.dataclass(frozen=True)
class Registration:
    """The places in a maze of a picture's pixels, and its walls."""

    walls: np.ndarray  # [N, N] float, the probability that a cell is a wall
    picture: np.ndarray  # [P, Q] float, the part of the picture around the drawing
    points: np.ndarray  # [P, Q, 2] float, at the pixels' centres
    deviations: np.ndarray  # [P, Q, 2] float, of the points along rows and columns, in cells
    corner: Cell  # pixel of the whole picture at which the part begins
    residual: float  # root mean square difference of picture and expectation

    def marked(self, pixel: Cell) -> np.ndarray:
        """Returns `[N, N]` float: the probability of `pixel` of the picture to be marked if a cell is.

        A cell is marked by the pixel in which its centre lies, or if that is a wall, by the nearest free pixel.
        """
        # Where the cells' centres are drawn, and the deviations of that, in pixels; pixel (0, 0) has its centre at 0.
        # The nearest pixel's point is corrected by the derivatives there.
        size, width = len(self.walls), self.points.shape[1]
        centres = np.moveaxis(np.indices((size, size)), 0, -1).reshape(-1, 2) + 0.5
        points = self.points.reshape(-1, 2)
        nearest = ((centres[:, None] - points) ** 2).sum(axis=-1).argmin(axis=1)
        jacobians = np.stack(np.gradient(self.points, axis=(0, 1)), axis=-1).reshape(-1, 2, 2)[nearest]
        correction = np.linalg.solve(jacobians, (centres - points[nearest])[:, :, None])[:, :, 0]
        drawn = np.column_stack(np.divmod(nearest, width)) + correction  # [N * N, 2]
        deviations = self.deviations.reshape(-1, 2)[nearest] / np.abs(np.diagonal(jacobians, axis1=1, axis2=2))
        deviations = np.maximum(deviations, _CENTRE)

        # Places at which the centres near the pixel may be drawn, and the pixels that mark these.
        mark = np.clip(np.subtract(pixel, self.corner), 0, np.subtract(self.picture.shape, 1))
        off = np.sqrt(((drawn - mark) ** 2).sum(axis=-1))
        near = off < _FARTHEST_MARK
        places = drawn[near][:, None] + _QUANTILES * deviations[near][:, None]
        marks = np.clip(np.rint(places), 0, np.subtract(self.picture.shape, 1)).astype(np.intp)
        in_wall = self.picture[marks[..., 0], marks[..., 1]] > 0.5
        if in_wall.any():
            free = np.argwhere(self.picture <= max(0.5, self.picture.min()))
            marks[in_wall] = free[((places[in_wall][:, None] - free) ** 2).sum(axis=-1).argmin(axis=1)]

        # The share of a cell's places that the pixel marks.
        marked = _UNEXPLAINED_MARK * np.exp(-(off**2) / 2)
        marked[near] += (marks == mark).all(axis=-1).mean(axis=-1)
        return marked.reshape(size, size)


class Guess(NamedTuple):
    """By how much points may be displaced, before a picture is registered. `T` is the number of places along an axis.

    A place is where a point is drawn if nothing is displaced, in cells.
    """

    places: np.ndarray  # [T] float
    bends: np.ndarray  # [2, T, T] float, along rows and along columns, in cells
    scales: np.ndarray  # [2, T, T] float, of Laplace's distribution of their errors, in cells


def register(picture: np.ndarray, size: int, guess: Guess | None = None) -> Registration:
    """Returns the registration of `picture`, `[M, M]` shares of wall, with a maze of `size` cells a side."""
    picture = picture.astype(np.float64)
    if guess is not None:
        fit = _Fit(picture, size, _NUM_MODES_GUESSED)
        fit.begin_at(guess)
        return fit.run(_SCHEDULE_GUESSED)
    found: list[Registration] = []
    for schedule in _SCHEDULES:
        found.append(_Fit(picture, size, _NUM_MODES).run(schedule))
        if found[-1].residual < _SHARP:
            break
    return min(found, key=lambda registration: registration.residual)


class _Fit:
    """A registration under way."""

    def __init__(self, picture: np.ndarray, size: int, num_modes: int):
        """Lays the maze's inner cells on the box around what is free in the picture."""
        # Log odds of walls, by the prior and now.
        self.prior = np.minimum(special.logit(with_border(np.full((size, size), _WALL))), _LARGEST_LOG_ODDS)  # [N, N]
        self.log_odds = self.prior  # [N, N]

        # The box around what is free, and two pixels more.
        crops, coordinates = [], []
        for (first, last), length in zip(drawing_box(picture), picture.shape, strict=True):
            crop = np.arange(max(first - 2, 0), min(last + 3, length))
            crops.append(crop)
            coordinates.append(1 + (crop + 0.5 - first) * (size - 2) / (last + 1 - first))
        self.picture = picture[np.ix_(*crops)]  # [P, Q]
        self.corner = (int(crops[0][0]), int(crops[1][0]))
        self.nominal = np.stack(np.meshgrid(*coordinates, indexing="ij"), axis=-1)  # [P, Q, 2], at parameters of 0

        # Parameters: of rows, of columns, thickening.
        self.size, self.num_modes = size, num_modes
        self.basis = _basis(coordinates[0], coordinates[1], size, num_modes)
        precision = np.ones(2 * self.basis.shape[-1] + 1)
        precision[-1] = 1 / _THICKENING**2
        self.precision, self.mean = np.diag(precision), np.zeros(len(precision))  # of the prior
        self.parameters = self.mean
        self.covariance, self.inverse = np.diag(1 / precision), np.linalg.inv

    def begin_at(self, guess: Guess) -> None:
        """Begins at a guess, which is the prior from now on."""
        basis = _basis(guess.places, guess.places, self.size, self.num_modes)
        deviations, gradient = np.sqrt(_ALIKE * (2 * guess.scales**2 + _LEAST_VARIANCE)), np.zeros(len(self.mean))
        for axis, along in enumerate(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))):
            slopes = np.broadcast_to(along, (*guess.bends[axis].shape, 3))
            sums = normal_equations(basis, slopes.copy(), guess.bends[axis], deviations[axis])
            self.precision, gradient = self.precision + sums[0], gradient + sums[1]
        self.inverse = inverse  # LAPACK would start threads for so many parameters
        self.covariance = inverse(self.precision)
        self.parameters = self.mean = _product(self.covariance, gradient)

    def run(self, schedule: list[tuple[float, float]]) -> Registration:
        """Returns the registration after all steps of a schedule."""
        for step, (noise, blur) in enumerate(schedule):
            differences = self._step(noise, blur, step >= _RIGID_STEPS)
        residual = float(np.sqrt((differences**2).mean()))
        error = min(_ERROR + _ERROR_SLOPE * max(residual - _SHARP, 0.0), _LARGEST_ERROR)
        walls = (1 - error) * special.expit(self.log_odds) + error * special.expit(self.prior)
        return Registration(
            walls=with_border(walls),
            picture=self.picture,
            points=self.points(),
            deviations=np.sqrt(self._variances()),
            corner=self.corner,
            residual=residual,
        )

    def points(self) -> np.ndarray:
        """Returns `[P, Q, 2]` float: the points at the pixels' centres."""
        return self.nominal + self._shifts(self.parameters)

    def _shifts(self, parameters: np.ndarray) -> np.ndarray:
        """Returns `[P, Q, 2]` float: by how much parameters `[2 D + 1]` move the points."""
        shifts = np.einsum("apd, ad -> pa", self.basis, parameters[:-1].reshape(2, -1))
        return shifts.reshape(self.nominal.shape)

    def _variances(self) -> np.ndarray:
        """Returns `[P, Q, 2]` float: the variances of the points along rows and columns."""
        return variances(self.basis, self.covariance).reshape(self.nominal.shape)

    def _step(self, noise: float, blur: float, walls_too: bool) -> np.ndarray:
        """Improves walls and parameters; returns `[P, Q]`, the differences of picture and expectation before."""
        # The box that each pixel covers.
        points = self.points()
        widths = widths_of_pixels(points, _WIDTHS[0])
        if blur:
            # A box as wide as one whose variance is that of the pixel's box and the point together.
            widths = np.sqrt(widths**2 + 12 * blur * self._variances())
        widths = np.minimum(widths, _WIDTHS[1])

        # Walls by mean field.
        walls, thickening = special.expit(self.log_odds), float(self.parameters[-1])
        differences, slopes, deviations, evidence = compare(self.picture, points, widths, thickening, walls, noise)
        if walls_too:
            log_odds = self.log_odds + _DAMPING * (self.prior + evidence - self.log_odds)
            self.log_odds = np.clip(log_odds, -_LARGEST_LOG_ODDS, _LARGEST_LOG_ODDS)

        # Parameters by Gauss-Newton.
        hessian, gradient = normal_equations(self.basis, slopes, differences, deviations)
        hessian += self.precision
        gradient -= _product(self.precision, self.parameters - self.mean)
        self.covariance = self.inverse(hessian)
        step = _product(self.covariance, gradient)
        largest = np.abs(self._shifts(step)).max()
        self.parameters = self.parameters + step * min(1.0, _LARGEST_STEP / max(largest, 1e-9))
        self.parameters[-1] = np.clip(self.parameters[-1], -_LARGEST_THICKENING, _LARGEST_THICKENING)
        return differences


def _product(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Returns `[D]`: a matrix `[D, D]` times a vector, a few rows at a time; for more, BLAS would start threads."""
    return np.concatenate([matrix[row : row + _ROWS] @ vector for row in range(0, len(matrix), _ROWS)])


def drawing_box(picture: np.ndarray) -> list[np.ndarray]:
    """Returns the first and the last pixel, `[2]` int, in which `picture` is free, along rows and along columns."""
    free = picture < max(0.5, picture.min() + 0.1)
    return [np.flatnonzero(free.any(axis=1 - axis))[[0, -1]] for axis in (0, 1)]


def with_border(walls: np.ndarray) -> np.ndarray:
    """Returns `walls` `[N, N]` with 1 at the border, in place."""
    walls[[0, -1]] = walls[:, [0, -1]] = 1.0
    return walls


def _basis(rows: np.ndarray, columns: np.ndarray, size: int, num_modes: int) -> np.ndarray:
    """Returns `[2, P Q, D]`: by how much each parameter moves the points at `rows` `[P]` x `columns` `[Q]`, in cells.

    The first two parameters of an axis are a shift and a scale, the others weigh the modes of the field.
    """
    along_rows, along_columns = (_modes_at(each, size, num_modes) for each in (rows, columns))
    *_, first, second = _modes(size, num_modes)
    modes = along_rows[:, None, first] * along_columns[None, :, second]
    basis = np.empty((2, len(rows) * len(columns), 2 + num_modes))
    basis[:, :, 0] = _AFFINE
    basis[0, :, 1] = _AFFINE * np.repeat(2 * rows / size - 1, len(columns))
    basis[1, :, 1] = _AFFINE * np.tile(2 * columns / size - 1, len(rows))
    basis[:, :, 2:] = _DISPLACEMENT * modes.reshape(-1, num_modes)
    return basis


def _modes_at(coordinates: np.ndarray, size: int, num_modes: int) -> np.ndarray:
    """Returns `[T, A]`: the modes of a Gaussian process on [0, N], times their deviations, at `coordinates` `[T]`.

    By the method of Nystroem from the modes at nodes; constant from 1.5 cells outside on.
    """
    nodes, weights, _, _ = _modes(size, num_modes)
    return _correlation(np.clip(coordinates, -1.5, size + 1.5), nodes) @ weights


@functools.lru_cache
def _modes(size: int, num_modes: int) -> tuple[np.ndarray, ...]:
    """Returns nodes `[T]` on [0, N], and the weights at them of `A` modes of an axis, `[T, A]`.

    Then follow the modes along rows and along columns whose products have the largest variances, `[num_modes]` each.
    """
    num_per_axis = _MODES_PER_AXIS[num_modes]
    nodes = np.linspace(0, size, _NODES * size + 1)
    lengths = np.full(len(nodes), 1 / _NODES)
    lengths[[0, -1]] /= 2
    root = np.sqrt(lengths)
    variances, vectors = np.linalg.eigh(root[:, None] * _correlation(nodes, nodes) * root)
    variances, vectors = variances[::-1][:num_per_axis], vectors[:, ::-1][:, :num_per_axis]
    products = np.outer(variances, variances)
    main = np.unravel_index(np.argsort(-products, axis=None)[:num_modes], products.shape)
    return nodes, root[:, None] * vectors / np.sqrt(variances), *main


def _correlation(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    return np.exp(-(((points[:, None] - others) / _SMOOTHNESS) ** 2) / 2)
