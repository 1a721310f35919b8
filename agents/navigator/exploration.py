"""Where to drive while several poses are possible."""

from __future__ import annotations

import numpy as np

from mazebench.maps.maze import Cell, cell_to_point

from ..robot.cells import nearest_cell
from . import scans
from .localization import Belief

_POSES = 16  # the likeliest ones, which are told apart
_NEARBY = 6  # cells
_TELLING = 0.1  # cells, by which two expected ranges differ
_TELLING_RAYS = 4  # so many of which tell two scans apart
_CONFUSION_COST = 20.0  # cells of a way that certainty is worth


def disambiguate(belief: Belief, walls: np.ndarray) -> list[Cell]:
    """Returns a short path from the likeliest pose's cell to where the possible poses would see different scans.

    Of the cells nearby, it ends in the one with the least sum of the way and of the probability that the true pose is
    then still taken for another one (active localization: Fox, Burgard & Thrun 1998; Corominas Murtra et al. 2008). It
    is that cell alone if no cell nearby is worth the way.
    """
    poses, weights = belief.poses[:_POSES], belief.weights[:_POSES] / belief.weights[:_POSES].sum()
    x, y, _ = belief.pose.tolist()
    paths = _paths_nearby(walls, nearest_cell(x, y, len(walls)))
    points = cell_to_point(np.array([path[-1] for path in paths]), len(walls))
    seen = _scans_at(walls, poses, points, belief.reach)
    is_alike = (np.abs(seen[:, None] - seen) > _TELLING).sum(axis=-1) < _TELLING_RAYS  # [H, H, P]
    confusion = np.einsum("i,j,ijp->p", weights, weights, is_alike)
    lengths = np.array([len(path) for path in paths])
    return paths[int(np.argmin(lengths + _CONFUSION_COST * confusion))]


def _scans_at(walls: np.ndarray, poses: np.ndarray, points: np.ndarray, reach: float) -> np.ndarray:
    """Returns `[H, P, 32]`: what each of H poses would see, had the body driven as from the first one to P points.

    The scans are those of a body that then looks along the first pose's x axis, so that they do not depend on how the
    body is turned now.
    """
    turns = (poses[:, 2] - poses[0, 2])[:, None]
    ways = (points - poses[0, :2]) @ (1, 1j) * np.exp(1j * turns)  # [H, P], in each pose's frame
    reached = np.stack(
        np.broadcast_arrays(poses[:, :1] + ways.real, poses[:, 1:2] + ways.imag, turns), axis=-1
    )  # [H, P, 3]
    return scans.predict(walls, reached.reshape(-1, 3), reach).reshape(*ways.shape, -1)


def _paths_nearby(walls: np.ndarray, start: Cell) -> list[list[Cell]]:
    """Returns shortest paths from `start` to itself and to the free cells up to `_NEARBY` cells away.

    `start` is any cell of the map `walls` `[N, N]` bool. From one at its edge, the cells beyond count as walls.
    """
    paths = {start: [start]}
    queue = [start]
    walls = np.pad(walls, 1, constant_values=True)
    for cell in queue:
        row, column = cell
        for neighbour in ((row - 1, column), (row, column - 1), (row + 1, column), (row, column + 1)):
            if len(paths[cell]) <= _NEARBY and neighbour not in paths and not walls[neighbour[0] + 1, neighbour[1] + 1]:
                paths[neighbour] = [*paths[cell], neighbour]
                queue.append(neighbour)
    return list(paths.values())
