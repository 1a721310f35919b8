"""Figures of trajectories: a row for each agent, a column for each episode, the paths on the mazes."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mazebench.maps import colors
from mazebench.maps.maze import cell_to_point
from mazebench.report.episodes import ReportedResult, settings_of
from mazebench.report.figures import WIDTH, Drawn
from mazebench.report.tables import maze_sets, perturbed_groups
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import TRACKS

# The page has the same: floor, wall, wall that only the map shows, wall that the map does not show, landmark.
CELL_COLORS = {
    "floor": "#ffffff",
    "wall": "#4a4e57",
    "false-wall": "#f6c7a1",
    "lost-wall": "#a99bc4",
    "landmark": "#c9dcec",
}
# Without the palest yellow, which is invisible on white.
TIME_COLORS = ListedColormap(mpl.colormaps["plasma"](np.linspace(0, 0.92, 256)))

_CELL_COLORS = ListedColormap(list(CELL_COLORS.values()))
_MAX_ROWS, _MAX_COLUMNS = 8, 5  # agents and episodes
_NOTE = (
    "We picked the episodes in which the agents differ most, from different mazes if possible. "
    "They are not a random sample. A path is violet at the start and yellow at the end."
)


def draw_trajectories(episodes: pd.DataFrame) -> Iterator[Drawn]:
    """Yields a figure of each task, and of each perturbation and track at a middle level, for each set of mazes.

    Of several sizes, the smallest is taken; of more than eight agents, the first eight.
    """
    has_paths = episodes.result.map(lambda result: result.trajectories is not None)
    for here, prefix, _ in maze_sets(episodes[has_paths & (episodes.split != "train")]):
        for setting in _pick_settings(here):
            own = here[here.setting == setting]
            labels = own.label.unique()[:_MAX_ROWS]
            chosen = _pick_trials(own[own.label.isin(labels)])
            if chosen:
                title = f"Trajectories: {setting}"
                figure = _draw(title, own[own.trial.isin(chosen)], labels)
                yield Drawn(f"trajectories-{prefix}{setting.slug}", title, _NOTE, figure)


def _pick_settings(episodes: pd.DataFrame) -> Iterator[TaskOptions]:
    settings = settings_of(episodes)
    for task in ("hierarchical", "local"):
        plain = [setting for setting in settings if setting.task == task and setting.is_exact]
        if plain:
            yield min(plain, key=lambda setting: (setting.size, -setting.landmark_distance))
    groups = [[each for each in settings_of(group) if each != base] for _, base, group in perturbed_groups(episodes)]
    groups += [[setting for setting in settings if setting.track == track] for track in TRACKS]
    for group in filter(None, groups):
        yield group[(len(group) - 1) // 2]


def _pick_trials(episodes: pd.DataFrame) -> list[int]:
    """Returns trials of all agents: those in which they differ most, then the farthest, from different mazes."""
    found = episodes.groupby("trial").agg(
        maze=("maze", "first"), distance=("distance", "first"), agents=("label", "nunique"), reached=("success", "sum")
    )
    found = found[found.agents == found.agents.max()]
    found["evenness"] = np.minimum(found.reached, found.agents - found.reached)
    found = found.sort_values(["evenness", "distance"], ascending=False, kind="stable")
    turn = found.groupby("maze").cumcount()  # first one of each maze, then second ones
    return sorted(turn.sort_values(kind="stable").index[:_MAX_COLUMNS])


def _draw(title: str, episodes: pd.DataFrame, labels: Sequence[str]) -> Figure:
    """Draws a row for each agent."""
    trials = sorted(episodes.trial.unique())
    width = max(len(trials), 3) * WIDTH / _MAX_COLUMNS
    figure = Figure(figsize=(width, 0.8 + len(labels) * (WIDTH / _MAX_COLUMNS + 0.2)), layout="constrained")
    figure.suptitle(textwrap.fill(title, int(13 * width)), fontsize=10)
    grid = figure.subplots(len(labels), len(trials), squeeze=False)
    for label, row in zip(labels, grid, strict=True):
        own = episodes[episodes.label == label].set_index("trial")
        for trial, axes in zip(trials, row, strict=True):
            _draw_episode(axes, own.loc[trial])
        row[0].set_ylabel(textwrap.fill(label, 20), fontsize=8)
    for trial, axes in zip(trials, grid[0], strict=True):
        maze = episodes.maze[episodes.trial == trial].iloc[0]
        axes.set_title(textwrap.fill(f"maze {maze}", 20), fontsize=7.5)
    names = {"landmark": 4, "wall on the map only": 2, "wall missing on the map": 3}
    marks: list[tuple[str, str, Any]] = [("start", "o", colors.START), ("goal", "*", colors.GOAL)]
    marks += [(name, "s", _CELL_COLORS(index)) for name, index in names.items()]
    handles = [
        Line2D([], [], linestyle="", marker=marker, color=color, markersize=6, label=name)
        for name, marker, color in marks
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return figure


def _draw_episode(axes: Axes, episode: pd.Series) -> None:
    """Draws the maze, the cells in which its map differs, landmarks, start, goal, and the path."""
    result: ReportedResult = episode.result
    walls = result.walls(episode.maze)
    assert result.trajectories is not None
    assert walls is not None
    size, shown = len(walls), result.shown[episode.number]
    cells = walls.astype(int)
    if shown.are_cells:  # another frame than the maze's would make the comparison meaningless
        cells[shown.walls & ~walls] = 2
        cells[~shown.walls & walls] = 3
    for landmark in shown.landmarks:
        cells[divmod(landmark, size)] = 4
    axes.imshow(cells, cmap=_CELL_COLORS, vmin=0, vmax=4, extent=(0, size, 0, size), interpolation="none")
    points = result.trajectories[episode.number].pose[:, :2].astype(np.float64) / (result.setting.cell_size or 1.0)
    segments = np.stack([points[:-1], points[1:]], axis=1)
    path = LineCollection(list(segments), cmap=TIME_COLORS, linewidths=1.3, capstyle="round", zorder=3)
    path.set_array(np.linspace(0, 1, len(segments)))
    axes.add_collection(path, autolim=False)
    edge: dict[str, Any] = {"markeredgecolor": "white", "markeredgewidth": 0.6, "zorder": 4}
    for cell, marker, color, width in ((episode.start, "o", colors.START, 4.5), (episode.goal, "*", colors.GOAL, 7.5)):
        axes.plot(*cell_to_point(cell, size), marker=marker, color=color, markersize=width, **edge)
    axes.set(xticks=[], yticks=[])
    axes.set_xlabel(f"{'✓' if episode.success else '✗ failed,'} {episode.steps} steps", fontsize=7)
