"""The time limit of a leg, in agent steps: the option `time_limit`, or else what `default_time_limit` returns.

On a track, `plan_route` takes it by the distance of each episode. Else `Task.of` takes it by the largest distance.
"""

from __future__ import annotations

import math

from mazebench.tasks.tracks import TRACKS

TIME_LIMIT = 100  # in the mazes of the paper's protocol

# A metre takes 2 steps at the top speed, and a quarter turn in each cell 4. On tracks, a turn comes at every metre.
_STEPS_PER_METRE, _STEPS_PER_CELL = 2, 4
_SPARE_STEPS = 50
_LOST_SPARE_STEPS = 150  # so that a lost robot can look for its pose


def default_time_limit(num_cells: int, cell_size: float, *, track: str | None, is_new: bool = False) -> int:
    """Returns the limit for a goal `num_cells` away; `is_new` says that the maze or an end is the user's, or drawn."""
    if track is not None:
        steps = math.ceil((_STEPS_PER_METRE + _STEPS_PER_CELL) * cell_size * num_cells)
        return steps + (_LOST_SPARE_STEPS if TRACKS[track].hides_pose else _SPARE_STEPS)
    steps = math.ceil((_STEPS_PER_METRE * cell_size + _STEPS_PER_CELL) * num_cells)
    return max(TIME_LIMIT, steps + _SPARE_STEPS) if is_new else TIME_LIMIT
