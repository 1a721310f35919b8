"""From options to tasks and environments: `make_spec` and `load`."""

from __future__ import annotations

from typing import Any

from mazebench.errors import unknown
from mazebench.maps.selection import Maps, load_mazes_of
from mazebench.options import options_of
from mazebench.tasks.navigation import Environment
from mazebench.tasks.options import EVAL_DISTANCES, TaskOptions
from mazebench.tasks.spec import TaskSpec


def make_spec(
    task: str = "local", size: int | None = None, split: str = "train", *, maps: Maps | None = None, **options: Any
) -> TaskSpec:
    """Returns a navigation task.

    Args:
      task: "local" or "hierarchical".
      size: N, the cells on a side of the benchmark's mazes; see `load_mazes_of`.
      split: "train" or "eval" mazes of benchmark v1.
      maps: mazes of your own instead.
      **options: those of `mazebench.tasks.options.TaskOptions`, which docs/options.md lists; None stands for the
        default.

    Raises:
      InputError: if an option is unknown or not allowed, or a map can't be read.
    """
    known = options_of(TaskOptions)
    for name in options:
        if name not in known:
            raise unknown("option", name, known)
    given = {name: value for name, value in options.items() if value is not None}
    if split == "eval" and maps is None:
        given.setdefault("distances", EVAL_DISTANCES)
    return TaskSpec(task=task, mazes=load_mazes_of(size, split, maps), **given)


def load(
    task: str = "local", size: int | None = None, split: str = "train", seed: int | None = None, **options: Any
) -> Environment:
    """Returns a dm_control environment of a navigation task; `options` are those of `make_spec`.

    Its first episode is the one of `reset(seed=seed)`. `env.physics` and `env.task` are a
    `mazebench.world.physics.Physics` and a `mazebench.tasks.navigation.Navigation`.
    """
    return Environment(make_spec(task, size, split, **options), seed)
