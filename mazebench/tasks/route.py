"""The cells that an agent is sent to, and the rules of when the next one comes and when the episode ends."""

from __future__ import annotations

import dataclasses
import enum
import functools

import numpy as np

from mazebench.maps.maze import Cell, Maze, path_through_walls
from mazebench.tasks.episode import Episode, draw_goal, goals_of
from mazebench.tasks.perturbations.perturbation import ShownMap
from mazebench.tasks.streams import Stream
from mazebench.tasks.task import Task
from mazebench.tasks.time_limit import default_time_limit
from mazebench.world.bodies import Body

# What an agent step led to.
Event = enum.Enum("Event", ["NONE", "LANDMARK", "REACHED", "TIMEOUT"])


class Route:
    """The start, the landmarks (none in a local episode) and the goal of an episode, and the leg that is under way.

    Leg i goes from cell i to cell i + 1. With `later`, other goals follow: when one is reached or times out, the next
    leg starts in the body's cell.
    """

    def __init__(self, cells: list[Cell], time_limit: int, later: _LaterLegs | None = None):
        self.cells = cells
        self.leg = 0  # counted from 0
        self._first = 0  # index in `cells` of the current leg's start
        self._later = later
        self.deadline = time_limit  # the episode's step after which the current leg has timed out
        self.time_limit = time_limit  # agent steps of the current leg

    @property
    def start(self) -> Cell:
        """The cell in which the current leg starts."""
        return self.cells[self._first]

    @property
    def target(self) -> Cell:
        """The cell to which the current leg leads."""
        return self.cells[self._first + 1]

    @property
    def goal(self) -> Cell:
        """The cell to which the episode leads."""
        return self.cells[-1]

    def advance(self, cell: Cell, step: int) -> Event:
        """Returns what agent step `step` (counted from 1) led to, with the body's centre in `cell` after it.

        A goal that is reached on the step of the time limit is reached. After LANDMARK the leg is the next one.
        """
        if cell != self.target and cell != self.goal and step < self.deadline:
            return Event.NONE
        if self._later is not None and self._later.num_left:
            goal, self.time_limit = self._later.next(cell)
            self.cells = [cell, goal]
        elif cell == self.goal:
            return Event.REACHED
        elif self.target == self.goal:
            return Event.TIMEOUT
        else:
            self._first += 1
        self.leg += 1
        self.deadline = step + self.time_limit
        return Event.LANDMARK


def plan_route(task: Task, episode: Episode, shown: ShownMap) -> Route:
    """Returns the route of an episode; in the hierarchical task its landmarks are planned on the shown map.

    Landmarks are cells of the maze, so they are planned before the change of perspective.
    """
    maze, options = task.mazes[episode.maze], task.options
    if not options.is_hierarchical:
        _, *later = goals_of(task, episode)
        num_left, joined = options.num_goals - 1, task.arena.joined(episode.maze)
        limits = task.body, options.track, options.time_limit
        legs = _LaterLegs(num_left, maze, *limits, later, task.distances, joined, episode)
        return Route([episode.start, episode.goal], legs.limit(episode.start, episode.goal), legs)
    path = path_through_walls(shown.walls, episode.start, episode.goal)
    assert options.time_limit is not None  # a task that is no track has one
    return Route([*path[: -1 : options.landmark_distance], path[-1]], options.time_limit)


@dataclasses.dataclass
class _LaterLegs:
    """The goals of one episode after the first one, with the time limits of their legs."""

    num_left: int
    maze: Maze
    body: Body
    track: str | None
    time_limit: int | None  # agent steps of all legs; None on a track, whose limits follow from the distances
    goals: list[Cell]  # those that were drawn before the episode; others are drawn where their legs start
    distances: tuple[int, ...]  # in cells, one of which is drawn for each goal
    joined: np.ndarray | None  # [N, N] bool, cells that an older map joins; None without one
    episode: Episode

    @functools.cached_property
    def _rng(self) -> np.random.Generator:  # most episodes draw no goal in their course, and it takes long to make
        return self.episode.stream(Stream.LATER_GOALS)

    def next(self, start: Cell) -> tuple[Cell, int]:
        """Returns the goal and the time limit of the next leg, which begins in cell `start`."""
        self.num_left -= 1
        goal = self.goals.pop(0) if self.goals else draw_goal(self.maze, self.distances, start, self._rng, self.joined)
        return goal, self.limit(start, goal)

    def limit(self, start: Cell, goal: Cell) -> int:
        """Returns the time limit of a leg."""
        return self.time_limit or default_time_limit(
            self.maze.distance(start, goal), self.maze.cell_size, self.body, track=self.track
        )
