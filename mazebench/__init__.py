"""mazebench: zero-shot navigation in unseen 3-D mazes from abstract top-down maps, on MuJoCo.

`load` gives a dm_control environment, `make_vec` many environments on all cores, and `evaluate` an agent's results.
Importing mazebench registers `mazebench/Local-13-v1` and the others with Gymnasium.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from mazebench import stopping as stopping  # first, for signals that arrive while the others are imported
from mazebench.envs.registration import register_environments

if TYPE_CHECKING:
    from mazebench.agent import Agent as Agent
    from mazebench.agent import Inputs as Inputs
    from mazebench.agent import Report as Report
    from mazebench.agent import SingleAgent as SingleAgent
    from mazebench.envs.registration import load as load
    from mazebench.envs.registration import make as make
    from mazebench.envs.registration import make_vec as make_vec
    from mazebench.errors import InputError as InputError
    from mazebench.errors import UnplayableError as UnplayableError
    from mazebench.evaluation.evaluate import evaluate as evaluate
    from mazebench.maps.changes import changed as changed
    from mazebench.maps.kinds import generate as generate
    from mazebench.maps.maze import Maze as Maze
    from mazebench.maps.maze import MazeError as MazeError
    from mazebench.maps.maze_files import read_maze as read_maze
    from mazebench.maps.maze_files import read_mazes as read_mazes
    from mazebench.maps.readers.arrays import maze_from_array as maze_from_array
    from mazebench.tasks.episode import Episode as Episode
    from mazebench.tasks.task import Task as Task
    from mazebench.tasks.task_options import TaskOptions as TaskOptions
    from mazebench.training.loop import train as train

__version__ = "0.1.0"

# Gymnasium 1.x has no plugins: a package's ids are known once it is imported.
register_environments()

# Imported when first used: MuJoCo takes long to load.
_HOMES = {
    "Agent": "mazebench.agent",
    "Episode": "mazebench.tasks.episode",
    "InputError": "mazebench.errors",
    "Inputs": "mazebench.agent",
    "Maze": "mazebench.maps.maze",
    "MazeError": "mazebench.maps.maze",
    "Report": "mazebench.agent",
    "SingleAgent": "mazebench.agent",
    "Task": "mazebench.tasks.task",
    "TaskOptions": "mazebench.tasks.task_options",
    "UnplayableError": "mazebench.errors",
    "changed": "mazebench.maps.changes",
    "evaluate": "mazebench.evaluation.evaluate",
    "generate": "mazebench.maps.kinds",
    "load": "mazebench.envs.registration",
    "make": "mazebench.envs.registration",
    "maze_from_array": "mazebench.maps.readers.arrays",
    "make_vec": "mazebench.envs.registration",
    "read_maze": "mazebench.maps.maze_files",
    "read_mazes": "mazebench.maps.maze_files",
    "train": "mazebench.training.loop",
}

__all__ = list(_HOMES)


def __dir__() -> list[str]:
    return __all__


if not TYPE_CHECKING:  # a type checker would take any name for one that is here

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module 'mazebench' has no attribute {name!r}")
        if name in ("evaluate", "train"):
            importlib.import_module("mazebench.world.backend").load_mujoco()  # for its error if MUJOCO_GL is wrong
        return getattr(importlib.import_module(_HOMES[name]), name)
