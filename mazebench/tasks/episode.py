"""An episode of a task, and how episodes are drawn."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.drawn import FreshMazes
from mazebench.maps.maze import Cell, Maze
from mazebench.maps.moving_doors import moving_doors
from mazebench.tasks.perturbations.moving_doors import doors_on_way
from mazebench.tasks.perturbations.perturbation import Of, Perturbation
from mazebench.tasks.schedule import Schedule, braking_way
from mazebench.tasks.streams import Stream
from mazebench.tasks.task import Task
from mazebench.tasks.tracks import LEVELS, TRACKS

_SEEDS = 2**31
_MAX_TRIES = 1000
_MAX_REDRAWS = 100  # of a fresh maze, for an episode, and of a pair between which no door closes
_FIXED_PAIR_SEED = 20210  # of the pairs of the extremely-low-data regime; any number, chosen once


@dataclasses.dataclass(frozen=True)
class Episode:
    """The values that determine an episode of a given task.

        >>> env = mazebench.make("local", size=13, split="train")
        >>> episode = mazebench.Episode(maze=0, start=(1, 1), goal=(3, 1), yaw=0.0, seed=7)
        >>> observation, info = env.reset(options={"episode": episode})

    Cells are (row, column) from the top left.
    """

    maze: int  # index among the task's mazes
    start: Cell
    goal: Cell
    yaw: float  # rad, of the body at the start
    seed: int  # of everything else that is drawn in the episode: perturbations, and goals after the first one

    def stream(self, stream: Stream | None) -> np.random.Generator:
        """Returns a new generator of a random stream; different streams are independent."""
        key = () if stream is None else (int(stream),)
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))


def episode_level(task: Task, episode: Episode) -> int:
    """Returns the level of the track at which `episode` is played."""
    if len(task.levels) < 2:
        return task.levels[0] if task.levels else LEVELS[0]
    return task.levels[int(episode.stream(Stream.LEVEL).integers(len(task.levels)))]


def perturbations_of(task: Task, episode: Episode, *things: Of) -> Iterator[tuple[Perturbation, np.random.Generator]]:
    """Yields the perturbations of some things in `episode`, as they apply, each with a generator of its stream."""
    for perturbation in task.perturbations(episode_level(task, episode)):
        if perturbation.of in things:
            yield perturbation, episode.stream(perturbation.stream)


def schedule_of(task: Task, episode: Episode) -> Schedule | None:
    """Returns the schedule of the doors in an episode; None where none moves."""
    maze = task.mazes[episode.maze]
    for perturbation, rng in perturbations_of(task, episode, Of.DOORS):
        times = perturbation.times(maze, (episode.start, *goals_of(task, episode)), rng)
        return Schedule(moving_doors(maze), times, braking_way(task.body), maze.size, maze.cell_size)
    return None


def goals_of(task: Task, episode: Episode) -> tuple[Cell, ...]:
    """Returns the goals of an episode that are known before it begins: on a track all of them, else the first one.

    On a track, each goal after the first one is drawn from the goal before it, so that the shown map can keep all free.
    """
    if task.options.track is None or task.options.num_goals == 1:
        return (episode.goal,)
    goals, rng = [episode.goal], episode.stream(Stream.LATER_GOALS)
    while len(goals) < task.options.num_goals:
        maze, joined = task.mazes[episode.maze], task.arena.joined(episode.maze)
        goals.append(draw_goal(maze, task.distances, goals[-1], rng, joined))
    return tuple(goals)


def draw_goal(
    maze: Maze, distances: tuple[int, ...], start: Cell, rng: np.random.Generator, joined: np.ndarray | None
) -> Cell:
    """Draws a goal at one of some distances (cells) from `start`, or as near to it as there is one.

    It is among the cells `joined` (`[N, N]` bool) unless that is None.
    """
    away = maze.distances(start)
    away = away if joined is None else np.where(joined, away, -1)
    there = np.unique(away[away > 0])
    distance = there[np.abs(there - distances[rng.integers(len(distances))]).argmin()]
    goals = np.argwhere(away == distance)  # in reading order
    row, column = goals[rng.integers(len(goals))]
    return int(row), int(column)


def sample_episode(task: Task, rng: np.random.Generator) -> Episode:
    """Draws an episode of a task; of fresh mazes, in one in which the task can be played.

    Raises:
      InputError: if no such maze is found.
    """
    for _ in range(_MAX_REDRAWS if isinstance(task.mazes, FreshMazes) else 0):
        with contextlib.suppress(InputError):
            return _sample_episode(task, rng)
    return _sample_episode(task, rng)


def _sample_episode(task: Task, rng: np.random.Generator) -> Episode:
    index = int(rng.integers(len(task.mazes)))
    maze = task.mazes[index]
    if task.options.track is not None and isinstance(task.mazes, FreshMazes):
        TRACKS[task.options.track].require(maze, task.levels)
    start, goal = task.arena.ends(index)
    if start is None or goal is None:
        pair_rng = np.random.default_rng([_FIXED_PAIR_SEED, index]) if task.options.pairs == "fixed" else rng
        distance = task.distances[pair_rng.integers(len(task.distances))]
        start, goal = sample_pair_of(task, index, distance, pair_rng)
    return make_episode(index, start, goal, rng)


def make_episode(maze: int, start: Cell, goal: Cell, rng: np.random.Generator) -> Episode:
    """Returns the episode from `start` to `goal` in maze number `maze`; draws the first heading and the seed."""
    yaw = float(rng.uniform(-np.pi, np.pi))
    return Episode(maze=maze, start=start, goal=goal, yaw=yaw, seed=int(rng.integers(_SEEDS)))


def sample_pair_of(task: Task, index: int, distance: int, rng: np.random.Generator) -> tuple[Cell, Cell]:
    """Draws a start and a goal in maze number `index` of a task, as `sample_pair` does.

    Where doors move, pairs are drawn until a door on a shortest way between them can close, for some draws.
    """
    maze, ends = task.mazes[index], task.arena.ends(index)
    for _ in range(_MAX_REDRAWS if task.moves_doors else 1):
        pair = sample_pair(maze, distance, rng, *ends, task.arena.joined(index))
        if task.moves_doors and doors_on_way(maze, *pair)[1]:
            break
    return pair


def sample_pair(
    maze: Maze,
    distance: int,
    rng: np.random.Generator,
    start: Cell | None = None,
    goal: Cell | None = None,
    joined: np.ndarray | None = None,
) -> tuple[Cell, Cell]:
    """Draws a start and a goal `distance` cells apart, both among the cells `joined` (`[N, N]` bool) if it is given.

    The start is uniform among the cells that have such a goal, then the goal is uniform among those of the start. If
    one of the two is given, the other is uniform among the cells that far from it; if both are, nothing is drawn.

    Raises:
      InputError: if no two cells of the maze are that far apart.
    """
    if start is not None and goal is not None:
        return start, goal

    def at(cell: Cell) -> np.ndarray:  # [K, 2]
        cells = maze.cells_at(cell, distance)
        return cells if joined is None else cells[joined[tuple(cells.T)]]

    # One is given: draw the other.
    if (given := start or goal) is not None:
        others = at(given)
        if not len(others):
            raise InputError(f"{maze.name}: found no cell {distance} cells from {given}; choose others (--distances)")
        row, column = others[rng.integers(len(others))].tolist()
        return (given, (row, column)) if given is start else ((row, column), given)

    # Draw starts until one has goals.
    starts = maze.free_cells if joined is None else np.argwhere(joined)
    for _ in range(_MAX_TRIES if len(starts) else 0):
        row, column = starts[rng.integers(len(starts))].tolist()
        goals = at((row, column))
        if len(goals):
            goal_row, goal_column = goals[rng.integers(len(goals))].tolist()
            return (row, column), (goal_row, goal_column)
    what = "cells" if joined is None else "cells that are joined on the older map"
    raise InputError(f"{maze.name}: found no two {what} {distance} cells apart; the farthest are {maze.diameter}")


def check_episode(task: Task, episode: Episode) -> Episode:
    """Returns `episode` if it can be played in a task.

    Raises:
      InputError: if there is no such maze, start or goal is not free in it, or not joined with the other on an older
        map that is shown, or they are one cell.
    """
    if not 0 <= episode.maze < len(task.mazes):
        raise InputError(f"expected a maze from 0 to {len(task.mazes) - 1}, found {episode.maze}")
    for cell in (episode.start, episode.goal):
        task.mazes[episode.maze].require_free(cell)
        if (joined := task.arena.joined(episode.maze)) is not None and not joined[cell]:
            raise InputError(f"expected start and goal that are free and joined on the older map, found {cell}")
    if episode.start == episode.goal:
        raise InputError(f"expected a goal in another cell than the start, found both in {episode.goal}")
    return episode
