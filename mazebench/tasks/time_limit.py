"""The time limits of all tasks, in agent steps."""

from __future__ import annotations

import math

from mazebench.tasks.tracks import TRACKS

TIME_LIMIT = 100  # in the mazes of the paper's protocol

# A metre takes 2 steps at the top speed, and a quarter turn in each cell 4.
_STEPS_PER_METRE, _STEPS_PER_CELL = 2, 4
_SPARE_STEPS = 50
_LOST_SPARE_STEPS = 150  # so that a lost robot can look for its pose


def fitting_time_limit(num_cells: int, cell_size: float) -> int:
    """Returns the limit for a goal `num_cells` away in mazes of one's own or drawn ones, at least 100."""
    return max(TIME_LIMIT, math.ceil((_STEPS_PER_METRE * cell_size + _STEPS_PER_CELL) * num_cells) + _SPARE_STEPS)


def track_time_limit(track: str, num_cells: int) -> int:
    """Returns the limit on a track for a goal `num_cells` away."""
    spare_steps = _LOST_SPARE_STEPS if TRACKS[track].hides_pose else _SPARE_STEPS
    return (_STEPS_PER_METRE + _STEPS_PER_CELL) * num_cells + spare_steps
