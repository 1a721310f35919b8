"""The Gymnasium ids, such as `mazebench/Local-13-v1` and `mazebench/Stale-13-v2`; `import mazebench` registers them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium

from mazebench.maps import BENCHMARK_SIZES
from mazebench.tasks import TASK_VERSION, TRACKS_VERSION

if TYPE_CHECKING:
    from mazebench.envs.goal import GoalMazeEnv
    from mazebench.envs.gym import MazeEnv
    from mazebench.envs.vector import MazeVectorEnv

_TASKS = {"Local": "local", "Hierarchical": "hierarchical"}
# Tracks by title and size, with the level that is played if none is given. `TRACKS` has the same ones; it is not read
# here because `import mazebench` should load little.
_TRACKS = {
    ("Stale", 13): 1,
    ("Lost", 13): 1,
    ("Sketch", 13): 1,
    ("Far", 31): 1,
    ("Far", 51): 2,
}


def register_environments() -> None:
    """Registers every task, track and size; a second call changes nothing.

    The ids have no `max_episode_steps`: Gymnasium's wrapper would truncate an episode that reaches its goal on the last
    step.
    """
    for title, task in _TASKS.items():
        for size in BENCHMARK_SIZES:
            env_id = f"mazebench/{title}-{size}-v{TASK_VERSION}"
            _register(env_id, {"task": task, "size": size})
    for (title, size), level in _TRACKS.items():
        env_id = f"mazebench/{title}-{size}-v{TRACKS_VERSION}"
        _register(env_id, {"task": title.lower(), "size": size, "level": level})
    for size in BENCHMARK_SIZES:
        env_id = f"mazebench/LocalGoal-{size}-v{TASK_VERSION}"
        if env_id not in gymnasium.registry:
            gymnasium.register(env_id, "mazebench.envs.registration:make_goal_env", kwargs={"size": size})


def _register(env_id: str, options: dict[str, Any]) -> None:
    if env_id not in gymnasium.registry:
        gymnasium.register(
            id=env_id,
            entry_point="mazebench.envs.registration:make_env",
            vector_entry_point="mazebench.envs.registration:make_vec",
            kwargs=options,
        )


def make_env(
    task: str = "local", *, seed: int | None = None, render_mode: str | None = None, camera: str = "top", **options: Any
) -> MazeEnv:
    """Returns a `MazeEnv`; `options` are those of `mazebench.make_spec`."""
    from mazebench.envs.gym import MazeEnv
    from mazebench.tasks.registry import make_spec

    return MazeEnv(make_spec(task, **options), seed, render_mode, camera)


def make_goal_env(
    *, seed: int | None = None, render_mode: str | None = None, camera: str = "top", **options: Any
) -> GoalMazeEnv:
    """Returns a `GoalMazeEnv` of the local task; `options` are those of `mazebench.make_spec`."""
    from mazebench.envs.goal import GoalMazeEnv
    from mazebench.tasks.registry import make_spec

    return GoalMazeEnv(make_spec("local", **options), seed, render_mode, camera)


def make_vec(
    task: str = "local",
    num_envs: int = 1,
    *,
    seed: int | None = None,
    num_threads: int = 0,
    render_mode: str | None = None,
    **options: Any,
) -> MazeVectorEnv:
    """Returns `num_envs` environments side by side on `num_threads` threads (0: all cores).

    `options` are those of `mazebench.make_spec`.
    """
    from mazebench.envs.vector import MazeVectorEnv
    from mazebench.tasks.registry import make_spec

    return MazeVectorEnv(make_spec(task, **options), num_envs, seed, num_threads, render_mode)
