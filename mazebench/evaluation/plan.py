"""The plan of an evaluation: agent, task, episodes and identity, complete before anything is run or written."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import pathlib
from collections.abc import Callable, Sequence
from typing import Any

from mazebench.agent import Agent, AgentConfig
from mazebench.agent_loading import load_agent_class
from mazebench.constants import EPISODES_PER_DISTANCE, FROZEN_PER_MAZE
from mazebench.errors import InputError, RunError, UnplayableError, remark
from mazebench.evaluation.checked_agent import (
    AgentError,
    CheckedAgent,
    calling,
    context_size_of,
    sensors_of,
    unread_sensors,
)
from mazebench.evaluation.eval_options import EPISODES, EvalOptions
from mazebench.evaluation.provenance import provenance
from mazebench.maps.benchmark import SIZES
from mazebench.maps.real_buildings import is_real
from mazebench.options import override
from mazebench.results.records import Provenance
from mazebench.tasks.context import default_context_size
from mazebench.tasks.task import Task, options_of, resolve_for_evaluation
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.trials import Trial, counting_option, select_trials
from mazebench.world.mjcf import largest_spec

# Of a provenance: what must be the same in all processes of a run, besides the options.
_IDENTIFYING = (
    "task_version",
    "benchmark_manifest_sha256",
    "mazes_sha256",
    "agent_package",
    "agent_code_sha256",
    "checkpoint_sha256",
    "map_reader_sha256",
)
# How many episodes there are, by the name of the option that says it.
_COUNTING = {
    "episodes_per_maze": "episodes_per_maze for a track's frozen episodes",
    "episodes_per_distance": "episodes_per_distance except for a track's frozen episodes",
    None: "one episode in each maze of the hierarchical task",
}


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """Everything that one evaluation will run."""

    options: EvalOptions  # with the very file of the checkpoint
    task: Task  # as the agent plays it: with its actions and sensors, and maps of the size that it asks for
    agent_class: type[Agent]
    trials: Sequence[Trial]  # in the protocol's order, by which they are numbered
    identity: dict[str, Any]  # the content of config.json; only runs of equal identity are resumed
    provenance: Provenance  # where the result will come from

    @property
    def untrained_scale(self) -> bool:
        """True if the agent learned on maps of another scale, in metres per cell of the context."""
        return self._learned_scale not in (None, self._scale)

    @property
    def chosen_config(self) -> dict[str, Any]:
        """The values of the agent's config that are not the default ones and may change results."""
        configs = config_of(self.options, self.agent_class), self.agent_class.eval_config
        chosen, usual = (config.identity() if config else {} for config in configs)
        return {name: value for name, value in chosen.items() if value != usual[name]}

    def check_spread(self, workers: int, machines: bool = False) -> None:
        """Raises `InputError` if the agent's config rules out worker processes or other machines that are asked for."""
        config = config_of(self.options, self.agent_class)
        if machines and config is not None and config.needs_one_machine:
            raise InputError(f"agent {self.options.agent!r}: expected one machine, found a cluster, executor or shard")
        if workers and config is not None and config.needs_one_process:
            raise InputError(f"agent {self.options.agent!r}: expected no --workers with this config, found {workers}")

    def say_remarks(self, *, of_maps: bool = True) -> None:
        """Warns of the sensors that the agent does not read and, with `of_maps`, of maps for which it is not made."""
        unread = unread_sensors(self.options.agent, self.agent_class, self.task.options)
        for line in (self.remark if of_maps else None, unread):
            if line:
                remark(line)

    @property
    def remark(self) -> str | None:
        """A line of what a user should know of the maps before the evaluation; None if there is nothing."""
        task, agent, size = self.task, self.options.agent, _square(self.task.context_size)
        is_coarse = task.options.track is None and task.context_size < task.size
        way_out = "; context_size() of its class chooses another one (docs/custom_agents.md)" if is_coarse else ""
        if self.untrained_scale:
            return (
                f"{agent} learned on maps of {self._learned_scale:g} m a cell and may fail here: its map of {size} "
                f"cells shows {_square(task.size)} cells of {task.cell_size:g} m, {self._scale:.3g} m a cell{way_out}"
            )
        if task.options.mazes is not None and is_coarse:
            return f"{agent} is shown the {_square(task.size)} cells as a map of {size}{way_out}"
        if task.options.track is not None:
            try:
                wanted = context_size_of(agent, self.agent_class, task.size)
            except (InputError, RunError):  # not meant for mazes of this size
                return None
            if wanted not in (task.context_size, default_context_size(task.size)):
                track = task.options.track
                return f"{agent} asks for a map of {_square(wanted)}; the track {track!r} shows {size} to all agents"
        return None

    @property
    def _scale(self) -> float:  # m a cell of the context
        return self.task.mazes[0].side / self.task.context_size

    @property
    def _learned_scale(self) -> float | None:
        """The scale of the maps on which the agent learned; None where no checkpoint says it.

        Checkpoints of the kind that `mazebench train` writes do. It trains in mazes whose cells are 1 m wide.
        """
        for told in ((self.provenance.model_extra or {}).get("checkpoint_metadata") or {}).values():
            if isinstance(told, dict) and "context_size" in told:
                size = told.get("provenance", {}).get("size")
                return None if size is None else size / told["context_size"]
        return None


