"""The figure of trajectories in hierarchical navigation that the paper has: a row per agent, a column per episode."""

from __future__ import annotations

import textwrap

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from mazebench.maps import colors
from mazebench.maps.maze import cell_to_point
from mazebench.report.episodes import ReportedResult
from mazebench.report.figures import WIDTH, Drawn
from mazebench.report.tables import DEFAULT_LANDMARK_DISTANCE

# Without the palest yellow, which is invisible on white. The page has the same.
TIME_COLORS = ListedColormap(mpl.colormaps["plasma"](np.linspace(0, 0.92, 256)))

_CELL_COLORS = ListedColormap(["#ffffff", "#4a4e57", "#c9dcec"])  # floor, wall, landmark
_MAX_ROWS, _MAX_COLUMNS = 8, 5  # agents and episodes
_NOTE = (
    "We picked the episodes in which the agents differ most. They are not a random sample. A path leads from the green "
    "disc to the red star; it is violet at the start and yellow at the end. Light blue cells are landmarks."
)


def draw_trajectories(episodes: pd.DataFrame) -> list[Drawn]:
    """Returns the figure of the first eight agents in the smallest mazes, with exact maps; none without any paths."""
    has_paths = episodes.result.map(lambda result: result.trajectories is not None)
    usual = episodes.is_exact & episodes.landmark_distance.eq(DEFAULT_LANDMARK_DISTANCE) & episodes.mazes.eq("")
    episodes = episodes[has_paths & usual]
    episodes = episodes[episodes["size"] == episodes["size"].min()]
    labels = episodes.label.unique()[:_MAX_ROWS]

    # Trials of all agents in which they differ most.
    shown = episodes[episodes.label.isin(labels)]
    found = shown.groupby("trial").agg(agents=("label", "nunique"), reached=("success", "mean"))
    everyones = found[found.agents == found.agents.max()]
    trials = sorted((everyones.reached - 0.5).abs().nsmallest(_MAX_COLUMNS).index)
    if not trials:
        return []

    title = f"Trajectories: {episodes.setting.iloc[0]}"
    width = max(len(trials), 3) * WIDTH / _MAX_COLUMNS
    figure = Figure(figsize=(width, 0.5 + len(labels) * (WIDTH / _MAX_COLUMNS + 0.2)), layout="constrained")
    figure.suptitle(title, fontsize=10)
    grid = figure.subplots(len(labels), len(trials), squeeze=False)
    for label, row in zip(labels, grid, strict=True):
        row[0].set_ylabel(textwrap.fill(label, 20), fontsize=8)
        own = episodes[episodes.label == label].set_index("trial")
        for trial, axes in zip(trials, row, strict=True):
            _draw_episode(axes, own.loc[trial])
    return [Drawn("trajectories-hierarchical", title, _NOTE, figure)]


def _draw_episode(axes: Axes, episode: pd.Series) -> None:
    """Draws the maze, landmarks, start, goal, and the path."""
    result: ReportedResult = episode.result
    assert result.trajectories is not None
    cells = result.walls[episode.maze].astype(int)
    size = len(cells)
    cells.flat[result.shown[episode.number].landmarks] = 2
    axes.imshow(cells, cmap=_CELL_COLORS, vmin=0, vmax=2, extent=(0, size, 0, size), interpolation="none")
    x, y, _ = result.trajectories[episode.number].pose.T
    axes.scatter(x, y, s=1.5, c=range(len(x)), cmap=TIME_COLORS)
    for cell, marker, color, width in ((episode.start, "o", colors.START, 4.5), (episode.goal, "*", colors.GOAL, 7.5)):
        axes.plot(*cell_to_point(cell, size), marker=marker, color=color, markersize=width, markeredgecolor="white")
    axes.set(xticks=[], yticks=[])
    axes.set_title(f"maze {episode.maze}", fontsize=7.5)
    axes.set_xlabel(f"{'✓' if episode.success else '✗ failed,'} {episode.steps} steps", fontsize=7)
