"""Checks of the arguments that the constructors of environments take besides a task."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge

from mazebench.errors import InputError
from mazebench.options import OneOf, options
from mazebench.tasks.task import Task
from mazebench.world.rendering import CAMERAS


@options
class Arguments:
    """The arguments of an environment; each constructor gives those that it has."""

    seed: Annotated[int | None, Ge(0)] = None  # of the first reset
    render_mode: Annotated[str | None, OneOf("rgb_array")] = None  # of `render`
    camera: Annotated[str, OneOf(*CAMERAS)] = "top"  # whose pictures `render` returns
    num_envs: Annotated[int, Ge(1)] = 1  # environments side by side
    num_threads: Annotated[int, Ge(0)] = 0  # of the simulation; 0 uses all cores


def require_task_spec(task_spec: Task) -> None:
    """Raises `InputError` unless `task_spec` is one, which a task's name, for example, is not."""
    if not isinstance(task_spec, Task):
        raise InputError(f"expected a Task, as mazebench.Task.of() returns, found {type(task_spec).__name__}")
