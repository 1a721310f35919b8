"""Validates an agent's answers, and turns its exceptions into one-line `AgentError`s."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np
import pydantic_core

from mazebench.agent import NO_CONFIG, Agent, AgentConfig, Inputs, Report
from mazebench.agent_loading import source_line
from mazebench.constants import DISCRETE, VELOCITIES
from mazebench.errors import InputError, RunError, describe_error
from mazebench.stopping import Stopped
from mazebench.tasks.sensors import LIDAR, unread
from mazebench.tasks.task_options import TaskOptions


class AgentError(RunError):
    """An agent raised an exception or broke its contract."""


class calling:
    """Turns an exception of the agent `name` in `method` into an `AgentError` that names the line.

    An `InputError`, which an agent raises for a checkpoint that it can't use, stays as it is. What NumPy does with
    floating-point errors is the harness's own again when the agent returns, and a process that the agent forked ends
    there.
    """

    def __init__(self, name: str, method: str):
        """Names the agent and its method."""
        self._name, self._method = name, method

    def __enter__(self) -> None:
        self._process, self._errstate = os.getpid(), np.errstate()
        self._errstate.__enter__()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        self._errstate.__exit__(None, None, None)
        if os.getpid() != self._process:
            os._exit(kind is not None)  # the run is its parent's
        if error is None or isinstance(error, (InputError, RunError, Stopped, KeyboardInterrupt)):
            return
        found = describe_error(error)  # other people's code may raise anything
        raise AgentError(f"agent {self._name!r}: {self._method}() raised {found}{source_line(error)}") from error


def context_size_of(name: str, agent_class: type[Agent], size: int) -> int:
    """Returns the M that the agent `name` needs in mazes of `size` cells a side."""
    with calling(name, "context_size"):
        return int(agent_class.context_size(size))


def sensors_of(agent_class: type[Agent], named: tuple[str, ...], config: AgentConfig = NO_CONFIG) -> tuple[str, ...]:
    """Returns the sensors of an agent's task: those named, and those that it needs if only the lidar may be named."""
    needed = (*agent_class.needs_sensors, *config.sensor_options)
    return tuple(dict.fromkeys((*named, *needed))) if named in ((), (LIDAR,)) else named


def unread_sensors(
    name: str, agent_class: type[Agent], task: TaskOptions, config: AgentConfig = NO_CONFIG
) -> str | None:
    """Returns a line that names the sensors of a task that the agent `name` does not read; None if it reads all.

    A track's own lidar is no sensor that was asked for.
    """
    own = () if task.track is None else (LIDAR,)
    with calling(name, "read_sensors"):
        read = (*agent_class.read_sensors(task.sensors), *config.sensor_options)
        return unread(f"agent {name!r}", [each for each in task.sensors if each not in own], read)


class CheckedAgent(Agent):
    """An agent whose wrong answers are `AgentError`s, which call it `name`."""

    def __init__(self, name: str, agent: Agent, kind: str):
        """Expects actions of a kind: "six", "four", "velocity" or "diff"."""
        self.name, self._agent, self._kind = name, agent, kind
        self._batch = 0  # B of the last step

    def initial_state(self, batch_size: int) -> Any:
        """Returns the agent's state before the first step."""
        with calling(self.name, "initial_state"):
            return self._agent.initial_state(batch_size)

    def act(self, inputs: Inputs, state: Any, explore: bool = False) -> tuple[np.ndarray, Any]:
        """Returns the agent's actions, which are legal, and its next state."""
        with calling(self.name, "act"):
            actions, state = self._agent.act(inputs, state, explore)
            actions = np.asarray(actions)
        self._batch = len(inputs.new_episode)
        shape: tuple[int, ...] = (self._batch,)
        names = VELOCITIES.get(self._kind, ())
        if names:
            shape += (len(names),)
            expected = f"velocities ({', '.join(names)}) of shape {shape}"
            kinds, legal = "fiu", f"finite {expected}"
        else:
            last = len(DISCRETE[self._kind]) - 1
            expected, kinds, legal = f"{shape[0]} integer actions", "iu", f"actions from 0 to {last}"
        if actions.shape != shape or actions.dtype.kind not in kinds:
            found = f"{actions.dtype} of shape {actions.shape}"
            raise AgentError(f"agent {self.name!r}: expected {expected} from act(), found {found}")
        illegal = actions[~np.isfinite(actions) if names else (actions < 0) | (actions > last)]
        if len(illegal):
            raise AgentError(f"agent {self.name!r}: expected {legal} from act(), found {illegal[0]}")
        return actions, state

    def report(self, state: Any) -> Report:
        """Returns the agent's report after its last step: poses of the right shape, and notes that JSON can hold."""
        with calling(self.name, "report"):
            answer = self._agent.report(state)
        if not isinstance(answer, Report):
            raise AgentError(f"agent {self.name!r}: expected a Report from report(), found {type(answer).__name__}")
        with calling(self.name, "report"):
            pose, notes = answer
            pose = None if pose is None else np.asarray(pose)
            notes = None if notes is None else list(notes)
        expected, shape = f"agent {self.name!r}: expected %s from report(), found %s", (self._batch, 3)
        if pose is not None and (pose.shape != shape or pose.dtype.kind not in "fiu"):
            found = f"{pose.dtype} of shape {pose.shape}"
            raise AgentError(expected % (f"poses (x, y, yaw) of shape {shape}", found))
        if pose is not None and np.isinf(pose).any():
            raise AgentError(expected % ("poses in metres and rad, NaN where unknown", "an infinite one"))
        if notes is not None and len(notes) != self._batch:
            raise AgentError(expected % (f"{self._batch} notes", len(notes)))
        try:
            return Report(pose, pydantic_core.from_json(json.dumps(notes, allow_nan=False)))  # as records are read
        except (TypeError, ValueError, RecursionError) as error:
            raise AgentError(expected % ("notes that JSON can hold", error)) from error
