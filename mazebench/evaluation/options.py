"""What is evaluated: from options to the task, the agent and the checkpoint that they name."""

from __future__ import annotations

import dataclasses
import pathlib

from mazebench.agent import Agent, Interface
from mazebench.errors import InputError
from mazebench.evaluation.contract import CheckedAgent, calling
from mazebench.evaluation.protocol import EPISODES_PER_DISTANCE
from mazebench.tasks.context import default_context_size
from mazebench.tasks.registry import make_spec
from mazebench.tasks.spec import EVAL_DISTANCES, TaskSpec


@dataclasses.dataclass(frozen=True)
class EvalOptions:
    """What is evaluated. Two runs with equal options give the same `episodes.jsonl`."""

    agent: str
    task: str = "local"
    size: int | None = None  # of benchmark v1's mazes, 13 if not given; with `maps` only checked
    split: str = "eval"
    maps: str | None = None  # a file or folder of mazes of one's own
    distances: tuple[int, ...] = EVAL_DISTANCES
    episodes_per_distance: int = EPISODES_PER_DISTANCE
    landmark_distance: int = 5
    map_flip: float = 0.0
    map_warp: float = 0.0
    position_noise: float = 0.0
    checkpoint: str | None = None
    seed: int = 0


def is_frozen(options: EvalOptions) -> bool:
    """Whether the benchmark's eval mazes are asked for, which have frozen episodes."""
    return options.maps is None and options.split == "eval"


def make_task_spec(options: EvalOptions, agent_class: type[Agent]) -> TaskSpec:
    """The task that `options` name, with the context size that the agent wants."""
    spec = make_spec(
        options.task,
        options.size,
        options.split,
        maps=options.maps,
        distances=options.distances,
        landmark_distance=options.landmark_distance,
        map_flip=options.map_flip,
        map_warp=options.map_warp,
        position_noise=options.position_noise,
    )
    with calling(options.agent, "context_size"):
        wanted = int(getattr(agent_class, "context_size", default_context_size)(spec.size))
    return dataclasses.replace(spec, context_size=wanted)


def build_agent(options: EvalOptions, agent_class: type[Agent], task_spec: TaskSpec) -> CheckedAgent:
    """The agent for a task, held to its contract."""
    interface = Interface(options.task, task_spec.size, task_spec.context_size)
    checkpoint = None if options.checkpoint is None else pathlib.Path(options.checkpoint)
    with calling(options.agent, "build"):
        agent = agent_class.build(interface, seed=options.seed, checkpoint=checkpoint)
    return CheckedAgent(options.agent, agent, interface.num_actions)


def resolve_checkpoint(options: EvalOptions, agent_class: type[Agent]) -> EvalOptions:
    """`options` with the very file that the agent is read from, None for one that reads none.

    A run's folder may gain a newer checkpoint any time, so it is looked into once, before anything is hashed or built.

    Raises:
      InputError: if a checkpoint is given to an agent that reads none.
    """
    default = getattr(agent_class, "default_checkpoint", None)
    if options.checkpoint is None:
        return options if default is None else dataclasses.replace(options, checkpoint=str(default()))
    if default is None and not hasattr(agent_class, "build_learner") and ":" not in options.agent:
        raise InputError(f"agent {options.agent!r} reads no checkpoint; found --checkpoint {options.checkpoint}")
    return dataclasses.replace(options, checkpoint=str(_newest_checkpoint(pathlib.Path(options.checkpoint))))


def _newest_checkpoint(path: pathlib.Path) -> pathlib.Path:
    """`path` itself, or of a training run's folder, or a checkpoint's, the newest agent in it.

    Raises:
      InputError: if a folder holds none.
    """
    if not path.is_dir():
        return path
    complete = (folder for folder in path.glob("checkpoints/*") if folder.name.isdecimal())
    found = [file for folder in (path, *sorted(complete)) if (file := folder / "agent.safetensors").exists()]
    if not found:
        raise InputError(f"{path}: expected a checkpoint or the folder of a training run, found neither")
    return found[-1]
