"""Checks of the tracks: `python -m benchmarks.tracks_checks CHECK`, whose tables are in docs/tracks.md.

  swaps: how many doors must move so that a share of the shortest paths on the map is blocked.
  worth: what the oracle reaches, and what a right map is worth to the navigator.

The mazes are of all kinds, the novel ones included. They are drawn from a seed of this script: none is a maze of a
split.
"""

from __future__ import annotations

import bisect
import functools
import math
from collections.abc import Callable, Sequence
from typing import Annotated

import numpy as np
import typer

from benchmarks.results.results_tables import format_interval, format_table
from mazebench.agent_loading import load_agent_class
from mazebench.constants import ON_TIME
from mazebench.errors import InputError
from mazebench.evaluation.chunk import run_trials
from mazebench.evaluation.measured_oracle import measure_oracle_steps
from mazebench.maps.benchmark import KINDS_SIZE
from mazebench.maps.doors import door_slots, num_swappable, swap_doors
from mazebench.maps.kinds import KNOWN, NOVEL, generate
from mazebench.maps.maze import Cell, Maze
from mazebench.results.intervals import difference_interval, mean_interval
from mazebench.tasks.episode import sample_pair
from mazebench.tasks.perturbations.moved_doors import SWAPS_BY_PERCENT
from mazebench.tasks.shown_map import is_blocked
from mazebench.tasks.task import Task
from mazebench.tasks.tracks import DISTANCES
from mazebench.tasks.trials import Trial, make_trial

KINDS = ",".join((*KNOWN, *NOVEL))
_TRACK = "building"  # whose maps are right
_SEED = 7_900  # of the check mazes and their episodes
_PER_MAZE = 5  # episodes

Kinds = Annotated[str, typer.Option(help="Kinds of mazes.")]
Episodes = Annotated[int, typer.Option(min=1, help="Of each kind.")]
app = typer.Typer(help="Check the tracks.")


def check_mazes(kind: str, count: int) -> list[Maze]:
    """Returns check mazes of a kind that are large enough for the tracks; the first ones do not depend on `count`."""
    rng = np.random.default_rng([_SEED, *kind.encode()])
    mazes: list[Maze] = []
    while len(mazes) < count:
        maze = generate(kind, KINDS_SIZE, rng, f"check-{kind}-{len(mazes)}")
        if maze.diameter >= max(DISTANCES):
            mazes.append(maze)
    return mazes


@app.command()
def swaps(kinds: Kinds = KINDS, episodes: Episodes = 40) -> None:
    """Print how many doors must move so that a share of the shortest paths on the map is blocked."""
    shares = sorted({percent / 100 for counts in SWAPS_BY_PERCENT.values() for percent in counts})
    print(f"\nDoors that move, and the share of {episodes} paths on the map that they block:\n")
    rows = []
    for kind in kinds.split(","):
        rng = np.random.default_rng(_SEED)
        mazes = check_mazes(kind, episodes)
        ends = [sample_pair(maze, int(rng.choice(DISTANCES)), rng) for maze in mazes]
        blocked = functools.cache(functools.partial(_blocked_share, mazes, ends))
        doors = np.mean([len(door_slots(maze)) for maze in mazes])
        num_open = np.mean([np.sum(~maze.walls[tuple(door_slots(maze).T)]) for maze in mazes])
        numbers = range(min(map(num_swappable, mazes)) + 2)  # the last one is too many
        found = [_nearest(blocked, bisect.bisect_left(numbers, share, key=blocked), share) for share in shares]
        most = bisect.bisect_left(numbers, math.inf, key=blocked) - 1
        cells = [f"{count}: {blocked(count):.2f}" if count <= most else "-" for count in (*found, most)]
        rows.append([kind, f"{doors:.0f}", f"{num_open:.0f}", *cells])
    print(format_table(["kind", "doors", "open", *(f"{share:g}" for share in shares), "at most"], rows))


def _nearest(blocked: Callable[[int], float], first_above: int, share: float) -> int:
    below = first_above - 1
    return below if share - blocked(below) < blocked(first_above) - share < math.inf else first_above


def _blocked_share(mazes: Sequence[Maze], ends: Sequence[tuple[Cell, Cell]], num_swaps: int) -> float:
    """Returns the share of paths that so many swaps block; infinite if a maze has no map with as many."""
    blocked = []
    for index, (maze, pair) in enumerate(zip(mazes, ends, strict=True)):
        # The first swaps in a maze do not depend on their number.
        try:
            shown = swap_doors(maze.walls, maze.kind, num_swaps, pair, np.random.default_rng([_SEED, index]))
        except InputError:
            return math.inf
        blocked.append(is_blocked(maze.walls, shown, pair))
    return float(np.mean(blocked))


@app.command()
def worth(kinds: Kinds = KINDS, episodes: Episodes = 40) -> None:
    """Print what the oracle reaches, and what an exact map is worth to the navigator."""
    print(f"\nRight maps, {episodes} episodes of each kind; on time is within {ON_TIME[0]:g} oracle steps:\n")
    rows = []
    for kind in kinds.split(","):
        mazes = check_mazes(kind, -(-episodes // _PER_MAZE))
        rng = np.random.default_rng(_SEED)
        trials = [
            make_trial(maze, index, sample_pair(maze, int(rng.choice(DISTANCES)), rng), rng)
            for index, maze in enumerate(mazes)
            for _ in range(_PER_MAZE)
        ]
        played = np.array([trial.episode.maze for trial in trials])
        cells = np.array([trial.distance for trial in trials])

        shown, hidden = (
            Task.of(_TRACK, mazes=mazes, level=1, distances=DISTANCES, hide=hide, sensors=("lidar",))
            for hide in ((), ("map",))
        )
        oracle = np.array([steps or np.inf for steps in measure_oracle_steps(shown, trials)])
        with_map, without = (_on_time(task, trials, oracle) for task in (shown, hidden))
        success = format_interval(mean_interval(1.0 * np.isfinite(oracle), played))
        means = [f"{values.mean():.2f}" for values in (oracle / cells, with_map, without)]
        rows.append([kind, success, *means, format_interval(difference_interval(with_map - without, played))])
    head = ["kind", "oracle: success", "steps a cell", "navigator on time", "without map", "map worth"]
    print(format_table(head, rows))


def _on_time(task: Task, trials: Sequence[Trial], oracle: np.ndarray) -> np.ndarray:
    """Returns `[E]` float: 1 where the navigator reaches the goal within 1.25 times the oracle's steps, else 0."""
    agent, on_time = load_agent_class("navigator").build(task.interface), np.zeros(len(trials))
    for results in run_trials(agent, task, dict(enumerate(trials)), len(trials), 1):
        for result in results:
            on_time[result.number] = result.success and result.steps <= ON_TIME[0] * oracle[result.number]
    return on_time


if __name__ == "__main__":
    app()
