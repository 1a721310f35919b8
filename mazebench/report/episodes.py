"""Episodes side by side: the same one driven by several agents, and the maze that it was driven in."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from mazebench.maps.benchmark import load_mazes
from mazebench.maps.maze import Cell
from mazebench.report.results import PERTURBATIONS, Result, Setting
from mazebench.report.tables import levels_of

_MAX_COLUMNS = 5  # episodes of a gallery
_MAX_ROWS = 8  # agents
_DISTANCE = 10  # cells, of local episodes: the farthest that the paper prints; less where there is none

# An episode, whoever drives: maze, start, goal, seed.
Key = tuple[str, int, int, int, int, int]


@dataclasses.dataclass(frozen=True)
class Drive:
    """One episode of one agent."""

    maze: str
    walls: np.ndarray  # [N, N] bool, of the real maze
    shown: np.ndarray | None  # [N, N] bool, the map as shown; None if it is the maze itself, or warped
    start: Cell
    goal: Cell
    landmarks: np.ndarray  # [K, 2] int, cells; the goal is none
    points: np.ndarray  # [L, 2] m, where the body was
    success: bool
    steps: int


@dataclasses.dataclass(frozen=True)
class Gallery:
    """The same episodes of several agents."""

    name: str  # of its files
    title: str
    note: str
    drives: tuple[tuple[str, tuple[Drive, ...]], ...]  # by agent, in the order of the episodes


def build_galleries(results: Sequence[Result], labels: Sequence[str]) -> list[Gallery]:
    """Trajectories in the unperturbed tasks, and at a middle strength of each perturbation, on the smallest mazes."""
    drawn = [result for result in results if result.trajectories is not None and result.setting.split == "eval"]
    galleries = [_gallery(setting, drawn, labels) for setting in _settings(drawn)]
    return [gallery for gallery in galleries if gallery is not None]


def real_walls(result: Result, maze: str, results: Sequence[Result]) -> np.ndarray | None:
    """`[N, N]` bool: the maze as it was; None for a maze that is not the benchmark's and was only shown perturbed."""
    setting = result.setting
    if setting.split != "custom":
        found = [known.walls for known in load_mazes(setting.size, setting.split) if known.name == maze]
        return found[0] if found else None
    for other in results:
        true_map = not other.setting.map_flip and not other.setting.map_warp
        if true_map and other.setting.mazes == setting.mazes and other.trajectories is not None:
            episode = np.flatnonzero(other.episodes.maze == other.episodes.mazes.index(maze))[0]
            return other.trajectories[int(episode)].shown
    return None


def keys(result: Result) -> list[Key]:
    """What identifies each episode, in the order of the records."""
    episodes = result.episodes
    columns = np.column_stack([episodes.start, episodes.goal, episodes.seed]).tolist()
    return [(episodes.mazes[maze], *row) for maze, row in zip(episodes.maze.tolist(), columns, strict=True)]


def _settings(results: Sequence[Result]) -> Iterator[Setting]:
    """One unperturbed setting a task, and one a perturbation."""
    for task in ("hierarchical", "local"):
        plain = [r.setting for r in results if r.setting.task == task and not r.setting.perturbed]
        if plain:
            yield min(plain, key=lambda setting: (setting.size, -setting.landmark_distance))
    for perturbation in PERTURBATIONS:
        for base, group in levels_of(results, perturbation):
            levels = sorted({setting for setting in (r.setting for r in group) if setting != base})
            yield levels[(len(levels) - 1) // 2]


def _gallery(setting: Setting, results: Sequence[Result], labels: Sequence[str]) -> Gallery | None:
    here = sorted((r for r in results if r.setting == setting), key=lambda result: labels.index(result.label))
    here = here[:_MAX_ROWS]
    found = [{key: number for number, key in enumerate(keys(result))} for result in here]
    common = [key for key in found[0] if all(key in other for other in found)]
    place = ""
    if setting.task == "local" and common:
        distances = {key: int(here[0].episodes.distance[found[0][key]]) for key in common}
        distance = max((d for d in distances.values() if d <= _DISTANCE), default=min(distances.values()))
        common = [key for key in common if distances[key] == distance]
        place = f", start and goal {distance} cells apart"
    chosen = _most_telling(here, found, common)
    rows = [
        (result.label, tuple(_drive(result, numbers[key], results) for key in chosen))
        for result, numbers in zip(here, found, strict=True)
    ]
    if not chosen:
        return None
    return Gallery(
        name="trajectories-" + "-".join(_name_parts(setting)),
        title=f"Trajectories: {setting}{place}",
        note="Those episodes in which the agents' outcomes differ most, at most one a maze.",
        drives=tuple(rows),
    )


def _name_parts(setting: Setting) -> Iterator[str]:
    yield f"{setting.task}-{setting.size}"
    for name in setting.perturbed:
        yield f"{name.removeprefix('map_').removeprefix('position_')}-{getattr(setting, name):g}"


def _most_telling(results: Sequence[Result], found: Sequence[dict[Key, int]], common: Sequence[Key]) -> list[Key]:
    """An episode in each of some mazes, those in which the agents' outcomes differ most, in protocol order."""

    def evenness(key: Key) -> int:
        failures = [not result.episodes.success[numbers[key]] for result, numbers in zip(results, found, strict=True)]
        return -min(sum(failures), len(failures) - sum(failures))

    by_maze: dict[str, Key] = {}
    for key in sorted(common, key=evenness):
        by_maze.setdefault(key[0], key)
    return sorted(list(by_maze.values())[:_MAX_COLUMNS])


def _drive(result: Result, number: int, results: Sequence[Result]) -> Drive:
    episodes, trajectories, setting = result.episodes, result.trajectories, result.setting
    assert trajectories is not None
    maze, trajectory = episodes.mazes[episodes.maze[number]], trajectories[number]
    walls = real_walls(result, maze, results)
    return Drive(
        maze=maze,
        walls=trajectory.shown if walls is None else walls,
        shown=trajectory.shown if setting.map_flip and not setting.map_warp else None,
        start=tuple(episodes.start[number].tolist()),
        goal=tuple(episodes.goal[number].tolist()),
        landmarks=np.stack(np.divmod(trajectory.landmarks[:-1], setting.size), axis=-1),
        points=trajectory.pose[:, :2].astype(np.float64),
        success=bool(episodes.success[number]),
        steps=int(episodes.steps[number]),
    )
