"""The upper bound beside the rigid planner: it filters its position, and aims anew at every step."""

from __future__ import annotations

import dataclasses
import math
import pathlib

import numpy as np

from mazebench.agent import Interface, Observation
from mazebench.maps.maze import Cell

from . import reading

_LOOKAHEAD = 0.8  # m along the path to the point it aims at
_SEGMENTS_AHEAD = 3  # in which it looks for itself on the path; more, and it could take a parallel corridor for its own
_POSITION_GAIN = 0.1  # weight of an observed position against the one reckoned from velocities
_LARGEST_MISALIGNMENT = math.radians(20)  # between a drive and the aim, before it turns
# The headings of the four drives, in the order of their actions.
_DRIVES = (
    (reading.FORWARD, 0.0),
    (reading.BACKWARD, math.pi),
    (reading.STRAFE_LEFT, math.pi / 2),
    (reading.STRAFE_RIGHT, -math.pi / 2),
)


Point = tuple[float, float]


@dataclasses.dataclass
class _Pilot:
    """Where one environment's agent believes to be, and the path it follows."""

    points: list[Point] = dataclasses.field(default_factory=list)  # centres of the path's cells
    segment: int = 0  # it is on the way from points[segment] to the next
    position: Point = (math.nan, math.nan)  # m; not known until an episode's first observation
    velocity: Point = (0.0, 0.0)  # in the world's frame, at the last observation

    def localize(self, state: list[float], start: Cell, size: int) -> None:
        """Reckons on from the last position, the start cell's centre at first, and corrects by what is observed."""
        coast_x, coast_y = reading.coasting(state)
        velocity = (coast_x / reading.COASTING_TIME, coast_y / reading.COASTING_TIME)
        if math.isnan(self.position[0]):
            self.position = reading.centre(start, size)
        else:
            self.position = (
                _filtered(self.position[0], (self.velocity[0] + velocity[0]) / 2, state[reading.X]),
                _filtered(self.position[1], (self.velocity[1] + velocity[1]) / 2, state[reading.Y]),
            )
        self.velocity = velocity

    def action(self, state: list[float]) -> int:
        """The drive nearest to the direction of the aim, or a turn if even that one is too far off."""
        # Reckoned from where the body would come to rest: from where it is, it would overshoot its aim and turn back.
        coast_x, coast_y = reading.coasting(state)
        x, y = self.position[0] + coast_x, self.position[1] + coast_y
        aim_x, aim_y = self._aim(x, y)
        bearing = math.atan2(aim_y - y, aim_x - x) - state[reading.YAW]
        drive, heading = min(_DRIVES, key=lambda drive: abs(reading.wrap(bearing - drive[1])))
        misalignment = reading.wrap(bearing - heading)
        if abs(misalignment) <= _LARGEST_MISALIGNMENT:
            return drive
        return reading.LOOK_LEFT if misalignment > 0 else reading.LOOK_RIGHT

    def _aim(self, x: float, y: float) -> Point:
        """The point `_LOOKAHEAD` metres ahead of (x, y) on the path; the path's end where it is nearer."""
        along = self._advance(x, y) + _LOOKAHEAD
        for start, end in zip(self.points[self.segment :], self.points[self.segment + 1 :], strict=False):
            if along <= 1:  # centres of neighbouring cells are 1 m apart
                return start[0] + along * (end[0] - start[0]), start[1] + along * (end[1] - start[1])
            along -= 1
        return self.points[-1]

    def _advance(self, x: float, y: float) -> float:
        """Moves on to the segment nearest to (x, y), this one or one of the next; returns how far along it that is."""
        ahead = range(self.segment, min(self.segment + _SEGMENTS_AHEAD, len(self.points) - 1))
        nearest = [(*_project(x, y, *self.points[segment : segment + 2]), segment) for segment in ahead]
        if not nearest:
            return 0.0
        _, along, self.segment = min(nearest, key=lambda candidate: (candidate[0], -candidate[2]))
        return along


def _filtered(place: float, velocity: float, observed: float) -> float:
    """A coordinate one step on: reckoned from the mean velocity, corrected by the noisy observation."""
    return (1 - _POSITION_GAIN) * (place + reading.STEP_TIME * velocity) + _POSITION_GAIN * observed


def _project(x: float, y: float, start: Point, end: Point) -> Point:
    """The squared distance of (x, y) from the segment between neighbouring centres, and how far along it that is."""
    step_x, step_y = end[0] - start[0], end[1] - start[1]
    along = min(max((x - start[0]) * step_x + (y - start[1]) * step_y, 0.0), 1.0)
    return (x - start[0] - along * step_x) ** 2 + (y - start[1] - along * step_y) ** 2, along


class ClosedLoopPlanner:
    """Pure pursuit of a path planned from the cell it believes to be in, once a context."""

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> ClosedLoopPlanner:
        """`seed` and `checkpoint` have no meaning here."""
        return cls()

    def __init__(self):
        self._begins = np.zeros(0, dtype=bool)

    @staticmethod
    def context_size(size: int) -> int:
        """The map at full resolution."""
        return size

    def initial_state(self, batch_size: int) -> list[_Pilot]:
        """Pilots that know nothing yet."""
        self._begins = np.ones(batch_size, dtype=bool)
        return [_Pilot() for _ in range(batch_size)]

    def seed_episodes(self, seeds: np.ndarray, mask: np.ndarray) -> None:
        """Notes where an episode, not only a leg, begins: there the body stands in the start cell's centre."""
        self._begins = mask.copy()

    def act(
        self, observation: Observation, is_first: np.ndarray, state: list[_Pilot], explore: bool = False
    ) -> tuple[np.ndarray, list[_Pilot]]:
        """Actions `[B]`, one environment after the other."""
        begins, self._begins = self._begins, np.zeros_like(is_first)
        size = observation["context"].shape[-1]
        actions = np.zeros(len(state), dtype=np.int64)
        for slot, values in enumerate(observation["state"].tolist()):
            context = observation["context"][slot]
            if begins[slot]:
                state[slot] = _Pilot()
            pilot = state[slot]
            pilot.localize(values, reading.marked_cell(context[reading.START]), size)
            if is_first[slot]:
                path = reading.plan(context, _nearest_free(context, pilot.position, size))
                pilot.points, pilot.segment = [reading.centre(cell, size) for cell in path], 0
            actions[slot] = pilot.action(values)
        return actions, state


def _nearest_free(context: np.ndarray, position: Point, size: int) -> Cell:
    """The cell of `position`, or the marked start where the shown map has a wall there."""
    cell = reading.cell_of(*position, size)
    return reading.marked_cell(context[reading.START]) if context[reading.GLOBAL_MAP][cell] > 0.5 else cell
