"""The cells that an agent is sent to, and the rules of when the next one comes and when the episode ends."""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Callable

import numpy as np

from mazebench.maps.maze import Cell, Maze, path_through_walls
from mazebench.tasks.episode import Episode
from mazebench.tasks.perturbations.perturbation import ShownMap
from mazebench.tasks.streams import Stream
from mazebench.tasks.task import Task
from mazebench.tasks.time_limit import default_time_limit

# What an agent step led to.
Event = enum.Enum("Event", ["NONE", "LANDMARK", "REACHED", "TIMEOUT"])


class Route:
    """The start, the landmarks (none in a local episode) and the goal of an episode, and the leg that is under way.

    Leg i goes from cell i to cell i + 1. With `next_goal`, the route has `num_goals` goals: when one is reached or
    times out, the next leg starts in the body's cell and leads to the cell that `next_goal` draws for it.
    """

    def __init__(
        self, cells: list[Cell], time_limit: int, num_goals: int = 1, next_goal: Callable[[Cell], Cell] | None = None
    ):
        self.cells = cells
        self.leg = 0  # counted from 0
        self._first = 0  # index in `cells` of the current leg's start
        self._goals_left = num_goals - 1
        self._next_goal = next_goal
        self.deadline = time_limit  # the episode's step after which the current leg has timed out
        self.time_limit = time_limit  # agent steps of a leg

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
        self.deadline = step + self.time_limit
        return Event.LANDMARK


def plan_route(task: Task, episode: Episode, shown: ShownMap) -> Route:
    """Returns the route of an episode; in the hierarchical task its landmarks are planned on the shown map.

    Landmarks are cells of the maze, so they are planned before the change of perspective.
    """
    maze, options = task.mazes[episode.maze], task.options
    if not options.is_hierarchical:
        time_limit = options.time_limit or default_time_limit(
            maze.distance(episode.start, episode.goal), task.cell_size, track=task.track
        )
        next_goal = None
        if options.num_goals > 1:
            next_goal = _LaterGoals(maze, task.distances, episode.stream(Stream.LATER_GOALS))
        return Route([episode.start, episode.goal], time_limit, options.num_goals, next_goal)
    path = path_through_walls(shown.walls, episode.start, episode.goal)
    assert options.time_limit is not None  # a task that is no track has one
    return Route([*path[: -1 : options.landmark_distance], path[-1]], options.time_limit)


@dataclasses.dataclass
class _LaterGoals:
    """Draws the goals of one episode after the first one."""

    maze: Maze
    distances: tuple[int, ...]  # in cells, one of which is drawn for each goal
    rng: np.random.Generator

    def __call__(self, start: Cell) -> Cell:
        """Draws a goal at one of the distances from `start`, or as near to it as the maze has one."""
        farthest = int(self.maze.distances(start).max())
        distance = min(self.distances[self.rng.integers(len(self.distances))], farthest)
        goals = self.maze.cells_at(start, distance)
        row, column = goals[self.rng.integers(len(goals))]
        return int(row), int(column)
