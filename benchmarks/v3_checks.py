"""Checks benchmark v3 before its levels are frozen: `python -m benchmarks.v3_checks [CHECK ...]`.

It prints the Markdown tables of docs/tracks.md:
  swaps: how many doors must move so that a share of the shortest paths on the map is blocked.
  worth: the oracle reaches every goal, and an exact map is worth something on time to the navigator, in each kind.
  ideal: what an ideal agent reaches (benchmarks/ideal_agents.py), and what the map is worth to it.
  cue: how well a network tells from the map alone which doors have moved (benchmarks/door_cues.py).
  old: what the navigator of an earlier commit reaches: of a checkout, as of `git worktree add FOLDER 009eb73`.

The checks play in mazes of all kinds, also of the novel ones, that are drawn from a seed of this script: none is a maze
of a split. On time is an agent that reaches the goal within k times the oracle's steps in the same episode; the ideal
agent, within k times the cells of the shortest path.
"""

from __future__ import annotations

import bisect
import concurrent.futures
import dataclasses
import functools
import itertools
import math
import multiprocessing
import operator
import pathlib
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, NamedTuple

import numpy as np
import typer

from mazebench.agent import Interface
from mazebench.agent_loading import load_agent_class
from mazebench.constants import ON_TIME
from mazebench.errors import InputError
from mazebench.evaluation.chunk import run_trials
from mazebench.evaluation.oracle import measure_oracle_steps
from mazebench.maps.benchmark import KINDS_SIZE
from mazebench.maps.doors import door_slots, num_swappable, swap_doors
from mazebench.maps.kinds import KNOWN, NOVEL, generate
from mazebench.maps.maze import Cell, Maze
from mazebench.results.intervals import Estimate, difference_interval, mean_interval
from mazebench.tasks.build import make_spec
from mazebench.tasks.episode import sample_pair
from mazebench.tasks.shown_map import is_blocked
from mazebench.tasks.spec import TaskSpec
from mazebench.tasks.time_limit import track_time_limit
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.tracks.base import DISTANCES, LEVELS
from mazebench.tasks.tracks.rebuilt import SWAPS
from mazebench.tasks.trials import Trial, make_trial

KINDS = (*KNOWN, *NOVEL)
PARTS = [(track, level) for track in TRACKS for level in LEVELS]
_SEED = 7_900  # of the check mazes and their episodes
_PER_MAZE = 5  # episodes
_SPARE = 1.15  # steps that the ideal agent takes for a cell, by those of the oracle: it turns round
_CUE_SHARE = 0.7  # of the paths on the map are blocked, where cues are measured


class Settings(NamedTuple):
    """What is measured, and where."""

    kinds: tuple[str, ...]
    episodes: int  # of each kind
    workers: int
    old_navigator: pathlib.Path | None


def check_mazes(kind: str, count: int) -> list[Maze]:
    """Returns check mazes of a kind that are large enough for the tracks; the first ones do not depend on `count`."""
    rng = np.random.default_rng([_SEED, *kind.encode()])
    mazes: list[Maze] = []
    while len(mazes) < count:
        maze = generate(kind, KINDS_SIZE, rng, f"check-{kind}-{len(mazes)}")
        if maze.diameter >= max(DISTANCES):
            mazes.append(maze)
    return mazes


# Doors


def check_swaps(settings: Settings) -> None:
    """Prints how many doors must move so that a share of the shortest paths on the map is blocked."""
    shares = sorted({share for swaps in SWAPS.values() for share in swaps})
    print(f"\nDoors that move, and the share of {settings.episodes} paths on the map that they block:\n")
    _print_head("kind", "doors", "open", *(f"{share:g}" for share in shares), "at most")
    for kind in settings.kinds:
        cases = _draw_cases(kind, settings.episodes)
        blocked = functools.cache(functools.partial(_blocked_share, cases))
        doors = np.mean([len(case.slots) for case in cases])
        num_open = np.mean([np.sum(~case.maze.walls[tuple(case.slots.T)]) for case in cases])
        numbers = range(min(num_swappable(case.maze) for case in cases) + 2)  # the last one is too many
        found = [_nearest(blocked, bisect.bisect_left(numbers, share, key=blocked), share) for share in shares]
        most = bisect.bisect_left(numbers, math.inf, key=blocked) - 1
        cells = [f"{swaps}: {blocked(swaps):.2f}" if swaps <= most else "-" for swaps in (*found, most)]
        _print_row(kind, f"{doors:.0f}", f"{num_open:.0f}", *cells)


