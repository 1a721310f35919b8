"""The pose of an older map on a newer one, found by correlating what is free and what is wall on both.

`H` and `W` are the numbers of rows and columns of squares, to which the pixels of a map are averaged. Places in them
are x to the right and y down (m), from the upper left corner of the map's picture.
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import cv2
import numpy as np
import scipy

from mazebench.errors import InputError
from mazebench.maps.readers.occupancy_grid import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    OccupancyGrid,
    Pose,
    known_box,
    states_in_cells,
)

# The squares (m, at least) in which turns are tried, in which the best poses are refined, and the best one of them.
_COARSE, _FINE, _FINEST = 0.2, 0.1, 0.05
_MOST_SQUARES = 200  # along a side of a map whose turns are tried
_WALL = 1.7  # the weight of a wall, where free space has 1
_THIN = 3.0  # a square counts as wall if a third of it is
_BLUR = 0.8  # squares
_TURNS = np.radians(np.arange(0.0, 360.0, 1.5))
_NUM_REFINED, _APART = 4, 4  # turns with the best scores, and how many turns they are apart at least
_MOST_POINTS = 30_000  # of the older map, by which a pose is refined
_MOST_TRIES = 200  # of poses while one is refined
_NEAR = 0.3  # m, within which walls of two maps meet
_FEW = 0.5  # of the walls of the other map; a map with fewer is no plan without furniture, but has little to meet

# The test of chance, by the product of the two shares of `Fit`, and by how many standard deviations the best score is
# above those of the older map's mirror image.
_SURE_FIT = 0.75  # that is enough alone
LEAST_FIT, _LEAST_DEVIATIONS = 0.56, 5.0  # that are enough together


class Fit(NamedTuple):
    """The agreement of two maps that lie on each other. What is unknown on either is left out."""

    covered: float  # share of the free space of the map that has less of it which is free on the other one, too
    met: float  # share of walls that are near one of the other map, beyond chance; of the map that has more of them


class _Squares(NamedTuple):
    """The averages of a map in squares."""

    values: np.ndarray  # [H, W] float32: 1 where all is free, down to -_WALL at walls, 0 where all is unknown
    side: float  # m
    corner: np.ndarray  # [2] x, y of the upper left corner


def align(older: OccupancyGrid, newer: OccupancyGrid, name: str) -> Pose:
    """Returns the pose of the frame of an older map in the frame of a newer one.

    It is rounded to a centimetre and to a ten-thousandth of a radian, so that small differences of arithmetic don't
    show. All turns are tried in steps of 1.5 degrees, and for each of them all shifts. The best ones are then refined.

    Raises:
      InputError: if the pose may be chance; `name` is that of the older map. Enough of the free space and of the walls
        must lie on each other. Where it is not nearly all, the best score must also stand out from those of the older
        map's mirror image at all turns, which lies nowhere.
    """
    if not (older.states == FREE).any():
        raise InputError(f"{name}: expected a map with free space, found none")
    side = max(_COARSE, *(max(grid.states.shape) * grid.resolution / _MOST_SQUARES for grid in (older, newer)))
    below, above = _squares(newer, side), _squares(older, side)
    scores, shifts = _best_shifts(below, above)
    chance, _ = _best_shifts(below, above._replace(values=np.ascontiguousarray(above.values[:, ::-1])))
    deviations = (scores.max() - chance.mean()) / max(chance.std(), 1e-9)

    # The turns with the best scores, each refined.
    best: list[int] = []
    for number in np.argsort(scores)[::-1]:
        away = [min((number - other) % len(_TURNS), (other - number) % len(_TURNS)) for other in best]
        if len(best) < _NUM_REFINED and min(away, default=_APART) >= _APART:
            best.append(int(number))
    below, above = _squares(newer, _FINE), _squares(older, _FINE)
    _, turn, shift = max(_refined(below, above, _TURNS[number], shifts[number], side) for number in best)
    _, turn, shift = _refined(_squares(newer, _FINEST), _squares(older, _FINEST), turn, shift, _FINE)

    # From places below the upper left corners to points above the lower left ones, and from there to the frames.
    heights = [len(grid.states) * grid.resolution for grid in (older, newer)]
    x, y = _turned(turn) @ [0.0, heights[0]] + shift
    corner = _in_frame(newer.origin, (x, heights[1] - y, -turn))
    yaw = math.remainder(corner[2] - older.origin[2], math.tau)
    x, y = corner[:2] - _turned(yaw) @ older.origin[:2]
    pose = round(float(x), 2) + 0.0, round(float(y), 2) + 0.0, round(yaw, 4) + 0.0

    covered, met = fit(moved(older, pose), newer)
    if covered * met < (LEAST_FIT if deviations >= _LEAST_DEVIATIONS else _SURE_FIT):
        raise InputError(
            f"{name}: expected a map of the same building, found a best place that may be chance: {covered:.2f} of the "
            f"free space and {met:.2f} of the walls lie on each other (their product is at least {LEAST_FIT:g} in one "
            f"building), and it stands out by {deviations:.1f} standard deviations (at least {_LEAST_DEVIATIONS:g}, or "
            f"the product at least {_SURE_FIT:g})"
        )
    return pose


def moved(grid: OccupancyGrid, pose: Pose) -> OccupancyGrid:
    """Returns a map in another frame, in which its own frame has a pose."""
    return dataclasses.replace(grid, origin=_in_frame(pose, grid.origin))


def fit(older: OccupancyGrid, newer: OccupancyGrid) -> Fit:
    """Returns the agreement of two maps of one frame, where both are known."""
    side = max(_FINE, newer.resolution)
    below, whole, above = (
        states_in_cells(grid, frame.origin, side, _shape(frame, side))
        for grid, frame in ((newer, newer), (older, older), (older, newer))
    )
    least = min(np.sum(below == FREE), max(np.sum(whole == FREE), np.sum(above == FREE)))
    covered = np.sum((below == FREE) & (above == FREE)) / max(1, least)
    is_known = (below != UNKNOWN) & (above != UNKNOWN)
    walls = [is_known & (states == OCCUPIED) for states in (below, above)]
    met = 0.0
    for own, others, states in zip(walls, walls[::-1], (above, below), strict=True):
        is_near = wall_distances(states == OCCUPIED) * side <= _NEAR
        if own.any() and (by_chance := is_near[is_known].mean()) < 1:
            counts = min(1.0, np.sum(own) / max(1.0, _FEW * np.sum(others)))
            met = max(met, counts * (is_near[own].mean() - by_chance) / (1 - by_chance))
    return Fit(float(covered), float(met))


def wall_distances(walls: np.ndarray) -> np.ndarray:
    """Returns the distance of each square to the nearest one of `walls` (`[H, W]` bool), in squares: `[H, W]`."""
    if not walls.any():
        return np.full(walls.shape, np.inf)
    return np.asarray(cv2.distanceTransform((~walls).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE))


def _shape(grid: OccupancyGrid, side: float) -> tuple[int, int]:
    """Returns the numbers of rows and columns of squares that cover a map."""
    rows, columns = (math.ceil(length * grid.resolution / side) for length in grid.states.shape)
    return rows, columns


def _squares(grid: OccupancyGrid, side: float) -> _Squares:
    """Returns the averages of the known part of a map in squares of a whole number of pixels, about `side` wide."""
    rows, columns = known_box(grid.states)
    states = grid.states[rows, columns]
    pixels = max(1, round(side / grid.resolution))
    states = np.pad(states, [(0, -length % pixels) for length in states.shape], constant_values=UNKNOWN)
    height, width = (length // pixels for length in states.shape)
    free, wall = (
        cv2.resize((states == state).astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
        for state in (FREE, OCCUPIED)
    )
    wall = np.minimum(1, _THIN * wall)
    values = free * (1 - wall) - _WALL * cv2.GaussianBlur(wall, (0, 0), _BLUR)
    return _Squares(values, pixels * grid.resolution, np.array([columns.start, rows.start]) * grid.resolution)


def _best_shifts(below: _Squares, above: _Squares) -> tuple[np.ndarray, np.ndarray]:
    """Returns the best score of one map over another at each turn (`[T]`), and its shift (m) after it (`[T, 2]`)."""
    # The map above is turned about the middle of a square canvas in the squares of the one below.
    scale, shape = above.side / below.side, np.array(below.values.shape)
    side = math.ceil(scale * math.hypot(*above.values.shape)) + 2
    middle = (np.array(above.values.shape[::-1]) - 1) / 2
    length = scipy.fft.next_fast_len(max(shape) + side, real=True)
    of_below = scipy.fft.rfft2(below.values, (length, length))

    scores, shifts = np.empty(len(_TURNS)), np.empty((len(_TURNS), 2))
    for number, turn in enumerate(_TURNS):
        matrix = scale * _turned(turn)
        offset = (side - 1) / 2 - matrix @ middle
        canvas = cv2.warpAffine(above.values, np.column_stack([matrix, offset]), (side, side))
        score = scipy.fft.irfft2(of_below * scipy.fft.rfft2(canvas, (length, length)).conj(), (length, length))
        best = np.array(np.unravel_index(score.argmax(), score.shape))
        scores[number] = score[tuple(best)]
        right_down = np.where(best < shape, best, best - length)[::-1]
        shifts[number] = below.side * (right_down + offset + 0.5 - matrix @ [0.5, 0.5]) - _turned(turn) @ above.corner
    return scores, shifts + below.corner


def _refined(
    below: _Squares, above: _Squares, turn: float, shift: np.ndarray, step: float
) -> tuple[float, float, np.ndarray]:
    """Returns the best score near a pose, and the pose: turn and shift. `step` (m) is how far it may be off."""
    rows, columns = np.nonzero(np.abs(above.values) > 0.05)
    chosen = np.random.default_rng(0).permutation(len(rows))[:_MOST_POINTS]  # evenly spaced ones may miss thin walls
    rows, columns = rows[chosen], columns[chosen]
    weights = above.values[rows, columns]
    points = above.corner + above.side * (np.column_stack([columns, rows]) + 0.5)
    middle = points.mean(axis=0)
    radius = max(1.0, float(np.abs(points - middle).max()))
    points, centre = points - middle, _turned(turn) @ middle + shift

    def loss(change: np.ndarray) -> float:  # of x, y and the way that the rim turns (m)
        places = points @ _turned(turn + change[2] / radius).T + centre + change[:2]
        right, down = ((places - below.corner) / below.side - 0.5).astype(np.float32).T
        found = cv2.remap(below.values, _in_rows(right), _in_rows(down), cv2.INTER_LINEAR)
        return -float(found.ravel()[: len(weights)] @ weights)

    simplex = 1.5 * step * np.vstack([np.zeros(3), np.eye(3)])
    options = {"initial_simplex": simplex, "xatol": _FINEST / 10, "fatol": 1e-3, "maxfev": _MOST_TRIES}
    found = scipy.optimize.minimize(loss, np.zeros(3), method="Nelder-Mead", options=options)
    turn += found.x[2] / radius
    return -found.fun, turn, centre + found.x[:2] - _turned(turn) @ middle


def _in_rows(values: np.ndarray) -> np.ndarray:
    """Returns values in rows of 256, filled up at the end, for cv2 takes no rows above 32,767."""
    return np.pad(values, (0, -len(values) % 256)).reshape(-1, 256)


def _in_frame(frame: Pose, pose: Pose) -> Pose:
    """Returns a pose that is given in a frame which has a pose itself."""
    x, y = _turned(frame[2]) @ pose[:2] + frame[:2]
    return float(x), float(y), frame[2] + pose[2]


def _turned(angle: float) -> np.ndarray:
    """Returns the matrix `[2, 2]` of a turn."""
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
