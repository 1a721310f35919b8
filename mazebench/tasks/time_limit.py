"""The time limit of a leg, in agent steps: the option `time_limit`, or else what `default_time_limit` returns.

On a track, `plan_route` takes it by the distance of each episode. Else `Task.of` takes it by the largest distance.
"""

from __future__ import annotations

import math

from mazebench.constants import STEP_TIME
from mazebench.tasks.tracks import TRACKS
from mazebench.world.bodies import Body

TIME_LIMIT = 100  # in the mazes of the paper's protocol

# Metres that a body can drive in the steps to spare; a lost robot can look for its pose in the second ones, and a
# robot can wait for doors in the third ones.
_SPARE, _LOST_SPARE, _WAITING_SPARE = 25, 75, 150


def default_time_limit(num_cells: int, cell_size: float, body: Body, *, track: str | None, is_new: bool = False) -> int:
    """Returns the limit of a body for a goal `num_cells` away.

    `is_new` says that the maze, an end or the body is not the benchmark's.
    """
    # The slider takes 2 steps for a metre at its top speed, and 4 for a quarter turn. A turn comes at each cell, on
    # tracks at every metre.
    of_metre, of_turn = math.ceil(1 / (body.top_speed * STEP_TIME)), body.quarter_turn_steps
    if track is not None:
        steps = math.ceil((of_metre + of_turn) * cell_size * num_cells)
        spare = _LOST_SPARE if TRACKS[track].hides_pose else _WAITING_SPARE if TRACKS[track].moves_doors else _SPARE
        return steps + of_metre * spare
    steps = math.ceil((of_metre * cell_size + of_turn) * num_cells)
    return max(TIME_LIMIT, steps + of_metre * _SPARE) if is_new else TIME_LIMIT
