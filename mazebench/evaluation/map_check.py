"""A check of an old map: the same trips with the old map, with the right one and without any, as a small suite."""

from __future__ import annotations

import dataclasses
import pathlib
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from mazebench.errors import InputError
from mazebench.evaluation.chunk import run_trials
from mazebench.evaluation.eval_options import EvalOptions, RunOptions
from mazebench.evaluation.evaluate import Progress
from mazebench.evaluation.measured_oracle import measure_steps_of_legs
from mazebench.evaluation.plan import build_agent, make_plan
from mazebench.evaluation.store import is_finished
from mazebench.evaluation.suites import Part, folders_of, run_suite
from mazebench.maps.maze_files import read_located
from mazebench.maps.older_map import OlderMap
from mazebench.maps.readers.occupancy_grid import LocatedMaze
from mazebench.maps.real_buildings import is_real, load_building
from mazebench.maps.text import format_walls
from mazebench.results.map_costs import NONE, OLD, RIGHT
from mazebench.tasks.arena import Arena, arena_of
from mazebench.tasks.streams import BUILDING, REBUILT
from mazebench.tasks.task import Task, resolve
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import DISTANCES
from mazebench.tasks.trials import Trial, spread_trials

SUITE = "check-map"
_FARTHEST_SHARE = 0.9  # of the largest distance in a building; few cells are farther apart
_DETOURS = {OLD: 1.2, RIGHT: 1.0, NONE: 1.6}  # steps of a trip by those with the right map, to tell the time


@dataclasses.dataclass(frozen=True, eq=False)
class MapCheck:
    """The trips of a check of an old map, and the task with each map."""

    tasks: dict[str, Task]  # by part
    trials: tuple[Trial, ...]
    older: tuple[OlderMap, ...]  # of each maze

    @property
    def top_speed(self) -> float:
        """The top speed of the body, in m/s."""
        return self.tasks[RIGHT].body.top_speed

    def is_finished(self, agents: Sequence[str], out: pathlib.Path) -> bool:
        """Returns whether all trips of the agents are driven."""
        folders = folders_of(agents).values()
        return all(is_finished(out / folder / part, record=True) for folder in folders for part in self.tasks)

    def run(
        self,
        agents: Sequence[str],
        out: pathlib.Path,
        run: RunOptions,
        progress: Progress,
        summing: Progress,
        **options: Any,
    ) -> None:
        """Plays what is left of the trips; arguments and errors are those of `run_suite`."""
        trials = self.trials
        if not self.is_finished(agents, out):  # measured once for all parts, since the building is the same
            legs = measure_steps_of_legs(self.tasks[RIGHT], trials, progress=summing)
            trials = tuple(replace(trial, oracle_steps=steps) for trial, (steps,) in zip(trials, legs, strict=True))
        parts = [Part(name, task.options, played=task, trials=trials) for name, task in self.tasks.items()]
        run_suite(SUITE, agents, out, run, progress, summing, own_parts=parts, **options)

    def seconds(self, agents: Sequence[str], workers: int, **options: Any) -> float:
        """Returns about how long `run` takes: by one trip of each agent with the right map, after a short one."""
        ordered, task, total = sorted(self.trials, key=lambda trial: trial.shortest_path), self.tasks[RIGHT], 0.0
        for agent in agents:
            plan = make_plan(EvalOptions(agent=agent, task=task.options, **options), trials=self.trials, task=task)
            for trial in (ordered[0], ordered[len(ordered) // 2]):
                built = build_agent(plan.options, plan.task, plan.agent_class)
                began = time.perf_counter()
                list(run_trials(built, plan.task, {0: trial}, 1, 1, needs_truth=plan.agent_class.needs_truth))
                of_trip = time.perf_counter() - began
            total += of_trip * len(self.trials) * sum(_DETOURS.values())
        return total / max(1, workers)


def plan_check(options: TaskOptions, strength: int | None, num_trips: int, seed: int = 0) -> MapCheck:
    """Returns the check of an old map.

    Args:
      options: those that matter are of the mazes and the older map, the distances and the body.
      strength: 1 to 3: of changes in four buildings, of which `options.mazes` is the old map; None for two maps.
      num_trips: in all buildings together.
      seed: of what is drawn.

    Raises:
      InputError: if a map can't be read, or the building can't be changed so.
    """
    if options.mazes is None:
        raise InputError("expected a map of the building (--mazes), found none")
    if (strength is None) == (options.shown is None):
        found = "neither" if strength is None else "both"
        raise InputError(f"expected an old map (--shown) or a strength of made changes (--changed), found {found}")
    older = _changed_buildings(options, strength) if strength else arena_of(options.replace(task=BUILDING)).shown or ()
    mazes = tuple(each.maze for each in older)
    of_right = TaskOptions(task=BUILDING, mazes=mazes, split="eval", body=options.body)
    of_old = of_right.replace(shown=tuple(format_walls(each.walls) for each in older))
    arena = arena_of(of_old, mazes, older)
    distances = options.distances or _distances(arena)
    right = resolve(of_right.replace(distances=distances))
    old = resolve(of_old.replace(distances=distances), arena=arena)
    tasks = {OLD: old, RIGHT: right, NONE: old.replace(hide=("map",))}
    return MapCheck(tasks, tuple(spread_trials(old, num_trips, seed)), older)


def _distances(arena: Arena) -> tuple[int, ...]:
    """Returns the distances of trips in m: those of a track, or in a small building the longer half of what it has."""
    farthest = min(map(arena.farthest, range(len(arena.mazes)))) * arena.cell_size
    most = max(1, int(_FARTHEST_SHARE * farthest))
    return tuple(each for each in DISTANCES if each <= most) or tuple(range(most // 2 + 1, most + 1))


def _changed_buildings(options: TaskOptions, strength: int) -> tuple[OlderMap, ...]:
    """Returns the map of a building for each of the buildings that its changes make."""
    if is_real(options.mazes):
        plan = LocatedMaze(load_building(options.mazes))
    else:
        plan = read_located(options.mazes, **dataclasses.asdict(options.reading))
    arena = arena_of(TaskOptions(task=REBUILT, level=(strength,), mazes=(plan.maze,)))
    return tuple(replace(each, origin=plan.origin) for each in arena.shown or ())
