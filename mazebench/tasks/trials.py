"""The episodes of an evaluation: the benchmark's frozen ones, or ones drawn in the same way."""

from __future__ import annotations

import collections
import csv
import dataclasses
import functools
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mazebench.constants import EPISODES_PER_DISTANCE, FROZEN_PER_MAZE
from mazebench.maps.benchmark import (
    DOORS_BENCHMARK,
    GOALS_BENCHMARK,
    KINDS_SIZE,
    MAZES_PER_SPLIT,
    PAPER_BENCHMARK,
    REAL_BENCHMARK,
    SIZES,
    TRACKS_BENCHMARK,
    read_asset,
)
from mazebench.maps.maze import Cell, Maze
from mazebench.maps.real_buildings import building_of
from mazebench.tasks.episode import Episode, goals_of, make_episode, sample_pair, sample_pair_of
from mazebench.tasks.streams import DOORS
from mazebench.tasks.task import EVAL_DISTANCES, Task
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import DISTANCES
from mazebench.world.bodies import SLIDER, Body

# Of a file of frozen episodes.
COLUMNS = (
    *("maze", "start_row", "start_column", "goal_row", "goal_column", "distance", "yaw", "seed", "shortest_path"),
    "oracle_steps",  # empty where the oracle missed the goal
)
GOAL_COLUMNS = ("episode", "leg", "goal_row", "goal_column", "distance", "shortest_path", "oracle_steps")  # later goals

_PER_MAZE = 48  # episodes of a track in a maze of one's own, unless another number for each distance is asked for
_MAX_DRAWS = 101  # of a pair, for one not drawn before


@dataclasses.dataclass(frozen=True)
class Leg:
    """The way to one goal of an episode, with what its metrics need."""

    start: Cell
    goal: Cell
    distance: int  # cells, of start and goal on the true map
    shortest_path: float  # m, of the body as a disc from the start cell's centre to the goal cell
    oracle_steps: int | None = None  # of the agent `oracle`; None where they are not frozen, or it missed the goal


@dataclasses.dataclass(frozen=True)
class Trial:
    """One episode of an evaluation, with what its metrics need."""

    episode: Episode
    distance: int  # as in `Leg`, of the first goal; likewise the other two
    shortest_path: float
    oracle_steps: int | None = None
    later_legs: tuple[Leg, ...] = ()  # to the goals after the first one, each from the goal before

    @property
    def legs(self) -> tuple[Leg, ...]:
        """All legs of the episode, from goal to goal."""
        first = Leg(self.episode.start, self.episode.goal, self.distance, self.shortest_path, self.oracle_steps)
        return first, *self.later_legs


def episodes_file(task: str, size: int, split: str = "eval") -> str:
    """Returns the name of the file with the frozen episodes of one task, size and split."""
    return f"episodes-{task}-{size}-{split}.csv"


def doors_file(level: int, split: str) -> str:
    """Returns the name of the file with the frozen episodes of one level and split of the track `doors`."""
    return episodes_file(f"{DOORS}-{level}", KINDS_SIZE, split)


def frozen_trials(task: str, size: int, benchmark: str = PAPER_BENCHMARK, split: str = "eval") -> tuple[Trial, ...]:
    """Returns the frozen episodes of one task, size and split.

    The paper's protocol has 1,500 of the local task and 20 of the hierarchical one; the tracks share 240.
    """
    return tuple(_FrozenTrials(_frozen_rows(task, size, benchmark, split)))


def _frozen_rows(task: str, size: int, benchmark: str = PAPER_BENCHMARK, split: str = "eval") -> list[dict[str, str]]:
    return list(csv.DictReader(read_asset(episodes_file(task, size, split), benchmark).splitlines()))


def frozen_in_building(mazes: str) -> list[Trial]:
    """Returns the frozen episodes in a real building, `real:NAME`, whose distances are in its cells."""
    building = building_of(mazes)
    rows = _rows_by_building(building.split).get(building.name, ())
    return [_parse(row | {"maze": "0"}) for row in rows]


@functools.cache
def _rows_by_building(split: str) -> dict[str, list[dict[str, str]]]:
    rows = csv.DictReader(read_asset(buildings_file(split), REAL_BENCHMARK).splitlines())
    return {name: list(own) for name, own in itertools.groupby(rows, key=lambda row: row["maze"])}


def buildings_file(split: str) -> str:
    """Returns the name of the file with the frozen episodes in real buildings of one split, by building."""
    return f"episodes-{split}.csv"


class _FrozenTrials(Sequence[Trial]):
    """The trials of rows of frozen episodes, each of which is parsed when it is asked for."""

    def __init__(self, rows: Sequence[Mapping[str, str]]):
        self._rows, self._parsed = rows, dict[int, Trial]()

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[each] for each in range(len(self))[index]]
        if index not in self._parsed:
            self._parsed[index] = _parse(self._rows[index])
        return self._parsed[index]


