"""The makers of environments: `load`, `make_vec`, and the Gymnasium ids, such as `mazebench/Local-13-v1`.

`import mazebench` registers the ids.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import gymnasium

from mazebench.constants import BENCHMARK_SIZES, TASK_VERSION, TRACK_NAMES
from mazebench.errors import InputError
from mazebench.world.backend import load_mujoco, loading_backend

if TYPE_CHECKING:
    from gymnasium.vector import AutoresetMode

    from mazebench.envs.dm_control import Environment
    from mazebench.envs.goal import GoalMazeEnv
    from mazebench.envs.gym import MazeEnv
    from mazebench.envs.vector import MazeVectorEnv
    from mazebench.tasks.spec import TaskSpec

_SINGLE = ("seed", "render_mode", "camera")  # what a single environment takes besides its task's options
_VECTOR = ("seed", "num_envs", "num_threads", "render_mode", "autoreset_mode")


def register_environments() -> None:
    """Registers every task, track and size; a second call changes nothing.

    The ids have no `max_episode_steps`: Gymnasium's wrapper would truncate an episode that reaches its goal on the last
    step.
    """
    for size in BENCHMARK_SIZES:
        for task in ("local", "hierarchical"):
            _register(f"{task.title()}-{size}", "make_env", "make_vec", task=task, id_size=size)
        _register(f"LocalGoal-{size}", "make_goal_env", id_size=size)
    for track in TRACK_NAMES:
        _register(track.title(), "make_env", "make_vec", task=track)


def _register(name: str, make: str, make_many: str | None = None, **options: str | int) -> None:
    env_id = f"mazebench/{name}-v{TASK_VERSION}"
    if env_id not in gymnasium.registry:
        gymnasium.register(
            id=env_id,
            entry_point=f"{__name__}:{make}",
            vector_entry_point=make_many and f"{__name__}:{make_many}",
            kwargs=options,
        )


def load(
    task: str = "local", size: int | None = None, split: str = "train", seed: int | None = None, **options: Any
) -> Environment:
    """Returns a dm_control environment of a navigation task; `options` are those of `mazebench.make_spec`.

    Its first episode is the one of `reset(seed=seed)`. `env.physics` and `env.task` are a
    `mazebench.envs.dm_control.Physics` and a `mazebench.envs.dm_control.Task`.

    Raises:
      InputError: if an option is unknown or not allowed, or dm_control is not installed.
    """
    if find_spec("dm_control") is None:
        raise InputError(
            "mazebench.load needs dm_control, which is not installed: pip install --no-deps dm-control (it requires "
            "labmaze, which is not needed here and has no wheels for Python 3.13 and later)"
        )
    with loading_backend():
        from mazebench.envs.dm_control import Environment

    return Environment(_task_spec(task, {"size": size, "split": split, **options}, ("seed",)), seed)


def make_env(
    task: str = "local", *, seed: int | None = None, render_mode: str | None = None, camera: str = "top", **options: Any
) -> MazeEnv:
    """Returns a `MazeEnv`; `options` are those of `mazebench.make_spec`."""
    load_mujoco()
    from mazebench.envs.gym import MazeEnv

    return MazeEnv(_task_spec(task, options, _SINGLE), seed, render_mode, camera)


def make_goal_env(
    *, seed: int | None = None, render_mode: str | None = None, camera: str = "top", **options: Any
) -> GoalMazeEnv:
    """Returns a `GoalMazeEnv` of the local task; `options` are those of `mazebench.make_spec`."""
    load_mujoco()
    from mazebench.envs.goal import GoalMazeEnv

    return GoalMazeEnv(_task_spec("local", options, _SINGLE), seed, render_mode, camera)


def make_vec(
    task: str = "local",
    num_envs: int = 1,
    *,
    seed: int | None = None,
    num_threads: int = 0,
    render_mode: str | None = None,
    autoreset_mode: AutoresetMode | str = "SameStep",
    **options: Any,
) -> MazeVectorEnv:
    """Returns `num_envs` environments side by side on `num_threads` threads (0: all cores).

    `autoreset_mode` says what follows the end of an episode; see `MazeVectorEnv`. `options` are those of
    `mazebench.make_spec`.
    """
    load_mujoco()
    from mazebench.envs.vector import MazeVectorEnv

    task_spec = _task_spec(task, options, _VECTOR)
    return MazeVectorEnv(task_spec, num_envs, seed, num_threads, render_mode, autoreset_mode=autoreset_mode)


def _task_spec(task: str, options: dict[str, Any], arguments: Iterable[str]) -> TaskSpec:
    """Returns the task of an environment that takes `arguments` besides `options`.

    The size that an id names is the size of the mazes unless a size or mazes are given.

    Raises:
      InputError: as `mazebench.make_spec`.
    """
    from mazebench.envs.env_spec import with_mazes
    from mazebench.tasks.build import check_names, make_spec

    id_size = options.pop("id_size", None)  # the size that an id names
    if options.get("mazes") is None and options.get("size") is None:
        options["size"] = id_size
    check_names(options, arguments)
    return make_spec(task, **with_mazes(options))