def config_of(options: EvalOptions, agent_class: type[Agent]) -> AgentConfig | None:
    """Returns the agent's config with the values that were asked for; None if its class declares none."""
    if agent_class.eval_config is not None:
        return override(agent_class.eval_config, options.overrides)
    if options.overrides:
        raise InputError(f"agent {options.agent!r}: has no config in evaluations, found --set {min(options.overrides)}")
    return None


def build_agent(
    options: EvalOptions, task: Task, agent_class: type[Agent], folder: pathlib.Path | None = None
) -> CheckedAgent:
    """Returns a new agent of a plan, for its task, held to its contract.

    `folder` is where an agent with a config may keep files of its own.

    Raises:
      InputError: if the agent can't use its checkpoint.
      UnplayableError: if the agent can't play the task.
    """
    interface = task.interface
    checkpoint = None if options.checkpoint is None else pathlib.Path(options.checkpoint)
    try:
        wanted = {context_size_of(options.agent, agent_class, size) for size in (SIZES[0], SIZES[-1], interface.size)}
    except (InputError, RunError):  # not meant for mazes of all these sizes
        wanted = set()
    if len(wanted) == 1 and interface.context_size not in wanted:
        raise UnplayableError(
            f"agent {options.agent!r}: its context_size() asks for maps of {_square(wanted.pop())} only; the track "
            f"{task.options.track!r} shows {_square(interface.context_size)}"
        )
    if needed := [name for name in agent_class.needs_shown if name in interface.hidden]:
        raise UnplayableError(f"agent {options.agent!r}: needs the {needed[0]}, found it hidden")
    if interface.actions not in (plays := agent_class.plays_actions):
        raise UnplayableError(
            f"agent {options.agent!r}: plays the actions {', '.join(plays)}, found {interface.actions}"
        )
    config = config_of(options, agent_class)
    more: dict[str, Any] = {} if config is None else {"config": config, "folder": folder}
    with calling(options.agent, "build"):
        agent = agent_class.build(interface, seed=options.seed, checkpoint=checkpoint, **more)
    if not isinstance(agent, Agent):
        raise AgentError(f"agent {options.agent!r}: expected an Agent from build(), found {type(agent).__name__}")
    return CheckedAgent(options.agent, agent, interface.actions)


def make_plan(
    options: EvalOptions,
    agent_class: type[Agent] | None = None,
    trials: Sequence[Trial] | None = None,
    resolver: Callable[..., Task] = resolve_for_evaluation,
    task: Task | None = None,
) -> Plan:
    """Returns the plan of an evaluation; reads what is needed and writes nothing.

    Args:
      options: what to evaluate.
      agent_class: the class that `options.agent` names, if it is loaded already.
      trials: other episodes than those of the evaluation.
      resolver: makes the task of the options, as `mazebench.tasks.task.resolve` does.
      task: the task whose options are `options.task`, if it is there already.

    Raises:
      InputError: if an option can't be met.
    """
    agent_class = agent_class or load_agent_class(options.agent)
    task = task_as_played(options.agent, agent_class, task or options.task, resolver)
    _check_episodes(options, task.options)
    options, config = _with_checkpoint(options, agent_class), config_of(options, agent_class)
    if task.options.track is None or task.options.mazes is None:
        options = options.replace(episodes_per_distance=options.episodes_per_distance or EPISODES_PER_DISTANCE)
    if ":" in options.agent:  # modules that it imports when it is built are part of its code
        with contextlib.suppress(InputError, RunError):  # which it raises again when it is run
            build_agent(options, task, agent_class)
    given = {"episodes_sha256": _episodes_hash(trials)} if trials else {}
    if trials is None:
        trials = select_trials(task, options.episodes_per_distance, options.seed, options.episodes_per_maze)
    origin = provenance(options, task, agent_class)
    world = largest_spec(task.mazes[0], task.body)  # the hash of the mazes tells the walls, too
    all_of_maze = None if task.options.is_frozen_building else FROZEN_PER_MAZE
    is_part = options.episodes_per_maze not in (None, all_of_maze)
    identity = {
        "agent": options.agent,
        **task.options.to_json(),
        "mazes": _own_or_real(task.options.mazes),  # the hash tells those of one's own apart, as it does older maps
        **({} if task.options.shown is None else {"shown": _own_or_real(task.options.shown)}),
        "episodes_per_distance": options.episodes_per_distance,
        **({"episodes_per_maze": options.episodes_per_maze} if is_part else {}),
        **given,
        **({} if config is None else {"config": config.identity()}),
        "seed": options.seed,
        **{name: value for name in _IDENTIFYING if (value := getattr(origin, name)) or name != "map_reader_sha256"},
        "mujoco": origin.packages.get("mujoco"),
        "world_sha256": hashlib.sha256(world.to_xml().encode("utf-8")).hexdigest(),
    }
    if options.checkpoint is not None:  # agents may change the working folder
        options = dataclasses.replace(options, checkpoint=str(pathlib.Path(options.checkpoint).absolute()))
    return Plan(options, task, agent_class, trials, identity, provenance=origin)


