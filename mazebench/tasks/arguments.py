"""Checks of the arguments of environments besides a task."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Annotated, Any

from annotated_types import Ge

from mazebench.errors import InputError, unknown
from mazebench.options import OneOf, Options
from mazebench.tasks.task import Task
from mazebench.world.rendering import CAMERAS


@dataclasses.dataclass(frozen=True, kw_only=True)
class Arguments(Options):
    """The arguments of an environment; each constructor gives those that it has."""

    seed: Annotated[int | None, Ge(0)] = None  # of the first reset
    render_mode: Annotated[str | None, OneOf("rgb_array")] = None  # of `render`
    camera: Annotated[str, OneOf(*CAMERAS)] = "top"  # whose pictures `render` returns
    num_envs: Annotated[int, Ge(1)] = 1  # environments side by side
    num_threads: Annotated[int, Ge(0)] = 0  # of the simulation; 0 uses all cores


def reset_options(options: Mapping[str, Any] | None, *names: str) -> Mapping[str, Any]:
    """Returns the options of a reset, or raises `InputError` if they are no mapping or have others than `names`."""
    if not isinstance(options, Mapping | None):
        raise InputError(f"expected options as a dict, found {type(options).__name__}")
    for name in options or {}:
        if name not in names:
            raise unknown("option", name, names)
    return options or {}


def require_task(task: Task) -> None:
    """Raises `InputError` unless `task` is one, which a task's name, for example, is not."""
    if not isinstance(task, Task):
        raise InputError(f"expected a Task, as mazebench.Task.of() returns, found {type(task).__name__}")
