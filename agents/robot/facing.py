"""Driving one way while turning to look another way, with the actions `velocity`."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from mazebench.maps.maze import Cell, cell_to_point
from mazebench.world.angles import wrap_angle

from .driving import Drive
from .motion import BEARINGS
from .moving_body import LOOK_LEFT, LOOK_RIGHT
from .senses import Memory

_AHEAD = 3  # cells along the path to the one that the body turns to


@dataclasses.dataclass
class TurningDrive:
    """A drive that is planned for a body with a heading of its own, while the body turns along its path."""

    heading: float  # rad
    drive: Drive = dataclasses.field(default_factory=Drive)

    def follow(self, path: list[Cell], walls: np.ndarray, memory: Memory) -> tuple[float, float, float]:
        """Returns the next velocities along `path`, around likely `walls`; without a path, the body looks round."""
        body, heading = memory.body, self.heading
        turn_step = body.model.turn_step
        action, point = self.drive.planned(path, walls, body.turned(heading), memory.cell_size)

        # The body turns towards the third cell of the path; as a share of a look to the left, from -1 to 1.
        turn = float(not path)
        if len(path) > 1:
            x, y = cell_to_point(path[min(_AHEAD, len(path) - 1)], len(walls)).tolist()
            turn = float(np.clip(wrap_angle(math.atan2(y - body.y, x - body.x) - body.yaw) / turn_step, -1, 1))
        memory.command(action, point, heading, turn)
        if action in (LOOK_LEFT, LOOK_RIGHT):
            self.heading += turn_step if action == LOOK_LEFT else -turn_step
            return 0.0, 0.0, turn
        bearing = heading + BEARINGS[action] - body.yaw - turn * turn_step / 2  # half of the turn is done on the way
        return math.cos(bearing), math.sin(bearing), turn
