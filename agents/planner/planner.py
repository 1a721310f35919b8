"""The paper's hard-coded strategy: plan once, then for each cell turn to it, drive straight, stop in it.

Zhao & Wong, appendix on robustness: it changes its orientation to the next target, moves forward along that direction,
and stops in the target cell. Unlike MMN it is given the scale of the map and a position on it. It is rigid on purpose:
it neither aims again on the way nor plans again, so it fails where its position is noisy.
"""

from __future__ import annotations

import dataclasses
import math
import pathlib
from typing import Self

import numpy as np

from mazebench.agent import Agent, Inputs, Interface
from mazebench.errors import UnplayableError
from mazebench.maps.maze import Cell, cell_to_point, path_through_walls
from mazebench.tasks.context import GLOBAL_MAP, GOAL
from mazebench.world.angles import wrap_angle
from mazebench.world.bodies import SLIDER, Body

from ..robot.cells import marked_cell, nearest_cell, start_cell
from ..robot.moving_body import FORWARD, LOOK_LEFT, LOOK_RIGHT, MovingBody, observed_body


class MapPlanner(Agent):
    """The base of agents that plan on the cells of the shown map."""

    needs_shown = ("map", "goal")

    def __init__(self, cells_per_metre: float = 1.0, kind: str = "six", body: Body = SLIDER):
        self._cells_per_metre = cells_per_metre  # of the map that the context shows
        self._kind, self._body = kind, body  # the kind of the actions, and what they move

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns a planner for the scale of the map, which follows from M, N and the size of a cell."""
        scale = interface.context_size / (interface.size * interface.cell_size)
        return cls(scale, interface.actions, interface.body)

    @classmethod
    def read_sensors(cls, sensors: tuple[str, ...]) -> tuple[str, ...]:
        """Returns none: it drives by the pose."""
        return ()

    @classmethod
    def context_size(cls, size: int) -> int:
        """Returns N: the map at full resolution, whose cells are waypoints."""
        return size


def plan(context: np.ndarray, start: Cell) -> list[Cell]:
    """Returns a shortest path from `start` to the marked goal on the map of a context `[4, M, M]`."""
    return path_through_walls(context[GLOBAL_MAP] > 0.5, start, marked_cell(context[GOAL]))


@dataclasses.dataclass
class _Plan:
    """The path of one environment's body, and how far along it the body is."""

    path: list[Cell]
    next: int = 1  # index in `path` of the cell it drives to
    turns: int = 0  # look actions still to take, positive to the left

    @property
    def target(self) -> Cell:
        """The cell it drives to; on a warped map the path may be a single cell."""
        return self.path[min(self.next, len(self.path) - 1)]

    def aim(self, body: MovingBody, size: int) -> None:
        """Sets the turns that point the body at the target from where it will come to rest."""
        (target_x, target_y), (x, y) = cell_to_point(self.target, size), body.rest()
        bearing = math.atan2(target_y - y, target_x - x)
        self.turns = round(wrap_angle(bearing - body.yaw) / body.model.turn_step)

    def action(self, body: MovingBody, size: int) -> int:
        """Turns as aimed, drives until the observed position is in the target, then aims at the next cell."""
        arrived = not self.turns and nearest_cell(body.x, body.y, size) == self.target
        if arrived and self.next < len(self.path) - 1:
            self.next += 1
            self.aim(body, size)
        if not self.turns:
            return FORWARD
        left = self.turns > 0
        self.turns -= 1 if left else -1
        return LOOK_LEFT if left else LOOK_RIGHT


class Planner(MapPlanner):
    """Drives open loop between the cells of a path that is planned once a context."""

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns a planner, see `MapPlanner`; raises `UnplayableError` for a body whose turns are no whole looks."""
        if not interface.body.strafes:
            raise UnplayableError(f"agent 'planner': turns by whole looks, found the body {interface.body.name!r}")
        return super().build(interface, seed=seed, checkpoint=checkpoint)

    def initial_state(self, batch_size: int) -> list[_Plan]:
        """Returns plans that `act` replaces where a context is new."""
        return [_Plan([]) for _ in range(batch_size)]

    def act(self, inputs: Inputs, state: list[_Plan], explore: bool = False) -> tuple[np.ndarray, list[_Plan]]:
        """Returns actions `[B]`, planned for one environment after the other."""
        contexts = inputs.observation["context"]
        size = contexts.shape[-1]
        states = inputs.observation["state"].tolist()
        bodies = [observed_body(self._body, values, self._cells_per_metre) for values in states]
        for slot in np.flatnonzero(inputs.new_context):
            state[slot] = _Plan(plan(contexts[slot], start_cell(contexts[slot])))
            state[slot].aim(bodies[slot], size)
        return np.array([each.action(body, size) for each, body in zip(state, bodies, strict=True)]), state
