"""Navigators that the metrics refer to: told all walls once blocked, without memory, and without waiting."""

from __future__ import annotations

import dataclasses

import numpy as np

from mazebench.agent import Inputs
from mazebench.errors import UnplayableError
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START

from ..robot.cells import marked_cell
from ..robot.occupancy import SURE
from ..robot.planning import plan
from .navigator import Navigator, Robot


class NavigatorTold(Navigator):
    """Follows the map until it sees a wall on the path that it planned at the start; then it knows all walls.

    It plays where the map lies as the maze does, with a pixel per cell and the start marked.
    """

    needs_truth = True
    needs_shown = ("map", "goal")

    def estimate(self, robot: Robot, inputs: Inputs, slot: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns the shown walls, or the true ones once it is blocked, and the goal."""
        assert inputs.truth is not None, "an evaluation gives the truth to a class that declares needs_truth"
        memory, true_walls = robot.memory, inputs.truth.walls[slot].astype(float)
        context = inputs.observation["context"][slot].astype(float)
        walls, goal = context[GLOBAL_MAP], context[GOAL]
        if len(memory.belief.placements) > 1 or walls.shape != true_walls.shape:
            raise UnplayableError(
                "agent 'navigator-told': expected a map that lies as the maze does; play --track rebuilt"
            )
        path = plan(walls, goal, marked_cell(context[START]), memory.cell_size)
        is_blocked = (memory.evidence[tuple(np.transpose(path))] >= SURE).any()
        return (true_walls if is_blocked else walls), goal


class NavigatorWithoutMemory(Navigator):
    """Drives as the navigator, but forgets the walls that it has seen where a leg to another goal begins."""

    def act(
        self, inputs: Inputs, state: list[Robot | None], explore: bool = False
    ) -> tuple[np.ndarray, list[Robot | None]]:
        """Returns actions `[B]`, by robots that keep no more than their pose from the leg before."""
        for slot, robot in enumerate(state):
            if robot is not None and inputs.new_context[slot]:
                state[slot] = Robot(dataclasses.replace(robot.memory))
        return super().act(inputs, state, explore)


class NavigatorWithoutWaiting(Navigator):
    """Drives as the navigator, but takes each wall that it sees for one that stays."""

    waits = False
