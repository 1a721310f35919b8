"""The mazes of results as they really were, and where start and goal lie on the maps that agents were shown."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mazebench.maps.benchmark import load_kind_mazes, load_mazes
from mazebench.maps.maze import Cell, Maze
from mazebench.report.episodes import ReportedResult
from mazebench.report.settings import known_levels
from mazebench.tasks.build import make_spec
from mazebench.tasks.episode import Episode
from mazebench.tasks.shown_map import show_map


def real_walls(result: ReportedResult, maze: str, results: Sequence[ReportedResult]) -> np.ndarray | None:
    """Returns `[N, N]` bool: the true maze.

    None for a maze that is not the benchmark's, unless one of `results` recorded its cells: with an exact map, or with
    one that was drawn.
    """
    setting = result.setting
    if setting.split != "custom":
        mazes = load_kind_mazes(setting.split) if setting.track else load_mazes(setting.size, setting.split)
        return next((known.walls for known in mazes if known.name == maze), None)
    for other in results:
        is_same = (other.setting.mazes, other.setting.size) == (setting.mazes, setting.size)
        if not is_same or other.trajectories is None:
            continue
        if other.setting.is_exact or other.trajectories.picture is not None:
            episode = np.flatnonzero(other.episodes.maze == maze)[0]
            return other.trajectories[int(episode)].shown
    return None


def shown_ends(result: ReportedResult, results: Sequence[ReportedResult]) -> tuple[list[Cell], list[Cell]] | None:
    """Returns the cells of the recorded shown maps in which each episode's start and goal lie.

    None where the shown maps have the true maze's frame, so that a cell of one is the same cell of the other.
    """
    setting = result.setting
    if not setting.perturbations:
        return None
    mazes = []
    names = result.episodes.maze.unique().tolist()
    for name in names:
        walls = real_walls(result, name, results)
        mazes.append(Maze(_open_room(setting.size) if walls is None else walls, name))
    task = make_spec(setting.task, maps=mazes, distances=(1,), **known_levels(dict(setting.perturbations)))
    starts, goals = [], []
    is_same = True
    episodes = result.episodes
    for maze, start, goal, seed in zip(*(episodes[name] for name in ("maze", "start", "goal", "seed")), strict=True):
        shown = show_map(task, Episode(names.index(maze), start, goal, 0.0, seed))
        is_same &= shown.drawing is None
        starts.append(shown.seen_cell(start))
        goals.append(shown.seen_cell(goal))
    return None if is_same else (starts, goals)


def _open_room(size: int) -> np.ndarray:
    """Returns `[N, N]` bool: a maze whose walls are not known; where a cell is shown does not depend on them."""
    walls = np.ones((size, size), dtype=bool)
    walls[1:-1, 1:-1] = False
    return walls
