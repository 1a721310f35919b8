"""A belief over the placements of the shown map on the grid of what was seen.

What was seen from the start on is kept in one grid, which does not depend on the map (`tracking`, `occupancy`). A
hypothesis lays the map on this grid: turned by quarter turns, perhaps mirrored, and shifted by whole cells. All that
was seen so far weighs it, under the assumption that each cell of the map may be wrong with a known probability. So a
hypothesis has its own account of what has changed since the map was made: the cells in which the grid and the map
differ. This is a Rao-Blackwellised filter (Doucet et al. 2000) whose discrete part is enumerated.

`G` is the number of orientations, `N` the cells on a side of the map, `L` of the grid, `H` the number of hypotheses.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import special

from mazebench.kernels import compiled

_ERROR = 0.05  # probability that a cell of the map is wrong
_OUTSIDE = 1e-3  # probability that a cell outside of the map, or of its border, is free
_MIRRORED = 0.05  # probability that a map that may lie in any way is mirrored
_UNTOLD = 1e-4  # probability of a goal in a cell that the marker excludes
_CHANGED = 0.02  # difference of probabilities of a wall, from which a cell is weighed anew
_UNLIKELY = 1e-3  # of the likeliest hypothesis, up to which one is not considered, or not used in mixtures
_MOST_MIXED = 32  # hypotheses


def orientations(plane: np.ndarray, count: int) -> np.ndarray:
    """Returns `[count, N, N]`: a plane, turned by quarters if `count` is 4, and also mirrored if it is 8."""
    turned = [np.rot90(plane, turns) for turns in range(4)]
    return np.ascontiguousarray([*turned, *(each[:, ::-1] for each in turned)][:count])


class MapBelief:
    """The hypotheses of where the map lies, and their probabilities."""

    def __init__(self, walls: np.ndarray, goal: np.ndarray, num_turns: int, middle: np.ndarray | None, size: int):
        """Makes the belief before anything was seen.

        Args:
          walls, goal: `[N, N]` float, the probabilities of a wall and of the goal by the map.
          num_turns: 1, 4 or 8: whether the map may be turned, or mirrored, too.
          middle: `[N, N]` float, the probability that a cell of the map is the middle of the grid; None if grid and
            map have the same corners.
          size: L.
        """
        # Placements: orientation, and the row and column of the map at the grid's (0, 0).
        if middle is None:
            placements = np.array([(turn, 0, 0) for turn in range(num_turns)])
            log_weights = np.zeros(num_turns)
        else:
            turned = orientations(middle, num_turns)
            placements = np.argwhere(turned > _UNLIKELY * turned.max())
            log_weights = np.log(turned[tuple(placements.T)])
            placements -= [0, size // 2, size // 2]
        if num_turns == 8:
            log_weights += np.where(placements[:, 0] < 4, np.log(1 - _MIRRORED), np.log(_MIRRORED))
        self.placements, self.log_weights = placements, log_weights  # [H, 3] int, [H] float
        self.weighed = np.full((size, size), 0.5)  # the probability of a wall with which each cell was weighed
        self._num_turns = num_turns
        self.begin_leg(walls, goal)

    def begin_leg(self, walls: np.ndarray, goal: np.ndarray) -> None:
        """Takes in a leg's map and goal, shown on a map that lies as those before."""
        self.walls = orientations(walls, self._num_turns)  # [G, N, N]
        self.goals = orientations(goal, self._num_turns)  # [G, N, N]
        self.visited = np.zeros(self.weighed.shape, dtype=bool)  # the cells without the goal

    @property
    def weights(self) -> np.ndarray:
        """The probabilities of the hypotheses, `[H]` float."""
        return special.softmax(self.log_weights)

    def update(self, evidence: np.ndarray, visited: np.ndarray) -> bool:
        """Takes in what was seen; returns whether weights changed.

        Args:
          evidence: `[L, L]` float, log odds of walls.
          visited: `[L, L]` bool, the cells in which the body was: none is the goal, where the episode would have ended.
        """
        if len(self.placements) == 1:
            return False
        changed = _weigh(self.log_weights, self.walls, self.placements, self.weighed, evidence)
        for cell in np.argwhere(visited & ~self.visited):
            self.visited[tuple(cell)] = changed = True
            orientation, row, column = self.placements.T
            row, column = row + cell[0], column + cell[1]
            size = self.goals.shape[-1]
            inside = (row >= 0) & (row < size) & (column >= 0) & (column < size)
            here = self.goals[orientation[inside], row[inside], column[inside]]
            self.log_weights[inside] += np.log(np.maximum(1 - here, _UNTOLD))
        return changed

    def likeliest(self, least: float) -> tuple[int, int, int] | None:
        """Returns the likeliest placement, as orientation, row and column; None if it is less than `least` probable."""
        weights = self.weights
        best = int(weights.argmax())
        orientation, row, column = self.placements[best].tolist()
        return (orientation, row, column) if weights[best] >= least else None

    def laid(self, placement: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Returns `[L, L]` float twice: the probabilities of a wall and of the goal on the grid, by one placement."""
        return _mixed(self.walls, self.goals, np.array([placement]), np.ones(1), len(self.weighed))

    def on_map(self, x: float, y: float, yaw: float) -> tuple[float, float, float]:
        """Returns a pose on the grid (cells, rad) as one on the map that is shown, by the likeliest hypothesis."""
        orientation, row, column = self.placements[self.log_weights.argmax()].tolist()
        size = self.walls.shape[-1]
        x, y = x + column, y + size - len(self.weighed) - row
        if orientation >= 4:
            x, yaw = size - x, math.pi - yaw
        for _ in range(orientation % 4):
            x, y, yaw = y, size - x, yaw - math.pi / 2
        return x, y, yaw

    def mixture(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns `[L, L]` float twice: the probabilities of a wall and of the goal by all hypotheses."""
        weights = self.weights
        used = np.flatnonzero(weights > _UNLIKELY * weights.max())
        used = used[np.argsort(-weights[used], kind="stable")][:_MOST_MIXED]
        shares = weights[used] / weights[used].sum()
        return _mixed(self.walls, self.goals, self.placements[used], shares, len(self.weighed))


@compiled
def _weigh(
    log_weights: np.ndarray, walls: np.ndarray, placements: np.ndarray, weighed: np.ndarray, evidence: np.ndarray
) -> bool:
    """Adds to `log_weights` `[H]` what cells tell whose evidence has changed; both in place with `weighed`."""
    changed, size = False, walls.shape[-1]
    for r in range(len(evidence)):
        for c in range(len(evidence)):
            wall, before = 1 / (1 + np.exp(-evidence[r, c])), weighed[r, c]
            if abs(wall - before) < _CHANGED:
                continue
            weighed[r, c], changed = wall, True
            for h in range(len(placements)):
                orientation, row, column = placements[h, 0], placements[h, 1] + r, placements[h, 2] + c
                shown = 1 - _OUTSIDE
                if 0 < row < size - 1 and 0 < column < size - 1:
                    shown = _ERROR + (1 - 2 * _ERROR) * walls[orientation, row, column]
                new, old = shown * wall + (1 - shown) * (1 - wall), shown * before + (1 - shown) * (1 - before)
                log_weights[h] += np.log(new / old)
    return changed


@compiled
def _mixed(
    walls: np.ndarray, goals: np.ndarray, placements: np.ndarray, shares: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray]:
    """Returns the mixtures of walls and goals `[L, L]`; the arguments are those of `MapBelief`.

    Outside of a map, all is wall.
    """
    wall, goal = np.ones((size, size)), np.zeros((size, size))
    side = walls.shape[-1]
    for h in range(len(placements)):
        orientation, row, column = placements[h]
        for r in range(max(0, -row), min(size, side - row)):
            for c in range(max(0, -column), min(size, side - column)):
                wall[r, c] -= shares[h] * (1 - walls[orientation, row + r, column + c])
                goal[r, c] += shares[h] * goals[orientation, row + r, column + c]
    return wall, goal