class _Case(NamedTuple):
    """An episode of which the doors are moved."""

    maze: Maze
    slots: np.ndarray  # [D, 2] int
    ends: tuple[Cell, Cell]


def _draw_cases(kind: str, count: int) -> list[_Case]:
    rng = np.random.default_rng(_SEED)
    mazes = check_mazes(kind, count)
    return [_Case(maze, door_slots(maze), sample_pair(maze, int(rng.choice(DISTANCES)), rng)) for maze in mazes]


def _nearest(blocked: Callable[[int], float], first_above: int, share: float) -> int:
    below = first_above - 1
    return below if share - blocked(below) < blocked(first_above) - share < math.inf else first_above


def _blocked_share(cases: list[_Case], num_swaps: int) -> float:
    """Returns the share of paths that so many swaps block; infinite if a maze has no map with as many."""
    try:
        shown = [
            # The first swaps of a case do not depend on their number.
            swap_doors(case.maze.walls, case.slots, num_swaps, case.ends, np.random.default_rng([_SEED, index]))
            for index, case in enumerate(cases)
        ]
    except InputError:
        return math.inf
    blocked = [is_blocked(case.maze.walls, walls, case.ends) for case, walls in zip(cases, shown, strict=True)]
    return float(np.mean(blocked))


# Agents


class Episodes(NamedTuple):
    """What came of some episodes of one kind; `E` is their number."""

    mazes: np.ndarray  # [E] int
    took: np.ndarray  # [E] float, steps or cells until the goal was reached, infinite where it was not
    shortest: np.ndarray  # [E] float, the oracle's steps, or the cells of the shortest path

    def on_time(self, factor: float) -> np.ndarray:
        """Returns `[E]` bool; of an infinite factor, where the goal was reached."""
        return np.isfinite(self.took) & (self.took <= factor * self.shortest)


