"""From options to a task: `build_task` is the one place where a `TaskSpec` is made."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.maps.benchmark import KINDS_SIZE, load_kind_mazes
from mazebench.maps.drawn import FreshMazes, Mazes
from mazebench.maps.maze_options import MazeOptions
from mazebench.maps.selection import OwnMazes, load_mazes_of
from mazebench.options import by_name, from_names, options_of
from mazebench.tasks.context import default_context_size
from mazebench.tasks.spec import TaskSpec, check_mazes
from mazebench.tasks.task_options import (
    EVAL_DISTANCES,
    TASKS,
    TRAIN_DISTANCES,
    EnvironmentOptions,
    TaskOptions,
    Variants,
    is_own,
)
from mazebench.tasks.time_limit import TIME_LIMIT, fitting_time_limit
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.tracks.track import DISTANCES

# Of the diameter of a large maze. Few pairs of cells are farther apart, so that they would be long to find.
_FARTHEST_SHARE = 0.9


def make_spec(
    task: str = "local", size: int | None = None, split: str = "train", *, mazes: OwnMazes | None = None, **options: Any
) -> TaskSpec:
    """Returns a navigation task.

    Args:
      task: "local", "hierarchical" or the name of a track.
      size: N, the cells on a side of the benchmark's mazes: 13 (the default), 15, 17, 19 or 21; with `mazes`, a size
        that they must have. A track has its own.
      split: "train" or "eval" mazes of the benchmark.
      mazes: mazes of your own instead: a `Maze`, an array as `maze_from_array` takes it, several of these of one size,
        or the path of a file or of a folder of files.
      **options: those of `TaskOptions` and `Variants` in `mazebench.tasks.task_options`, of `MazeOptions` in
        `mazebench.maps.maze_options` and, with `mazes`, of `ReadOptions`, which docs/options.md lists; None stands for
        the default.

    Raises:
      InputError: if an option is unknown or not allowed, or a map can't be read.
    """
    check_names(options)
    values = {name: value for name, value in options.items() if value is not None}
    if "distances" in values and not np.size(values["distances"]):
        raise InputError("expected at least one distance, found none")
    if task not in (*TASKS, *TRACKS):
        raise unknown("task", task, (*TASKS, *TRACKS))
    if task in TRACKS:
        if values.setdefault("track", task) != task:
            raise InputError(f"expected one track, found {task!r} and {values['track']!r}")
        task = "local"
    values |= {"task": task, "size": size, "split": split, "mazes": mazes}
    chosen = from_names(EnvironmentOptions, values)
    return build_task(chosen.task, chosen.maze_options, chosen.variants)


def check_names(options: Iterable[str], arguments: Iterable[str] = ()) -> None:
    """Checks the names of options for `make_spec`, in a call that takes `arguments` too.

    Raises:
      InputError: if there is no such option; it lists all that the call takes.
    """
    known = (*options_of(EnvironmentOptions), *arguments)
    for name in options:
        if name not in known:
            raise unknown("option", name, known)


def build_task(
    task: TaskOptions,
    mazes: MazeOptions,
    variants: Variants | None = None,
    *,
    default_distances: tuple[int, ...] | None = None,
    choose_context_size: Callable[[int], int] = default_context_size,
) -> TaskSpec:
    """Returns the task that options name, with all that they leave open.

    Args:
      task: what is played.
      mazes: where it is played.
      variants: what evaluations don't have; None for none.
      default_distances: those in the benchmark's mazes, if the task names none and is no track; None for 1 to 5 in
        train mazes and 1 to 15 in eval mazes.
      choose_context_size: gives M for mazes of N cells on a side, if no context size is given and the task is no track.

    Raises:
      InputError: if options contradict each other or the mazes, or a map can't be read.
    """
    variants = variants or Variants()
    chosen = load_task_mazes(task, mazes)
    fits_mazes = is_own(task, mazes)
    check_mazes(task, chosen)

    # Distances: the given ones, else those that fit the mazes.
    if task.ends_given == 2 and task.distances:
        raise InputError(f"start and goal are given; found distances {task.distances}, which would be ignored")
    default_distances = default_distances or (EVAL_DISTANCES if mazes.split == "eval" else TRAIN_DISTANCES)
    distances = task.distances or _distances(task, chosen, fits_mazes, default_distances)

    # The time limit: the given one, else one in which goals of one's own are reached. Tracks have their own.
    time_limit = task.time_limit
    if task.track is not None:
        time_limit = 0
    elif not time_limit:
        cells = task.landmark_distance if task.task == "hierarchical" else max(distances)
        is_drawn = fits_mazes or mazes.is_drawn
        time_limit = fitting_time_limit(cells, chosen[0].cell_size) if is_drawn else TIME_LIMIT

    # The context: the given one, else the track's, else the one that is chosen for mazes of this size.
    size, context_size = chosen[0].size, variants.context_size
    if context_size == 0:
        context_size = TRACKS[task.track].pixels_per_cell * size if task.track else choose_context_size(size)

    computed = {
        "mazes": chosen,
        "distances": distances,
        "time_limit": time_limit,
        "context_size": context_size,
        "sensors": task.observed_sensors,
    }
    return TaskSpec(**{**by_name(task), **by_name(variants), **computed})


def load_task_mazes(task: TaskOptions, mazes: MazeOptions) -> Mazes:
    """Returns the mazes in which a task is played.

    Raises:
      InputError: if there are no such mazes, the task's track has another size, or a map can't be read.
    """
    if task.track is None:
        return load_mazes_of(mazes)
    if mazes.mazes is not None or mazes.is_drawn:
        return load_mazes_of(mazes, default_size=KINDS_SIZE)
    if mazes.size not in (None, KINDS_SIZE):
        raise InputError(f"track {task.track!r}: expected size {KINDS_SIZE}, found {mazes.size}")
    return load_kind_mazes(mazes.split)


def _distances(task: TaskOptions, mazes: Mazes, fits_mazes: bool, default: tuple[int, ...]) -> tuple[int, ...]:
    """Returns the distances in cells of a task that names none."""
    of_track = DISTANCES if task.track is not None else ()
    if not fits_mazes or isinstance(mazes, FreshMazes):
        return of_track or default

    # Of given ends, that between them.
    if task.task == "hierarchical" or task.ends_given == 2:
        return tuple(sorted({task.farthest(maze) for maze in mazes}))

    # Of a track, those that all mazes have; all of its own, if none has any.
    farthest, count = min(map(task.farthest, mazes)), len(EVAL_DISTANCES)
    if of_track:
        return tuple(distance for distance in of_track if distance <= farthest) or of_track

    # Else at most 15, evenly spaced up to what all mazes have.
    if farthest > count:
        farthest = max(count, int(_FARTHEST_SHARE * farthest))
    count = min(count, farthest)
    return tuple(round(farthest * number / count) for number in range(1, count + 1))
