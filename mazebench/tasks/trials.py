"""The episodes of an evaluation: the benchmark's frozen ones, or ones drawn in the same way."""

from __future__ import annotations

import csv
import dataclasses
import functools
from collections.abc import Iterable, Sequence

import numpy as np

from mazebench.constants import EPISODES_PER_DISTANCE
from mazebench.maps.benchmark import MAZES_PER_SPLIT, SIZES, TRACKS_VERSION, VERSION, read_asset
from mazebench.maps.geodesic import DiscPaths
from mazebench.maps.maze import Cell, Maze
from mazebench.tasks.episode import Episode, sample_pair
from mazebench.tasks.options import EVAL_DISTANCES
from mazebench.tasks.spec import TaskSpec
from mazebench.world.mjcf import BODY_RADIUS

COLUMNS = ("maze", "start_row", "start_column", "goal_row", "goal_column", "distance", "yaw", "seed", "shortest_path")

_MAX_DRAWS = 100  # for a pair not drawn before
_SEEDS = 2**31


@dataclasses.dataclass(frozen=True)
class Trial:
    """One episode of an evaluation, with what its metrics need."""

    episode: Episode
    distance: int  # cells, of start and goal on the true map
    shortest_path: float  # m, of the body as a disc from the start point to the goal cell


def episodes_file(task: str, size: int) -> str:
    """Returns the name of the file with the frozen eval episodes of one task and size."""
    return f"episodes-{task}-{size}-eval.csv"


def frozen_trials(task: str, size: int, version: str = VERSION) -> tuple[Trial, ...]:
    """Returns the eval episodes of one task and size.

    v1 has 1,500 of the local task and 20 of the hierarchical one; v2 has 200, which tracks share.
    """
    rows = csv.DictReader(read_asset(episodes_file(task, size), version).splitlines())
    return tuple(
        Trial(
            Episode(
                int(row["maze"]),
                (int(row["start_row"]), int(row["start_column"])),
                (int(row["goal_row"]), int(row["goal_column"])),
                float(row["yaw"]),
                int(row["seed"]),
            ),
            int(row["distance"]),
            float(row["shortest_path"]),
        )
        for row in rows
    )


def select_trials(
    task: str,
    mazes: Sequence[Maze],
    frozen: bool,
    distances: Iterable[int] = EVAL_DISTANCES,
    episodes_per_distance: int = EPISODES_PER_DISTANCE,
    seed: int = 0,
) -> list[Trial]:
    """Returns the episodes to evaluate, by maze and then by distance.

    Args:
      task: "local" or "hierarchical".
      mazes: all the task's mazes.
      frozen: whether `mazes` are benchmark v1's eval mazes, whose frozen episodes are then taken as far as they go.
      distances: of the local task's pairs, cells.
      episodes_per_distance: for each maze and distance.
      seed: of what is drawn.

    Raises:
      InputError: if no two cells of a maze are a wanted distance apart.
    """
    distances = sorted(set(distances))
    if frozen and task == "hierarchical":
        return list(frozen_trials(task, mazes[0].size))
    if frozen and set(distances) <= set(EVAL_DISTANCES) and episodes_per_distance <= EPISODES_PER_DISTANCE:
        kept = np.arange(EPISODES_PER_DISTANCE) < episodes_per_distance
        trials = frozen_trials(task, mazes[0].size)
        return [
            trial
            for trial, keep in zip(trials, np.resize(kept, len(trials)), strict=True)
            if keep and trial.distance in distances
        ]
    spec = TaskSpec(task=task, mazes=tuple(mazes), distances=tuple(distances))
    return draw_trials(spec, episodes_per_distance, seed)


def draw_trials(spec: TaskSpec, episodes_per_distance: int = EPISODES_PER_DISTANCE, seed: int = 0) -> list[Trial]:
    """Draws episodes of a task, by maze and then by distance; of the hierarchical task, one in each maze.

    Where start and goal are given, an episode draws its heading only.

    Raises:
      InputError: if no two cells of a maze are a wanted distance apart.
    """
    trials = []
    for index, maze in enumerate(spec.mazes):
        start, goal = spec.ends(maze)
        if spec.task == "hierarchical":
            rng = np.random.default_rng([seed, maze.size, index])
            trials.append(make_trial(maze, index, sample_pair(maze, 0, rng, start, goal), rng))
            continue
        distances = sorted(set(spec.distances))
        if start is not None and goal is not None:
            distances = [maze.distance(start, goal)]
        for distance in distances:
            trials += _local_trials(maze, index, distance, episodes_per_distance, seed, start, goal)
    return trials


def _local_trials(
    maze: Maze, index: int, distance: int, count: int, seed: int, start: Cell | None, goal: Cell | None
) -> list[Trial]:
    """Returns `count` episodes, of different pairs if there are so many; the first ones do not depend on `count`."""
    rng = np.random.default_rng([seed, maze.size, index, distance])
    seen: set[tuple[Cell, Cell]] = set()
    trials = []
    for _ in range(count):
        pair = sample_pair(maze, distance, rng, start, goal)
        for _ in range(_MAX_DRAWS):
            if pair not in seen:
                break
            pair = sample_pair(maze, distance, rng, start, goal)
        seen.add(pair)
        trials.append(make_trial(maze, index, pair, rng))
    return trials


def select_track_trials(
    mazes: Sequence[Maze], frozen: bool, distances: Iterable[int], episodes_per_distance: int, seed: int = 0
) -> list[Trial]:
    """Returns the episodes of a track to evaluate, as `select_trials` does; of frozen ones, all at these distances."""
    if not frozen:
        return select_trials("local", mazes, False, distances, episodes_per_distance, seed)
    wanted = set(distances)
    return [trial for trial in frozen_trials("local", mazes[0].size, TRACKS_VERSION) if trial.distance in wanted]


def make_trial(maze: Maze, index: int, pair: tuple[Cell, Cell], rng: np.random.Generator) -> Trial:
    """Returns the trial of a start and a goal in maze number `index`; draws the first heading and the seed."""
    start, goal = pair
    episode = Episode(index, start, goal, float(rng.uniform(-np.pi, np.pi)), int(rng.integers(_SEEDS)))
    shortest = _disc_paths(maze).length(maze.point(start), goal)
    return Trial(episode, maze.distance(start, goal), shortest)


@functools.lru_cache(maxsize=2)
def _disc_paths(maze: Maze) -> DiscPaths:
    return DiscPaths(maze, BODY_RADIUS)


def benchmark_task_sizes() -> list[tuple[str, int, int]]:
    """Returns (task, size, number of frozen episodes) for all of benchmark v1."""
    local = MAZES_PER_SPLIT * len(EVAL_DISTANCES) * EPISODES_PER_DISTANCE
    return [
        (task, size, count) for size in SIZES for task, count in (("local", local), ("hierarchical", MAZES_PER_SPLIT))
    ]
