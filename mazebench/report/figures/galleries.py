"""Galleries: the same episodes driven by several agents, side by side."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from mazebench.maps.maze import Cell
from mazebench.report.frame import settings_of
from mazebench.report.mazes import real_walls, shown_ends
from mazebench.report.results import ReportedResult
from mazebench.report.settings import Setting
from mazebench.report.tables import maze_sets, perturbed_groups
from mazebench.tasks.tracks import TRACKS

_MAX_COLUMNS = 5  # episodes of a gallery
_MAX_ROWS = 8  # agents; further ones get galleries of their own
_DISTANCE = 10  # cells, of local episodes: the farthest that the paper prints; less where there is none
_NOTE = (
    "We picked the episodes in which the agents differ most, from different mazes if possible. "
    "They are not a random sample."
)
_EPISODE = ["maze", "start", "goal", "seed"]  # what tells an episode from others, whoever drives


@dataclasses.dataclass(frozen=True)
class Drive:
    """One episode of one agent."""

    maze: str
    walls: np.ndarray  # [N, N] bool, of the true maze
    shown: np.ndarray | None  # [N, N] bool, the shown map; None if it has another frame than the maze
    start: Cell
    goal: Cell
    landmarks: np.ndarray  # [K, 2] int, cells, without the goal
    points: np.ndarray  # [L, 2] cells, where the body was
    success: bool
    steps: int


@dataclasses.dataclass(frozen=True)
class Gallery:
    """The same episodes of several agents."""

    name: str  # of its files
    title: str
    note: str
    drives: tuple[tuple[str, tuple[Drive, ...]], ...]  # by agent, in the order of the episodes


def build_galleries(episodes: pd.DataFrame) -> list[Gallery]:
    """Returns galleries of the eval mazes and of each set of own mazes.

    There is one of each task, and of each perturbation and track at a middle level. Of several sizes, the smallest is
    taken.

    Args:
      episodes: of `frame.join_episodes`.
    """
    galleries: list[Gallery] = []
    has_paths = episodes.result.map(lambda result: result.trajectories is not None)
    for here, prefix, _ in maze_sets(episodes):
        drawn = here[has_paths[here.index] & (here.split != "train")]
        for setting in _pick_settings(drawn):
            # Any result may tell the true walls of a maze.
            galleries += _make_galleries(
                setting, prefix, drawn[drawn.setting == setting], list(episodes.result.unique())
            )
    return galleries


def _pick_settings(episodes: pd.DataFrame) -> Iterator[Setting]:
    settings = settings_of(episodes)
    for task in ("hierarchical", "local"):
        plain = [setting for setting in settings if setting.task == task and setting.is_exact]
        if plain:
            yield min(plain, key=lambda setting: (setting.size, -setting.landmark_distance))
    for _, base, group in perturbed_groups(episodes):
        yield _middle([setting for setting in settings_of(group) if setting != base])
    for track in TRACKS:
        if played := [setting for setting in settings if setting.track == track]:
            yield _middle(played)


def _middle(settings: Sequence[Setting]) -> Setting:
    return settings[(len(settings) - 1) // 2]


def _make_galleries(
    setting: Setting, prefix: str, episodes: pd.DataFrame, results: Sequence[ReportedResult]
) -> Iterator[Gallery]:
    """Yields galleries of the same episodes of one setting, in which all agents stand once."""
    # Each result is one agent's. What all of them played, with how many of them reached the goal:
    by_episode = episodes.groupby(_EPISODE, sort=False)
    found = by_episode.agg(distance=("distance", "first"), agents=("result", "nunique"), reached=("success", "sum"))
    num_agents = episodes.result.nunique()
    common = found[found.agents == num_agents]
    place = ""
    if setting.track or setting.mazes:  # they have few episodes of each distance: all may be chosen, the longest first
        common = common.sort_values("distance", ascending=False, kind="stable")
    elif setting.task == "local" and len(common):
        near = common.distance[common.distance <= _DISTANCE]
        distance = near.max() if len(near) else common.distance.min()
        common = common[common.distance == distance]
        place = f", start and goal {distance} cells apart"
    if not len(common):
        return

    # Those in which the agents differ most, from different mazes if possible; shown by maze.
    evenness = np.minimum(common.reached, num_agents - common.reached)
    common = common.loc[evenness.sort_values(ascending=False, kind="stable").index]
    turn = common.groupby("maze", sort=False).cumcount()  # first one of each maze, then second ones
    chosen = sorted(turn.sort_values(kind="stable").index[:_MAX_COLUMNS])
    drives = []
    for label, own in episodes.groupby("label", observed=True):
        result = own.result.iloc[0]
        numbers = pd.Series(range(len(own)), index=pd.MultiIndex.from_frame(own[_EPISODE]))
        drives.append((label, _drives(result, [int(numbers[key]) for key in chosen], results)))
    count = -(-len(drives) // _MAX_ROWS)
    for part, rows in enumerate(np.array_split(np.arange(len(drives)), count), 1):
        yield Gallery(
            name=f"trajectories-{prefix}{setting.name}" + (f"-part-{part}" if part > 1 else ""),
            title=f"Trajectories: {setting}{place}" + (f" ({part} of {count})" if count > 1 else ""),
            note=_NOTE,
            drives=tuple(drives[row] for row in rows),
        )


def _drives(result: ReportedResult, numbers: Sequence[int], results: Sequence[ReportedResult]) -> tuple[Drive, ...]:
    episodes, trajectories = result.episodes, result.trajectories
    assert trajectories is not None
    has_own_frame = shown_ends(result, results) is not None  # a drawn map's cells are recorded in the maze's frame
    drives = []
    for number in numbers:
        episode, trajectory = episodes.iloc[number], trajectories[number]
        walls = real_walls(result, episode.maze, results)
        drives.append(
            Drive(
                maze=episode.maze,
                walls=trajectory.shown if walls is None else walls,
                shown=None if has_own_frame else trajectory.shown,
                start=episode.start,
                goal=episode.goal,
                landmarks=np.stack(np.divmod(trajectory.landmarks[:-1], result.setting.size), axis=-1),
                points=trajectory.pose[:, :2].astype(np.float64) / result.setting.cell_size,
                success=bool(episode.success),
                steps=int(episode.steps),
            )
        )
    return tuple(drives)
