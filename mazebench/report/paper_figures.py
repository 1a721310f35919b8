"""The figures of the paper besides curves: violins of SPL on imperfect input, and the paths driven in some episodes."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from mazebench.maps import colors
from mazebench.maps.maze import cell_to_point
from mazebench.report.episodes import ReportedResult, at_common_distances
from mazebench.report.figures import STYLE, WIDTH, make_grid, set_ticks
from mazebench.report.tables import DEFAULT_LANDMARK_DISTANCE, note_on_levels, perturbed_groups
from mazebench.results.naming import described

# Without the palest yellow, which is invisible on white; the page has the same.
TIME_COLORS = ListedColormap(mpl.colormaps["plasma"](np.linspace(0, 0.92, 32)))

_OF_VIOLINS = ("map_flip", "position_noise")
_CELL_COLORS = ListedColormap(["#ffffff", "#4a4e57", "#c9dcec"])  # floor, wall, landmark
# The agents of the paper's figures of paths, and the noise (cells) that it draws; others follow, few in all.
_OF_ROUTES, _OF_NOISE, _NOISE = ("mmn", "mah"), ("mmn", "planner"), 0.5
_MAX_ROWS, _MAX_COLUMNS = 4, 5  # agents and episodes
_COLUMNS = ["agent", "maze", "start", "goal", "success", "steps", "path_length", "spl"]
_NOTE = (
    "We picked the episodes in which the agents differ most. They are not a random sample. A path leads from the green "
    "disc to the red star; it is violet at the start and yellow at the end. Light blue cells are landmarks."
)


class Drawn(NamedTuple):
    """A figure with its words and values."""

    name: str  # of its files
    title: str
    note: str
    figure: Figure
    values: pd.DataFrame
    stacks: bool = True  # its panels can stand below one another


@mpl.rc_context(STYLE)
def draw_violins(episodes: pd.DataFrame) -> list[Drawn]:
    """Returns violins of SPL by the strength of a perturbation, with a panel per agent, and their quartiles.

    They are of the benchmark's eval mazes in the episodes of `join_episodes`, as paths are.
    """
    figures = []
    for perturbation, name, group in perturbed_groups(episodes[episodes.mazes == ""]):
        if perturbation not in _OF_VIOLINS:
            continue
        agents = list(at_common_distances(group).groupby("label", observed=True))
        strength_name = perturbation.replace("_", " ")
        title = f"SPL by {strength_name}: {group.task.iloc[0]}"
        figure, grid, _ = make_grid(title, [label for label, _ in agents], 2.1)
        values = []
        for axes, (label, own) in zip(grid, agents, strict=True):
            levels, groups = zip(*own.groupby("strength").spl, strict=True)
            scores, places = [each.to_numpy() for each in groups], range(len(levels))
            axes.violinplot(scores, places, widths=0.8, points=50, showmeans=True, showextrema=False)
            set_ticks(axes, {place: f"{level:g}" for place, level in enumerate(levels)})
            axes.set(xlabel=strength_name, ylabel="SPL", ylim=(-0.05, 1.05), yticks=np.linspace(0, 1, 6))
            values.append(own.groupby("strength").spl.describe().drop(columns="std").assign(agent=label))
        table = pd.concat(values).set_index("agent", append=True).swaplevel().reset_index().round(4)
        note = f"{note_on_levels(perturbation, group)} Dashes: means."
        figures.append(Drawn(f"violins-{name}", title, note, figure, table.astype({"count": int})))
    return figures


def draw_paths(episodes: pd.DataFrame) -> list[Drawn]:
    """Returns the paths driven over landmarks on the exact map, and with noisy positions, where they were recorded."""
    ours = episodes[episodes.mazes.eq("") & episodes.track.eq("")]
    routes = ours[ours.is_exact & ours.landmark_distance.eq(DEFAULT_LANDMARK_DISTANCE)]
    noisy = ours[ours.task.eq("local") & ours.position_noise.eq(_NOISE)]
    return [*_paths("hierarchical", routes, _OF_ROUTES), *_paths("noise", noisy, _OF_NOISE)]


@mpl.rc_context(STYLE)
def _paths(name: str, episodes: pd.DataFrame, first: Sequence[str]) -> list[Drawn]:
    """Returns the paths of some agents, a row each, in the smallest mazes; none where none were recorded."""
    episodes = episodes[episodes.result.map(lambda result: result.trajectories is not None).astype(bool)]
    episodes = episodes[episodes["size"] == episodes["size"].min()]
    names = list(episodes.agent.unique())
    if not names:
        return []
    agents = [*(each for each in first if each in names), *(each for each in names if each not in first)]
    labels = [label for agent in agents for label in episodes.label[episodes.agent == agent].unique()][:_MAX_ROWS]

    # Trials of all these agents in which they differ most, one in each maze.
    shown = episodes[episodes.label.isin(labels)]
    found = shown.groupby("trial").agg(agents=("label", "nunique"), reached=("success", "mean"), maze=("maze", "first"))
    everyones = found[found.agents == found.agents.max()].sort_values("reached", key=_from_half, kind="stable")
    trials = sorted(everyones.drop_duplicates("maze").index[:_MAX_COLUMNS])

    title = f"Paths: {described(shown.setting.iloc[0])}"
    width = max(len(trials), 3) * WIDTH / _MAX_COLUMNS
    figure = Figure(figsize=(width, 0.5 + len(labels) * (WIDTH / _MAX_COLUMNS + 0.2)), layout="constrained")
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    grid = figure.subplots(len(labels), len(trials), squeeze=False)
    for label, row in zip(labels, grid, strict=True):
        row[0].set_ylabel(textwrap.fill(label, 20), fontsize=8)
        own = shown[shown.label == label].set_index("trial")
        for trial, axes in zip(trials, row, strict=True):
            _draw_episode(axes, own.loc[trial])
    for axes, trial in zip(grid[0], trials, strict=True):
        axes.set_title(f"maze {found.maze[trial]}", fontsize=7.5, loc="center")
    values = shown[shown.trial.isin(trials)].sort_values(["trial", "label"])[_COLUMNS].round(3).reset_index(drop=True)
    return [Drawn(f"paths-{name}", title, _NOTE, figure, values, stacks=False)]


def _from_half(shares: pd.Series) -> pd.Series:
    return (shares - 0.5).abs()


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
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set_xlabel(f"{'✓' if episode.success else '✗ failed,'} {episode.steps} steps", fontsize=7)
