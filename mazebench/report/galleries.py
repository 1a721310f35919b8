"""Galleries: the same episodes driven by several agents, side by side."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from mazebench.maps.maze import Cell
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

# An episode, whoever drives: maze, start, goal, seed.
Key = tuple[str, int, int, int, int, int]


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


def build_galleries(results: Sequence[ReportedResult], labels: Sequence[str]) -> list[Gallery]:
    """Returns galleries of the eval mazes and of each set of own mazes.

    There is one of each task, and of each perturbation and track at a middle level. Of several sizes, the smallest is
    taken.
    """
    galleries: list[Gallery] = []
    for here, prefix, _ in maze_sets(results):
        drawn = [result for result in here if result.trajectories is not None and result.setting.split != "train"]
        for setting in _settings(drawn):
            galleries += _galleries(setting, prefix, drawn, results, labels)
    return galleries


def _settings(results: Sequence[ReportedResult]) -> Iterator[Setting]:
    for task in ("hierarchical", "local"):
        plain = [r.setting for r in results if r.setting.task == task and r.setting.is_exact]
        if plain:
            yield min(plain, key=lambda setting: (setting.size, -setting.landmark_distance))
    for _, base, group in perturbed_groups(results):
        yield _middle({result.setting for result in group} - {base})
    for track in TRACKS:
        if played := {result.setting for result in results if result.setting.track == track}:
            yield _middle(played)


def _middle(settings: set[Setting]) -> Setting:
    return sorted(settings)[(len(settings) - 1) // 2]


def _galleries(
    setting: Setting,
    prefix: str,
    drawn: Sequence[ReportedResult],
    results: Sequence[ReportedResult],
    labels: Sequence[str],
) -> Iterator[Gallery]:
    """Yields galleries of the same episodes, in which all agents stand once; any of `results` may tell true walls."""
    here = sorted((r for r in drawn if r.setting == setting), key=lambda result: labels.index(result.label))
    found = [{key: number for number, key in enumerate(_keys(result))} for result in here]
    common = [key for key in found[0] if all(key in other for other in found)]
    place = ""
    distances = {key: int(here[0].episodes.distance[found[0][key]]) for key in common}
    if setting.track or setting.mazes:  # few episodes of each distance: the longest of those that tell as much
        common.sort(key=lambda key: -distances[key])
    elif setting.task == "local" and common:
        distance = max((d for d in distances.values() if d <= _DISTANCE), default=min(distances.values()))
        common = [key for key in common if distances[key] == distance]
        place = f", start and goal {distance} cells apart"
    chosen = _most_telling(here, found, common)
    if not chosen:
        return
    drives = [
        (result.label, _drives(result, [numbers[key] for key in chosen], results))
        for result, numbers in zip(here, found, strict=True)
    ]
    count = -(-len(drives) // _MAX_ROWS)
    for part, rows in enumerate(np.array_split(np.arange(len(drives)), count), 1):
        yield Gallery(
            name=f"trajectories-{prefix}{setting.name}" + (f"-part-{part}" if part > 1 else ""),
            title=f"Trajectories: {setting}{place}" + (f" ({part} of {count})" if count > 1 else ""),
            note=_NOTE,
            drives=tuple(drives[row] for row in rows),
        )


def _keys(result: ReportedResult) -> list[Key]:
    """Returns what identifies each episode, in the order of the records."""
    episodes = result.episodes
    columns = np.column_stack([episodes.start, episodes.goal, episodes.seed]).tolist()
    return [(episodes.mazes[maze], *row) for maze, row in zip(episodes.maze.tolist(), columns, strict=True)]


def _most_telling(
    results: Sequence[ReportedResult], found: Sequence[dict[Key, int]], common: Sequence[Key]
) -> list[Key]:
    """Returns the episodes in which the agents differ most, from different mazes if possible, in protocol order.

    A maze gives a second episode only where every maze gives one.
    """

    def evenness(key: Key) -> int:
        failures = [not result.episodes.success[numbers[key]] for result, numbers in zip(results, found, strict=True)]
        return -min(sum(failures), len(failures) - sum(failures))

    by_maze: dict[str, int] = {}
    turns: dict[Key, int] = {}
    for key in sorted(common, key=evenness):
        turns[key] = by_maze[key[0]] = by_maze.get(key[0], -1) + 1
    return sorted(sorted(turns, key=turns.__getitem__)[:_MAX_COLUMNS])


def _drives(result: ReportedResult, numbers: Sequence[int], results: Sequence[ReportedResult]) -> tuple[Drive, ...]:
    episodes, trajectories = result.episodes, result.trajectories
    assert trajectories is not None
    has_own_frame = shown_ends(result, results) is not None  # a drawn map's cells are recorded in the maze's frame
    drives = []
    for number in numbers:
        maze, trajectory = episodes.mazes[episodes.maze[number]], trajectories[number]
        walls = real_walls(result, maze, results)
        drives.append(
            Drive(
                maze=maze,
                walls=trajectory.shown if walls is None else walls,
                shown=None if has_own_frame else trajectory.shown,
                start=tuple(episodes.start[number].tolist()),
                goal=tuple(episodes.goal[number].tolist()),
                landmarks=np.stack(np.divmod(trajectory.landmarks[:-1], result.setting.size), axis=-1),
                points=trajectory.pose[:, :2].astype(np.float64) / result.setting.cell_size,
                success=bool(episodes.success[number]),
                steps=int(episodes.steps[number]),
            )
        )
    return tuple(drives)
