"""The makers of environments: `load`, `make_vec`, and the Gymnasium ids, such as `mazebench/Local-13-v1`.

`import mazebench` registers the ids.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import gymnasium

from mazebench.constants import BENCHMARK_SIZES, RENDERING, TASK_VERSION
from mazebench.errors import InputError
from mazebench.tasks.streams import TRACK_NAMES
from mazebench.world.backend import load_mujoco, loading_backend

if TYPE_CHECKING:
    from gymnasium.vector import AutoresetMode

    from mazebench.envs.dm_control import Environment
    from mazebench.envs.goal import GoalMazeEnv
    from mazebench.envs.gym import MazeEnv
    from mazebench.envs.vector import MazeVectorEnv
    from mazebench.tasks.task import Task
    from mazebench.tasks.task_options import TaskOptions

_SINGLE = ("seed", "render_mode", "camera")  # what a single environment takes besides its task's options
_VECTOR = ("seed", "num_envs", "num_threads", "render_mode", "autoreset_mode")


def register_environments() -> None:
    """Registers every task, track and size; a second call changes nothing.

    The ids have no `max_episode_steps`, for which Gymnasium's wrapper would truncate an episode that reaches its goal
    on the last step.
    """
    for size in BENCHMARK_SIZES:
        for task in ("local", "hierarchical"):
            _register(f"{task.title()}-{size}", "make", "make_vec", task=task, id_size=size)
        _register(f"LocalGoal-{size}", "make_goal", id_size=size)
    for track in TRACK_NAMES:
        _register(track.title(), "make", "make_vec", task=track)


def _register(name: str, make: str, make_many: str | None = None, **options: str | int) -> None:
    env_id = f"mazebench/{name}-v{TASK_VERSION}"
    if env_id not in gymnasium.registry:
        gymnasium.register(
            id=env_id,
            entry_point=f"{__name__}:{make}",
            vector_entry_point=make_many and f"{__name__}:{make_many}",
            kwargs=options,
        )


def load(task: str | Task | TaskOptions = "local", *, seed: int | None = None, **options: Any) -> Environment:
    """Returns a dm_control environment of a task, or of the one that a name and the `options` of `Task.of` make.

        >>> env = mazebench.load("local", size=15, seed=0)

    Its first episode is the one of `reset(seed=seed)`. `env.physics` is a `mazebench.envs.dm_control.Physics`, and
    `env.task` a `mazebench.envs.dm_control.Task`; `env.maze_task` is the `mazebench.Task`.

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

    return Environment(_task(task, options, ("seed",)), seed)


def make(
    task: str | Task | TaskOptions = "local",
    *,
    seed: int | None = None,
    render_mode: str | None = None,
    camera: str = "top",
    id_size: int = 0,
    **options: Any,
) -> MazeEnv:
    """Returns a Gymnasium environment of a task, or of the one that a name and the `options` of `Task.of` make.

        >>> env = mazebench.make("rebuilt", level=2, sensors="egocentric")

    Observations are a dict of float32 arrays: "state" `[12]`, "context" `[4, M, M]`, and the sensors that are asked
    for, such as "lidar" `[32]` in metres. `id_size` is the size of the mazes that an id names, unless size or mazes
    are given.

    Raises:
      InputError: if an option is unknown or not allowed.
    """
    load_mujoco()
    from mazebench.envs.gym import MazeEnv

    return MazeEnv(_task(task, options, _SINGLE, id_size), seed, render_mode, camera)


def make_goal(
    *, seed: int | None = None, render_mode: str | None = None, camera: str = "top", id_size: int = 0, **options: Any
) -> GoalMazeEnv:
    """Returns a goal-conditioned environment of the local task; `options` are those of `mazebench.Task.of`."""
    load_mujoco()
    from mazebench.envs.goal import GoalMazeEnv

    return GoalMazeEnv(_task("local", options, _SINGLE, id_size), seed, render_mode, camera)


def make_vec(
    task: str | Task | TaskOptions | Sequence[str] = "local",
    num_envs: int = 1,
    *,
    seed: int | None = None,
    num_threads: int = 0,
    render_mode: str | None = None,
    autoreset_mode: AutoresetMode | str = "SameStep",
    max_episode_steps: int | None = None,
    id_size: int = 0,
    **options: Any,
) -> MazeVectorEnv:
    """Returns `num_envs` environments side by side on `num_threads` threads (0: all cores).

        >>> envs = mazebench.make_vec("building", 64, level=(1, 2), split="train")
        >>> envs = mazebench.make_vec(("building", "rebuilt", "adrift"), 64, level=(1, 2, 3))

    Of several tracks, each episode draws one, which `info["track"]` tells. They are played in the same mazes, at the
    same levels, and with contexts of one size: `context_size`, or the largest one of the tracks'.

    `autoreset_mode` says what follows the end of an episode; see `MazeVectorEnv`. `options` are those of
    `mazebench.Task.of`; `time_limit` takes the place of Gymnasium's `max_episode_steps`, which is refused. Arrays are
    those of `make` with a first axis of `num_envs`.

    Raises:
      InputError: if an option is unknown or not allowed.
    """
    load_mujoco()
    from mazebench.envs.vector import MazeVectorEnv

    if isinstance(task, Sequence) and not isinstance(task, str):
        from mazebench.options import check_names
        from mazebench.tasks.task import tasks_of_tracks
        from mazebench.tasks.task_options import TaskOptions

        check_names(options, TaskOptions, arguments=_VECTOR)
        tasks = tasks_of_tracks(task, **options)
    else:
        tasks = (_task(task, options, _VECTOR, id_size),)
    if max_episode_steps is not None:
        raise InputError(f"expected time_limit in the place of max_episode_steps, found {max_episode_steps}")
    return MazeVectorEnv(tasks, num_envs, seed, num_threads, render_mode, autoreset_mode=autoreset_mode)


for _entry_point in (make, make_goal, make_vec):
    vars(_entry_point)["metadata"] = RENDERING  # by which Gymnasium adds its wrappers of other render modes


def _task(task: str | Task | TaskOptions, options: dict[str, Any], arguments: Sequence[str], id_size: int = 0) -> Task:
    """Returns the task of an environment that takes `arguments` besides `options`."""
    from mazebench.tasks.task import Task, as_asked, resolve

    if isinstance(task, Task) and not options:
        return task
    if options.get("mazes") is None and options.get("size") is None and id_size:
        options["size"] = id_size
    return resolve(as_asked(task, options, arguments))
