"""Reads a map whose pixels are the cells of a maze, some of which may be wrong.

In a maze of corridors, cells with odd row and column are rooms, those with even row and column are pillars, and only
the cells between, the doors, may be either. How often the map errs therefore shows in the map itself, in rooms that are
walls and in pillars that are free.
"""

from __future__ import annotations

import numpy as np

_ERROR = 0.2  # probability that a door, or a cell of another maze, is shown wrong
_MOST_ODD = 0.35  # share of rooms that are walls, and of pillars that are free, in mazes of corridors
_LEAST_ODD = 0.005  # share of them that are so in the maze itself, even if the map shows none


def wall_probability(shown: np.ndarray) -> np.ndarray:
    """Returns `[N, N]` float: the probability of a wall in each cell of a shown map `[N, N]` bool; 1 at the border."""
    rooms, pillars = shown[1:-1:2, 1:-1:2], ~shown[2:-1:2, 2:-1:2]
    odd_rooms, odd_pillars = ((cells.sum() + 0.5) / (cells.size + 1) for cells in (rooms, pillars))
    walls = np.where(shown, 1 - _ERROR, _ERROR)
    if max(odd_rooms, odd_pillars) < _MOST_ODD:
        # Errors make both kinds of odd cells, and a maze may have one of them itself.
        error = min(odd_rooms, odd_pillars)
        walls = np.where(shown, 1 - max(error, _ERROR), max(error, _ERROR))
        walls[1:-1:2, 1:-1:2] = _odd_probability(rooms, odd_rooms, error)
        walls[2:-1:2, 2:-1:2] = 1 - _odd_probability(pillars, odd_pillars, error)
    walls[[0, -1]] = walls[:, [0, -1]] = 1.0
    return walls


def _odd_probability(is_odd: np.ndarray, share: float, error: float) -> np.ndarray:
    """Returns the probability that each cell is odd in the maze, by Bayes' rule.

    Args:
      is_odd: bool, whether the map shows the cell as odd.
      share: of cells that are shown as odd.
      error: probability that a cell is shown wrong.
    """
    prior = max((share - error) / (1 - 2 * error), _LEAST_ODD)
    likelihood_odd, likelihood_even = np.where(is_odd, 1 - error, error), np.where(is_odd, error, 1 - error)
    return prior * likelihood_odd / (prior * likelihood_odd + (1 - prior) * likelihood_even)
