"""The closed-loop planner: filters its position, and corrects its course at every step."""

from __future__ import annotations

import dataclasses

import numpy as np

from mazebench.agent import Inputs
from mazebench.maps.maze import cell_to_point
from mazebench.tasks.context import GLOBAL_MAP

from ..robot.cells import nearest_cell, start_cell
from ..robot.dead_reckoning import DeadReckoning
from ..robot.moving_body import PLAYED, as_kind, has_all_six, observed_body
from ..robot.pilot import Pilot
from .planner import MapPlanner, plan

_POSITION_GAIN = 0.1  # weight of an observed position against the one predicted from velocities


@dataclasses.dataclass
class _Drive:
    """The estimated pose of one environment's body, and the pilot that drives it."""

    odometry: DeadReckoning
    pilot: Pilot = dataclasses.field(init=False)


class ClosedLoopPlanner(MapPlanner):
    """Pure pursuit of a path that is planned once a context, from the estimated cell of the body."""

    plays_actions = PLAYED

    def initial_state(self, batch_size: int) -> list[_Drive | None]:
        """Returns nothing yet: a drive begins with an episode."""
        return [None] * batch_size

    def act(
        self, inputs: Inputs, state: list[_Drive | None], explore: bool = False
    ) -> tuple[np.ndarray, list[_Drive | None]]:
        """Returns actions `[B]`, planned for one environment after the other."""
        contexts = inputs.observation["context"]
        size = contexts.shape[-1]
        actions = np.zeros(len(state), dtype=np.int64)
        for slot, values in enumerate(inputs.observation["state"].tolist()):
            observed, drive = observed_body(self._body, values, self._cells_per_metre), state[slot]
            start = start_cell(contexts[slot])
            if drive is None or inputs.new_episode[slot]:
                # An episode begins in the centre of the start cell.
                x, y = cell_to_point(start, size).tolist()
                drive = state[slot] = _Drive(DeadReckoning((x, y), observed.velocity(), _POSITION_GAIN))
                body = observed._replace(x=x, y=y)
            else:
                body = drive.odometry.update(observed)
            if inputs.new_context[slot]:
                cell = nearest_cell(body.x, body.y, size)
                is_wall = contexts[slot][GLOBAL_MAP][cell] > 0.5  # of the map that is shown
                path = plan(contexts[slot], start if is_wall else cell)
                drive.pilot = Pilot(path, size, self._cells_per_metre)
            actions[slot] = drive.pilot.action(body, has_all_six(self._kind, self._body))
        return as_kind(self._kind, actions, self._body), state
