"""The oracle: what a driver reaches that knows the true maze, its true pose and how the body moves."""

from __future__ import annotations

import dataclasses
import math
import pathlib
from typing import ClassVar, Self

import numpy as np

from mazebench.agent import Agent, Inputs, Interface
from mazebench.world.bodies import SLIDER, Body

from ..robot.any_body import Motions, motions_after, quickest
from ..robot.quickest import Course, make_course
from .door_drive import DoorDrive, Policy

_MAX_OFF = 0.1  # m from where the drive should be, before it is planned anew


@dataclasses.dataclass
class _Drive:
    """The rest of a drive in one environment."""

    goal: tuple[int, int]  # row, column
    course: Course
    actions: list[int] = dataclasses.field(default_factory=list)
    motions: Motions = dataclasses.field(default_factory=Motions)  # an episode begins at rest
    poses: list[tuple[float, float, float]] = dataclasses.field(default_factory=list)  # where each action begins


class Oracle(Agent):
    """The quickest drive on the true walls, from the true pose to the goal; it ignores landmarks.

    Where doors move, it knows when, and waits where that is quicker.
    """

    needs_truth = True
    policy: ClassVar[Policy] = Policy.KNOWS  # where doors move

    def __init__(self, cell_size: float = 1.0, body: Body = SLIDER):
        self._cell_size, self._body = cell_size, body

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns an oracle for the width of the mazes' cells and the body."""
        return cls(interface.cell_size, interface.body)

    def initial_state(self, batch_size: int) -> list[_Drive | DoorDrive | None]:
        """Returns nothing yet: a drive begins with an episode."""
        return [None] * batch_size

    def act(
        self, inputs: Inputs, state: list[_Drive | DoorDrive | None], explore: bool = False
    ) -> tuple[np.ndarray, list[_Drive | DoorDrive | None]]:
        """Returns actions `[B]`, planned for one environment after the other where an episode begins."""
        truth = inputs.truth
        assert truth is not None, "an evaluation gives the truth to a class that declares needs_truth"
        actions = np.zeros(len(state), dtype=np.int64)
        running = np.ones(len(state), dtype=bool) if inputs.active is None else inputs.active
        for slot in np.flatnonzero(running).tolist():
            x, y, yaw = truth.pose[slot].tolist()
            drive, goal = state[slot], tuple(truth.goal[slot].tolist())
            if truth.doors is not None and (schedule := truth.doors[slot]) is not None:
                if not isinstance(drive, DoorDrive) or inputs.new_episode[slot]:
                    drive = DoorDrive(self._body, self._cell_size, schedule, truth.walls[slot], self.policy)
                    state[slot] = drive
                actions[slot] = drive.act((x, y), yaw, goal)
                continue
            assert not isinstance(drive, DoorDrive), "doors move in all episodes of an environment or in none"
            if drive is None or inputs.new_episode[slot] or goal != drive.goal:
                # To a goal that follows another one, the drive goes on at the speed that it has.
                motions = Motions() if drive is None or inputs.new_episode[slot] else drive.motions
                course = make_course(self._body, truth.walls[slot], self._cell_size, goal)
                drive = state[slot] = _Drive(goal, course, motions=motions)
            if not drive.actions or math.dist(drive.poses[0][:2], (x, y)) > _MAX_OFF:
                drive.actions, poses = quickest(drive.course, (x, y), drive.motions, yaw)
                drive.poses = [(x, y, yaw), *poses]
            actions[slot] = action = drive.actions.pop(0)
            drive.poses.pop(0)
            # Computed, and not observed: what is observed may be wrong.
            drive.motions = motions_after(drive.course, (x, y), drive.motions, yaw, action)
        return actions, state


class HurryingOracle(Oracle):
    """Knows when doors move, but does not wait for one unless there is no other way."""

    policy = Policy.HURRIES


class WaitingDriver(Oracle):
    """Knows the map and its pose, but not when doors move: it waits at each closed door on the shortest way."""

    policy = Policy.WAITS