def _parse(row: Mapping[str, str]) -> Trial:
    episode = Episode(
        maze=int(row["maze"]),
        start=(int(row["start_row"]), int(row["start_column"])),
        goal=(int(row["goal_row"]), int(row["goal_column"])),
        yaw=float(row["yaw"]),
        seed=int(row["seed"]),
    )
    oracle_steps = int(row["oracle_steps"]) if row["oracle_steps"] else None
    return Trial(episode, int(row["distance"]), float(row["shortest_path"]), oracle_steps)


def counting_option(options: TaskOptions) -> str | None:
    """Returns the name of the option that says how many episodes of a task are evaluated; None where none does."""
    if options.track is not None and options.frozen_split is not None:
        return "episodes_per_maze"
    return None if options.is_hierarchical else "episodes_per_distance"


def select_trials(
    task: Task,
    episodes_per_distance: int | None = EPISODES_PER_DISTANCE,
    seed: int = 0,
    episodes_per_maze: int | None = None,
) -> Sequence[Trial]:
    """Returns the episodes to evaluate, by maze and then by distance.

    In the benchmark's mazes its frozen episodes are taken as far as they go: of a track all of the task's distances,
    else at most five for each maze and distance. Elsewhere episodes are drawn. Later goals follow from the episodes.

    Args:
      task: the task; its distances are those of the pairs.
      episodes_per_distance: for each maze and distance; None for 48 in each maze, spread over the distances.
      seed: of what is drawn.
      episodes_per_maze: of the frozen ones of a track, beginning in maze k with number k modulo 5, or the first ones
        of a real building; None for all.

    Raises:
      InputError: if no two cells of a maze are a wanted distance apart.
    """
    chosen = _select_frozen(task, episodes_per_distance or _PER_MAZE, episodes_per_maze)
    if chosen is None:
        return [with_later_legs(task, trial) for trial in draw_trials(task, episodes_per_distance, seed)]
    return chosen if task.body == SLIDER else [_for_other_body(task, trial) for trial in chosen]


def _select_frozen(task: Task, wanted: int, episodes_per_maze: int | None) -> Sequence[Trial] | None:
    """Returns the frozen episodes to evaluate, `wanted` for each maze and distance; None where they don't go so far."""
    frozen_split = task.options.frozen_split
    if frozen_split is None:
        return None
    if task.options.is_frozen_building:
        own = [trial for trial in frozen_in_building(task.options.mazes) if trial.distance in task.distances]
        return [with_later_legs(task, trial) for trial in own[:episodes_per_maze]]
    episodes_per_maze = episodes_per_maze or FROZEN_PER_MAZE
    if task.options.track is not None:
        if task.moves_doors:
            rows = _frozen_rows(f"{DOORS}-{task.options.track_level}", task.size, DOORS_BENCHMARK, frozen_split)
        else:
            rows = _frozen_rows("local", task.size, TRACKS_BENCHMARK, frozen_split)
        chosen = [
            index
            for index, row in enumerate(rows)
            if int(row["distance"]) in task.distances
            and (index - int(row["maze"])) % FROZEN_PER_MAZE < episodes_per_maze
        ]
        trials = _FrozenTrials([rows[index] for index in chosen])
        if task.options.num_goals == 1:
            return trials
        are_frozen = task.distances == DISTANCES and not task.moves_doors
        later = frozen_legs(frozen_split, _FrozenTrials(rows)) if are_frozen else [()] * len(rows)
        return [with_later_legs(task, trial, later[index]) for index, trial in zip(chosen, trials, strict=True)]
    if task.options.is_hierarchical:
        return _FrozenTrials(_frozen_rows(task.options.task, task.size))
    if set(task.distances) <= set(EVAL_DISTANCES) and wanted <= EPISODES_PER_DISTANCE:
        # The frozen episodes of a maze and a distance follow each other, EPISODES_PER_DISTANCE of them.
        return _FrozenTrials(
            [
                row
                for index, row in enumerate(_frozen_rows(task.options.task, task.size))
                if index % EPISODES_PER_DISTANCE < wanted and int(row["distance"]) in task.distances
            ]
        )
    return None


def _for_other_body(task: Task, trial: Trial) -> Trial:
    """Returns a frozen trial with the shortest paths of the task's body; the oracle's steps, the slider's, are open."""
    maze = task.mazes[trial.episode.maze]
    first, *later = (
        dataclasses.replace(leg, shortest_path=shortest_path(maze, leg.start, leg.goal, task.body), oracle_steps=None)
        for leg in trial.legs
    )
    return Trial(trial.episode, first.distance, first.shortest_path, later_legs=tuple(later))


def goals_file(split: str) -> str:
    """Returns the name of the file with the later goals of the tracks' frozen episodes of one split."""
    return f"goals-local-{KINDS_SIZE}-{split}.csv"


