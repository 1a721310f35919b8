"""From options to tasks: `make_spec`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from mazebench.errors import InputError, unknown
from mazebench.maps.options import MAP_OPTIONS, MapOptions
from mazebench.maps.selection import Maps
from mazebench.options import options_of
from mazebench.tasks.mazes import load_task_mazes
from mazebench.tasks.options import EVAL_DISTANCES, TASKS, TaskOptions
from mazebench.tasks.own import own_task
from mazebench.tasks.spec import TaskSpec
from mazebench.tasks.tracks import TRACKS


def make_spec(
    task: str = "local", size: int | None = None, split: str = "train", *, maps: Maps | None = None, **options: Any
) -> TaskSpec:
    """Returns a navigation task.

    Args:
      task: "local", "hierarchical" or the name of a track.
      size: N, the cells on a side of the benchmark's mazes; see `load_mazes_of`. A track has its own.
      split: "train" or "eval" mazes of the benchmark.
      maps: mazes of your own instead; see `load_mazes_of`.
      **options: those of `mazebench.tasks.options.TaskOptions` and, with `maps`, of
        `mazebench.maps.options.MapOptions`, which docs/options.md lists; None stands for the default.

    Raises:
      InputError: if an option is unknown or not allowed, or a map can't be read.
    """
    check_names(options)
    given = {name: value for name, value in options.items() if value is not None}
    map_options = MapOptions(**{name: given.pop(name) for name in MAP_OPTIONS if name in given})
    if task not in (*TASKS, *TRACKS):
        raise unknown("task", task, (*TASKS, *TRACKS))
    if task in TRACKS:
        if given.setdefault("track", task) != task:
            raise InputError(f"expected one track, found {task!r} and {given['track']!r}")
        task = "local"
    chosen = TaskOptions(task=task, **given)
    if chosen.ends_given == 2 and "distances" in given:
        raise InputError(f"start and goal are given; found distances {chosen.distances}, which would be ignored")
    mazes = load_task_mazes(chosen, size, split, maps, map_options)
    if maps is not None or chosen.ends_given:
        return own_task(mazes, task=task, **given)
    if chosen.track is not None:
        given.setdefault("distances", TRACKS[chosen.track].distances(min(chosen.level)))
    elif split == "eval":
        given.setdefault("distances", EVAL_DISTANCES)
    return TaskSpec(task=task, mazes=mazes, **given)


def check_names(options: Iterable[str], arguments: Iterable[str] = ()) -> None:
    """Checks the names of options for `make_spec`, in a call that takes `arguments` too.

    Raises:
      InputError: if there is no such option; it lists all that the call takes.
    """
    known = (*options_of(TaskOptions), *MAP_OPTIONS, "size", "split", "maps", *arguments)
    for name in options:
        if name not in known:
            raise unknown("option", name, known)