@dataclasses.dataclass(frozen=True)
class Run:
    """Episodes of an agent in check mazes of one kind, for a process to play."""

    kind: str
    episodes: int
    agent: str = "oracle"
    track: str = "building"
    level: int = 1
    hide: tuple[str, ...] = ()

    def spec(self) -> TaskSpec:
        mazes = check_mazes(self.kind, -(-self.episodes // _PER_MAZE))
        told = {"level": self.level, "distances": DISTANCES, "hide": self.hide, "sensors": ("lidar",)}
        return make_spec(self.track, maps=mazes, **told)

    def trials(self, spec: TaskSpec) -> list[Trial]:
        """Returns the episodes, the same ones for all agents, tracks and levels."""
        rng = np.random.default_rng(_SEED)
        return [
            make_trial(maze, index, sample_pair(maze, int(rng.choice(DISTANCES)), rng), rng)
            for index, maze in enumerate(spec.mazes)
            for _ in range(_PER_MAZE)
        ]


def drive(run: Run) -> Episodes:
    """Plays the episodes in the world."""
    spec = run.spec()
    trials = run.trials(spec)
    interface = Interface(
        spec.task,
        spec.size,
        spec.context_size,
        sensors=spec.sensors,
        hidden=spec.hide,
        lidar=spec.lidar,
        odometry_noise=spec.odometry_noise_at(run.level),
    )
    agent_class = load_agent_class(run.agent)
    agent = agent_class.build(interface)
    took = np.full(len(trials), np.inf)
    numbered = list(enumerate(trials))
    for outcomes in run_trials(agent, spec, numbered, len(trials), 1, needs_truth=agent_class.needs_truth):
        for outcome in outcomes:
            took[outcome.index] = outcome.steps if outcome.success else np.inf
    oracle = measure_oracle_steps(spec, trials)
    return Episodes(_mazes(trials), took, np.array([steps or np.inf for steps in oracle]))


def drive_ideally(run: Run, steps_per_cell: float = 2.0, cue: Callable[[Maze], np.ndarray] | None = None) -> Episodes:
    """Plays the episodes on cells, by the ideal agent."""
    from benchmarks.ideal_agents import cells_entered, tell

    spec = run.spec()
    trials = run.trials(spec)
    took = [
        cells_entered(
            spec.mazes[trial.episode.maze].walls,
            trial.episode.goal,
            tell(spec, trial, not run.hide, cue),
            int(track_time_limit(run.track, trial.distance) / steps_per_cell),
        )
        for trial in trials
    ]
    distances = np.array([trial.distance for trial in trials], dtype=float)
    return Episodes(_mazes(trials), np.array([np.inf if cells is None else cells for cells in took]), distances)


def _mazes(trials: Sequence[Trial]) -> np.ndarray:
    return np.array([trial.episode.maze for trial in trials])


def _together(parts: Sequence[Episodes]) -> Episodes:
    """Returns the episodes of several kinds as one; their mazes are numbered on."""
    numbered = [part._replace(mazes=part.mazes + 1000 * index) for index, part in enumerate(parts)]
    return Episodes(*map(np.concatenate, zip(*numbered, strict=True)))


def check_worth(settings: Settings) -> None:
    """Prints what the oracle reaches, and what an exact map is worth to the navigator."""
    print(f"\nRight maps, {settings.episodes} episodes of each kind; on time is within {ON_TIME[0]:g} oracle steps:\n")
    _print_head("kind", "oracle: success", "steps a cell", "navigator on time", "without map", "map worth")
    oracles = [Run(kind, settings.episodes) for kind in settings.kinds]
    shown = [dataclasses.replace(run, agent="navigator") for run in oracles]
    hidden = [dataclasses.replace(run, hide=("map",)) for run in shown]
    runs = [run for of_kind in zip(oracles, shown, hidden, strict=True) for run in of_kind]
    played = _play(settings, [functools.partial(drive, run) for run in runs])
    for run in oracles:
        best, with_map, without = itertools.islice(played, 3)
        cells = np.array([trial.distance for trial in run.trials(run.spec())])
        oracle = _show_share(best, np.inf), f"{np.mean(best.took / cells):.2f}"
        _print_row(run.kind, *oracle, *_worth_cells(with_map, without, ON_TIME[0]))


def check_ideal(settings: Settings) -> None:
    """Prints what the ideal agent reaches on all tracks and levels, and what the map is worth to it."""
    runs = [Run(kind, settings.episodes) for kind in settings.kinds]
    oracle = _together(list(_play(settings, [functools.partial(drive, run) for run in runs])))
    cells = np.concatenate([[trial.distance for trial in run.trials(run.spec())] for run in runs])
    steps_per_cell = _SPARE * float(np.mean(oracle.took / cells))

    print(f"\nThe ideal agent, which takes {steps_per_cell:.2f} steps a cell; {len(cells)} episodes a level:\n")
    columns = (f"on time ({k:g}), without map, map worth" for k in ON_TIME)
    _print_head("track", "level", "success", *", ".join(columns).split(", "), "least of a kind")
    games = [
        functools.partial(drive_ideally, dataclasses.replace(run, track=track, level=level, hide=hide), steps_per_cell)
        for (track, level), hide, run in itertools.product(PARTS, ((), ("map",)), runs)
    ]
    played = _play(settings, games)
    for track, level in PARTS:
        by_kind = [list(itertools.islice(played, len(runs))) for _ in range(2)]
        shown, hidden = map(_together, by_kind)
        worths = [np.mean(1.0 * a.on_time(ON_TIME[0]) - b.on_time(ON_TIME[0])) for a, b in zip(*by_kind, strict=True)]
        least = min(zip(worths, settings.kinds, strict=True))
        row = [cell for k in ON_TIME for cell in _worth_cells(shown, hidden, k)]
        _print_row(f"`{track}`", str(level), _show_share(shown, np.inf), *row, f"{least[1]} {least[0]:.2f}")


def check_old(settings: Settings) -> None:
    """Prints what the navigator of an earlier commit reaches; `settings` name the folder of a checkout of it."""
    if settings.old_navigator is None:
        raise InputError("expected --old-navigator: a checkout, as of `git worktree add FOLDER 009eb73`")
    print(f"\nThe navigator of an earlier commit; {settings.episodes} episodes of each kind:\n")
    _print_head("track", "level", "success", *(f"on time ({k:g})" for k in ON_TIME))
    with tempfile.TemporaryDirectory() as folder:
        # Worker processes begin with the path of this one, so that they import the agents of the checkout.
        pathlib.Path(folder, "mazebench_agents").symlink_to(settings.old_navigator.resolve() / "agents")
        sys.path.insert(0, folder)
        runs = [Run(kind, settings.episodes, "navigator", *part) for part in PARTS for kind in settings.kinds]
        played = _play(settings, [functools.partial(drive, run) for run in runs])
        for track, level in PARTS:
            games = _together(list(itertools.islice(played, len(settings.kinds))))
            _print_row(f"`{track}`", str(level), *(_show_share(games, k) for k in (np.inf, *ON_TIME)))
        sys.path.remove(folder)


def check_cue(settings: Settings) -> None:
    """Prints how well a network tells from the map alone which doors have moved, and what that is worth."""
    from benchmarks.door_cues import NUM_TRAINING, measure_cue

    level = next(level for level in LEVELS if _CUE_SHARE in dict(TRACKS["rebuilt"].parts(level)).values())
    print(
        f"\nAUC of moved doors at level {level} of `rebuilt`, of a network trained on {NUM_TRAINING:,} maps of a kind;"
    )
    print(
        f"how often the ideal agent is on time ({ON_TIME[0]:g}) with and without it, in {settings.episodes} episodes:\n"
    )
    columns = ("at equal position", "position only")
    _print_head("kind", "shown open", *columns, "shown closed", *columns, "with the cue", "without", "worth")
    for kind in (kind for kind in settings.kinds if kind in KNOWN):
        aucs, cue = measure_cue(kind, _CUE_SHARE)
        run = Run(kind, settings.episodes, track="rebuilt", level=level)
        worth = _worth_cells(drive_ideally(run, cue=cue), drive_ideally(run), ON_TIME[0])
        _print_row(kind, *(f"{auc:.2f}" for auc in aucs), *worth)


def _play(settings: Settings, games: Sequence[Callable[[], Episodes]]) -> Iterator[Episodes]:
    """Yields what came of the games, in their order; worker processes play them, or this one without workers."""
    if not settings.workers:
        yield from map(operator.call, games)
        return
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(settings.workers, context) as pool:
        yield from pool.map(operator.call, games)


def _worth_cells(shown: Episodes, hidden: Episodes, factor: float) -> Iterator[str]:
    """Yields the shares that are on time with and without the map, and their difference."""
    with_map, without = 1.0 * shown.on_time(factor), 1.0 * hidden.on_time(factor)
    yield from (f"{with_map.mean():.2f}", f"{without.mean():.2f}")
    yield _show(difference_interval(with_map - without, shown.mazes))


def _show_share(played: Episodes, factor: float) -> str:
    """Returns the share of episodes that are on time; that are successes, if the factor is infinite."""
    return _show(mean_interval(1.0 * played.on_time(factor), played.mazes))


def _show(estimate: Estimate) -> str:
    return f"{estimate.value:.2f} [{estimate.low:.2f}, {estimate.high:.2f}]"


def _print_head(*cells: str) -> None:
    _print_row(*cells)
    _print_row(*["---"] * len(cells))


def _print_row(*cells: str) -> None:
    print("|", " | ".join(cells), "|", flush=True)


CHECKS = {"swaps": check_swaps, "worth": check_worth, "ideal": check_ideal, "cue": check_cue, "old": check_old}


def main(
    checks: Annotated[list[str] | None, typer.Argument(help=f"Of {', '.join(CHECKS)}; all if none is given.")] = None,
    kinds: Annotated[str, typer.Option(help="Kinds of mazes.")] = ",".join(KINDS),
    episodes: Annotated[int, typer.Option(min=1, help="Of each kind.")] = 40,
    workers: Annotated[int, typer.Option(help="Processes; 0 for this one.")] = 2,
    old_navigator: Annotated[
        pathlib.Path | None, typer.Option(help="Folder of a checkout of an earlier commit.")
    ] = None,
) -> None:
    """Check benchmark v3 before it is frozen."""
    settings = Settings(tuple(kinds.split(",")), episodes, workers, old_navigator)
    for name in checks or CHECKS:
        CHECKS[name](settings)


if __name__ == "__main__":
    typer.run(main)