def _episodes_hash(trials: Sequence[Trial]) -> str:
    episodes = [dataclasses.astuple(trial.episode) for trial in trials]
    return hashlib.sha256(repr(episodes).encode("ascii")).hexdigest()


def _own_or_real(mazes: Any) -> str | None:
    """Returns the name of a real building; "own" for other mazes or older maps, None for the benchmark's."""
    if mazes is None:
        return None
    return mazes if is_real(mazes) else "own"


def _square(side: int) -> str:
    return f"{side} x {side}"


def task_as_played(
    agent: str, agent_class: type[Agent], asked: TaskOptions | Task, resolver: Callable[..., Task]
) -> Task:
    """Returns the task with what the agent asks for: its actions, sensors and, off the tracks, size of maps.

    Raises:
      UnplayableError: if sensors other than the lidar are named, and the agent needs more.
    """
    options, plays = options_of(asked), agent_class.plays_actions
    chosen: dict[str, Any] = {}
    if options.actions is None and "six" not in plays:
        chosen["actions"] = plays[0]
    chosen["sensors"] = sensors_of(agent_class, options.sensors)
    if isinstance(asked, TaskOptions):
        chosen["context_size"] = None
    chosen = {name: value for name, value in chosen.items() if value != getattr(options, name)}
    task = resolver(
        asked.replace(**chosen) if chosen else asked,
        context_size_of=functools.partial(context_size_of, agent, agent_class),
    )
    for name in agent_class.needs_sensors:
        task.interface.require_sensor(name, agent)
    return task


def _check_episodes(options: EvalOptions, task: TaskOptions) -> None:
    """Raises `InputError` if a number of episodes is given that the task would ignore."""
    counting = counting_option(task)
    for name in EPISODES:
        if (number := getattr(options, name)) is not None and name != counting:
            raise InputError(f"expected {_COUNTING[counting]}, found {name} {number}")


def _with_checkpoint(options: EvalOptions, agent_class: type[Agent]) -> EvalOptions:
    """Returns `options` with the very file that the agent is read from, None for an agent that reads none.

    A run's folder may gain a newer checkpoint any time, so it is looked into once, before anything is hashed or built.

    Raises:
      InputError: if a checkpoint is given to an agent that reads none, or a folder holds none.
    """
    with calling(options.agent, "default_checkpoint"):
        default = agent_class.default_checkpoint()
    if options.checkpoint is None:
        return options if default is None else dataclasses.replace(options, checkpoint=str(default))
    if default is None and not agent_class.learns and ":" not in options.agent:
        raise InputError(f"agent {options.agent!r} reads no checkpoint; found --checkpoint {options.checkpoint}")
    path = pathlib.Path(options.checkpoint)
    if path.is_dir():  # of a checkpoint or of a training run, whose newest one counts
        complete = (folder for folder in path.glob("checkpoints/*") if folder.name.isdecimal())
        found = [file for folder in (path, *sorted(complete)) if (file := folder / "agent.safetensors").exists()]
        if not found:
            raise InputError(f"{path}: expected a checkpoint or the folder of a training run, found neither")
        path = found[-1]
    return dataclasses.replace(options, checkpoint=str(path))
