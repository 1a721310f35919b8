"""An episode: where it plays, what the agent is told of it, and how far along its route it is."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Callable

import numpy as np

from mazebench.maps import perturb
from mazebench.maps.maze import Cell

# What the agent's step brought about.
Event = enum.Enum("Event", ["NONE", "LANDMARK", "REACHED", "TIMEOUT"])


@dataclasses.dataclass(frozen=True)
class Episode:
    """What determines an episode, given the task it belongs to."""

    maze: int  # index among the task's mazes
    start: Cell
    goal: Cell
    yaw: float  # rad, of the body at the start
    seed: int  # of everything else drawn in the episode: flips, warp, noise

    def streams(self) -> list[np.random.Generator]:
        """Four independent streams: of the flipped cells, the warp, the position noise, the goals after the first."""
        return [np.random.default_rng(child) for child in np.random.SeedSequence(self.seed).spawn(4)]


@dataclasses.dataclass(frozen=True)
class ShownMap:
    """The map as the agent gets it: the true one, or flipped, or seen through a perspective transform."""

    walls: np.ndarray  # [N, N] bool, before the transform
    homography: np.ndarray | None = None  # [3, 3], from true cells to shown ones; None if they are the same

    def seen_walls(self) -> np.ndarray:
        """`[N, N]` bool: the walls as they lie on the map that the agent sees."""
        return self.walls if self.homography is None else perturb.warp_walls(self.walls, self.homography)


class Route:
    """The cells an agent is sent to, one after the other, and the rules of when the next one comes and when it ends.

    `cells` are the start, the landmarks (none in a local episode) and the goal. Leg i goes from cell i to cell i + 1.
    With `next_goal`, a route of `num_goals` goals: where one is reached or timed out, the next leg starts in the body's
    cell and leads to the cell that `next_goal` draws for it.
    """

    def __init__(
        self,
        cells: list[Cell],
        time_limit: int,
        num_goals: int = 1,
        next_goal: Callable[[Cell], Cell] | None = None,
    ):
        self.cells = cells
        self.leg = 0  # counted from 0
        self._first = 0  # the current leg starts at this place in `cells`
        self._goals_left = num_goals - 1
        self._next_goal = next_goal
        self.deadline = time_limit  # the episode's step after which the current leg has timed out
        self._time_limit = time_limit

    @property
    def start(self) -> Cell:
        """Where the current leg starts."""
        return self.cells[self._first]

    @property
    def target(self) -> Cell:
        """Where the current leg leads."""
        return self.cells[self._first + 1]

    @property
    def goal(self) -> Cell:
        """Where the episode leads."""
        return self.cells[-1]

    def advance(self, cell: Cell, step: int) -> Event:
        """Judges the state after agent step `step` (counted from 1), the body's centre in `cell`.

        Reaching the goal wins over a time limit met on the same step. After LANDMARK the leg is the next one.
        """
        if cell != self.target and cell != self.goal and step < self.deadline:
            return Event.NONE
        if self._goals_left and self._next_goal is not None:
            self._goals_left -= 1
            self.cells = [cell, self._next_goal(cell)]
        elif cell == self.goal:
            return Event.REACHED
        elif self.target == self.goal:
            return Event.TIMEOUT
        else:
            self._first += 1
        self.leg += 1
        self.deadline = step + self._time_limit
        return Event.LANDMARK
