"""The closed-loop planner: filters its position, and corrects its course at every step."""

from __future__ import annotations

import dataclasses

import numpy as np

from mazebench.agent import Inputs
from mazebench.maps.maze import Cell

from . import observation
from .map_planner import MapPlanner
from .observation import Body, Point
from .pilot import Pilot

_POSITION_GAIN = 0.1  # weight of an observed position against the one predicted from velocities


@dataclasses.dataclass
class _Navigator:
    """The estimated motion of one environment's body, and the pilot that drives it."""

    position: Point  # estimated
    velocity: Point  # cells a second, in the world's frame, at the last observation
    pilot: Pilot

    def update(self, observed: Body) -> None:
        """Predicts the position one step on from the mean velocity, and corrects it by the observed position."""
        velocity = observed.velocity()
        x, y = self.position
        self.position = (
            _filtered(x, (self.velocity[0] + velocity[0]) / 2, observed.x),
            _filtered(y, (self.velocity[1] + velocity[1]) / 2, observed.y),
        )
        self.velocity = velocity


def _filtered(coordinate: float, velocity: float, observed: float) -> float:
    predicted = coordinate + observation.STEP_TIME * velocity
    return (1 - _POSITION_GAIN) * predicted + _POSITION_GAIN * observed


class ClosedLoopPlanner(MapPlanner):
    """Pure pursuit of a path that is planned once a context, from the estimated cell of the body."""

    def initial_state(self, batch_size: int) -> list[_Navigator]:
        """Returns navigators that `act` replaces where an episode begins."""
        return [_Navigator((0.0, 0.0), (0.0, 0.0), Pilot([])) for _ in range(batch_size)]

    def act(
        self, inputs: Inputs, state: list[_Navigator], explore: bool = False
    ) -> tuple[np.ndarray, list[_Navigator]]:
        """Returns actions `[B]`, planned for one environment after the other."""
        contexts = inputs.observation["context"]
        size = contexts.shape[-1]
        actions = np.zeros(len(state), dtype=np.int64)
        for slot, values in enumerate(inputs.observation["state"].tolist()):
            observed = observation.observed_body(values, self._cells_per_metre)
            start = observation.start_cell(contexts[slot])
            if inputs.new_episode[slot]:
                # An episode begins in the centre of the start cell.
                state[slot] = _Navigator(observation.centre(start, size), observed.velocity(), Pilot([]))
            else:
                state[slot].update(observed)
            navigator = state[slot]
            if inputs.new_context[slot]:
                path = observation.plan(contexts[slot], _nearest_free(contexts[slot], navigator.position, start))
                navigator.pilot = Pilot.along(path, size, self._cells_per_metre)
            x, y = navigator.position
            actions[slot] = navigator.pilot.action(observed._replace(x=x, y=y))
        return actions, state


def _nearest_free(context: np.ndarray, position: Point, start: Cell) -> Cell:
    """Returns the cell of `position`, or the marked start if the shown map has a wall there."""
    cell = observation.cell_of(*position, context.shape[-1])
    return start if context[observation.GLOBAL_MAP][cell] > 0.5 else cell