def frozen_legs(split: str, trials: Sequence[Trial]) -> list[tuple[Leg, ...]]:
    """Returns the frozen legs after the first one of each of the tracks' frozen `trials` of one split."""
    legs = [[trial.legs[0]] for trial in trials]
    for row in csv.DictReader(read_asset(goals_file(split), GOALS_BENCHMARK).splitlines()):
        own, goal = legs[int(row["episode"])], (int(row["goal_row"]), int(row["goal_column"]))
        own.append(Leg(own[-1].goal, goal, int(row["distance"]), float(row["shortest_path"]), int(row["oracle_steps"])))
    return [tuple(own[1:]) for own in legs]


def with_later_legs(task: Task, trial: Trial, frozen: Sequence[Leg] = ()) -> Trial:
    """Returns a trial with the legs to all of its goals, of which the first ones after the first may be frozen."""
    goals, maze = goals_of(task, trial.episode), task.mazes[trial.episode.maze]
    legs = [*frozen[: len(goals) - 1]]
    for start, goal in itertools.pairwise(goals[len(legs) :]):
        legs.append(Leg(start, goal, maze.distance(start, goal), shortest_path(maze, start, goal, task.body)))
    return dataclasses.replace(trial, later_legs=tuple(legs))


def draw_trials(task: Task, episodes_per_distance: int | None = EPISODES_PER_DISTANCE, seed: int = 0) -> list[Trial]:
    """Draws episodes of a task, by maze and then by distance; of the hierarchical task, one in each maze.

    Where start and goal are given, an episode draws its heading only. Elsewhere, the episodes of a maze and a distance
    have different starts and goals if there are so many, and the first ones do not depend on `episodes_per_distance`.

    Raises:
      InputError: if no two cells of a maze are a wanted distance apart.
    """
    trials = []
    for index, maze in enumerate(task.arena.fixed_mazes):
        (start, goal), joined = task.arena.ends(index), task.arena.joined(index)
        if task.options.is_hierarchical:
            rng = np.random.default_rng([seed, maze.size, index])
            trials.append(make_trial(maze, index, sample_pair(maze, 0, rng, start, goal, joined), rng, task.body))
            continue
        distances = sorted(set(task.distances))
        if start is not None and goal is not None:
            distances = [maze.distance(start, goal)]
        whole, rest = divmod(_PER_MAZE, len(distances))
        counts = {each: episodes_per_distance or whole + (number < rest) for number, each in enumerate(distances)}
        trials += _draw_in_maze(task, index, counts, seed)
    return trials


def spread_trials(task: Task, count: int, seed: int = 0) -> list[Trial]:
    """Draws `count` episodes of a task as `draw_trials` does, spread over the mazes, and there over the distances."""
    trials, distances, num_mazes = [], sorted(set(task.distances)), len(task.mazes)
    for index in range(num_mazes):
        own = count // num_mazes + (index < count % num_mazes)
        # From the shortest to the longest, a little apart from those in the other mazes.
        shares = (np.arange(own) + (index + 0.5) / num_mazes) / max(own, 1)
        counts = collections.Counter(distances[int(share * len(distances))] for share in shares)
        trials += _draw_in_maze(task, index, counts, seed)
    return trials


def _draw_in_maze(task: Task, index: int, counts: Mapping[int, int], seed: int) -> list[Trial]:
    """Draws so many episodes at each distance in maze number `index`."""
    trials, maze = [], task.arena.fixed_mazes[index]
    for distance, count in counts.items():
        rng = np.random.default_rng([seed, maze.size, index, distance])
        seen: set[tuple[Cell, Cell]] = set()
        for _ in range(count):
            # A pair that was not drawn before, if one is found.
            for _ in range(_MAX_DRAWS):
                pair = sample_pair_of(task, index, distance, rng)
                if pair not in seen:
                    break
            seen.add(pair)
            trials.append(make_trial(maze, index, pair, rng, task.body))
    return trials


def make_trial(maze: Maze, index: int, pair: tuple[Cell, Cell], rng: np.random.Generator, body: Body = SLIDER) -> Trial:
    """Returns the trial of a start and a goal in maze number `index`; draws the first heading and the seed."""
    start, goal = pair
    episode = make_episode(index, start, goal, rng)
    return Trial(episode, maze.distance(start, goal), shortest_path(maze, start, goal, body))


def shortest_path(maze: Maze, start: Cell, goal: Cell, body: Body) -> float:
    """Returns the metres of a shortest path of a body as a disc from a cell's centre to a goal cell."""
    from mazebench.maps.geodesic import length_between  # loads numba, which frozen trials do without

    return length_between(maze, body.radius, start, goal)


def benchmark_task_sizes() -> list[tuple[str, int, int]]:
    """Returns (task, size, number of frozen episodes) for all of the paper's protocol."""
    counts = {"local": MAZES_PER_SPLIT * len(EVAL_DISTANCES) * EPISODES_PER_DISTANCE, "hierarchical": MAZES_PER_SPLIT}
    return [(task, size, count) for size in SIZES for task, count in counts.items()]
