"""The map that the agent is shown in an episode, and the context of a leg on it."""

from __future__ import annotations

import numpy as np

from mazebench.maps.maze import Cell, path_through_walls
from mazebench.tasks.context import GLOBAL_MAP, GOAL, LOCAL_MAP, build_context
from mazebench.tasks.episode import Episode, goals_of, perturbations_of
from mazebench.tasks.perturbations.perturbation import Of, ShownMap
from mazebench.tasks.task import Task

_GREY_LEVELS = np.float32(255)
_PLANES = {"map": (GLOBAL_MAP, LOCAL_MAP), "goal": (GOAL,)}  # of the context, by what `hide` names


def show_map(task: Task, episode: Episode) -> ShownMap:
    """Returns the map that the agent is shown in `episode`."""
    maze = task.mazes[episode.maze]
    walls = maze.walls if task.arena.shown is None else task.arena.shown[episode.maze].walls
    shown = ShownMap(walls, kind=maze.kind, cell_size=maze.cell_size)
    ends = (episode.start, *goals_of(task, episode))
    for perturbation, rng in perturbations_of(task, episode, Of.MAP, Of.BUILDING):
        shown = perturbation.shown(shown, ends, rng)
    return shown


def is_blocked(walls: np.ndarray, shown: np.ndarray, ends: tuple[Cell, Cell]) -> bool:
    """Returns whether a shortest path on the shown map leads through a wall of the world; both `[N, N]` bool."""
    return bool(walls[tuple(np.transpose(path_through_walls(shown, *ends)))].any())


def leg_context(task: Task, shown: ShownMap, start: Cell, goal: Cell) -> np.ndarray:
    """Returns `[4, M, M]` float32: the context of the leg between two cells of the maze (see `build_context`).

    On a track, the values of the maps have 8 bits.
    """
    context = build_context(shown.seen_walls, shown.seen_cell(start), shown.seen_cell(goal), task.context_size)
    if task.options.track is not None:
        maps = context[[GLOBAL_MAP, LOCAL_MAP]]
        context[[GLOBAL_MAP, LOCAL_MAP]] = np.rint(maps * _GREY_LEVELS) / _GREY_LEVELS
    for plane in (*shown.hidden, *(plane for name in task.options.hide for plane in _PLANES[name])):
        context[plane] = 0
    return context
