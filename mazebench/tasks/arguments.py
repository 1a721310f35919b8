"""What the constructors of environments take beside a task, checked."""

from __future__ import annotations

import dataclasses

from mazebench.errors import InputError
from mazebench.options import Options, option
from mazebench.tasks.spec import TaskSpec
from mazebench.world.rendering import CAMERAS


@dataclasses.dataclass(frozen=True, kw_only=True)
class Arguments(Options):
    """The arguments of an environment; each constructor gives those that it has.

    Raises:
      InputError: if a value is not allowed.
    """

    seed: int | None = option(None, "Seed of the first reset.", lowest=0)
    render_mode: str | None = option(None, "What `render` returns.", choices=("rgb_array",))
    camera: str = option("top", "Whose pictures `render` returns.", choices=CAMERAS)
    num_envs: int = option(1, "Environments side by side.", lowest=1)
    num_threads: int = option(0, "Threads of the simulation; 0 uses all cores.", lowest=0)

    def __post_init__(self) -> None:
        if self.render_mode == "human":
            raise InputError("expected render_mode 'rgb_array', found 'human'; `mazebench play` opens a window")
        super().__post_init__()


def require_task_spec(task_spec: TaskSpec) -> None:
    """Raises `InputError` unless `task_spec` is one, which a task's name, for example, is not."""
    if not isinstance(task_spec, TaskSpec):
        raise InputError(f"expected a TaskSpec, as mazebench.make_spec() returns, found {type(task_spec).__name__}")
