"""Validates an agent's answers, and turns its exceptions into one-line `AgentError`s."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from mazebench.agent import Agent, Inputs
from mazebench.agent_loading import source_line
from mazebench.errors import InputError, RunError, shortened
from mazebench.maps.benchmark import SIZES
from mazebench.maps.maze import MAX_SIZE
from mazebench.tasks.sensors import SENSORS
from mazebench.tasks.spec import MIN_CONTEXT_SIZE


class AgentError(RunError):
    """An agent raised an exception or broke its contract."""


@contextmanager
def calling(name: str, method: str) -> Iterator[None]:
    """Turns an exception of the agent `name` in `method` into an `AgentError` that names the line.

    An `InputError`, which an agent raises for a checkpoint that it can't use, stays as it is.
    """
    try:
        yield
    except (InputError, RunError):
        raise
    except (Exception, SystemExit) as error:  # other people's code may raise anything
        found = shortened(f"{type(error).__name__}: {error}").removesuffix(":")
        is_sensor = isinstance(error, KeyError) and str(error).strip("'") in SENSORS
        way_out = f"; a sensor is observed with needs_sensors = ({error.args[0]!r},)" if is_sensor else ""
        raise AgentError(f"agent {name!r}: {method}() raised {found}{source_line(error)}{way_out}") from error


def context_size_of(name: str, agent_class: type[Agent], size: int) -> int:
    """Returns the M that the agent `name` needs in mazes of `size` cells a side.

    Raises:
      AgentError: if it is no whole number, or there are no contexts of that size.
    """
    with calling(name, "context_size"):
        found = agent_class.context_size(size)
    if not (isinstance(found, int | np.integer) and MIN_CONTEXT_SIZE <= found <= MAX_SIZE):
        expected = f"a whole number from {MIN_CONTEXT_SIZE} to {MAX_SIZE}"
        raise AgentError(f"agent {name!r}: expected context_size() to return {expected}, found {_short(found)}")
    return int(found)


def only_context_size(name: str, agent_class: type[Agent], size: int) -> int | None:
    """Returns the M that the agent `name` needs whatever the size of the mazes is; None if it depends on the size."""
    try:
        found = {context_size_of(name, agent_class, each) for each in (SIZES[0], SIZES[-1], size)}
    except (InputError, RunError):  # not meant for mazes of all these sizes
        return None
    return found.pop() if len(found) == 1 else None


class CheckedAgent(Agent):
    """An agent whose wrong answers are `AgentError`s."""

    def __init__(self, name: str, agent: Agent, num_actions: int):
        """Messages call the agent `name`."""
        self.name, self._agent, self._num_actions = name, agent, num_actions

    def initial_state(self, batch_size: int) -> Any:
        """Returns the agent's state before the first step."""
        with calling(self.name, "initial_state"):
            return self._agent.initial_state(batch_size)

    def act(self, inputs: Inputs, state: Any, explore: bool = False) -> tuple[np.ndarray, Any]:
        """Returns the agent's actions, `[B]` int in range, and its next state."""
        with calling(self.name, "act"):
            answer = self._agent.act(inputs, state, explore)
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise AgentError(f"agent {self.name!r}: expected act() to return (actions, state), found {_short(answer)}")
        with calling(self.name, "act"):
            actions = np.asarray(answer[0])
        fault = self._fault(actions, len(inputs.new_episode))
        if fault:
            raise AgentError(f"agent {self.name!r}: expected act() to return {fault}")
        return actions, answer[1]

    def _fault(self, actions: np.ndarray, batch_size: int) -> str | None:
        """Returns what was expected of `actions` and what was found; None if they are right."""
        if actions.dtype == object:
            wrong = next((value for value in actions.ravel() if not isinstance(value, int | np.integer)), actions.dtype)
            return f"integer actions, found {_short(wrong)}"
        if actions.shape != (batch_size,):
            return f"{batch_size} actions, one an environment, found shape {actions.shape}"
        if not np.issubdtype(actions.dtype, np.integer):
            return f"integer actions, found {actions.dtype}"
        illegal = actions[(actions < 0) | (actions >= self._num_actions)]
        return f"actions from 0 to {self._num_actions - 1}, found {illegal[0]}" if len(illegal) else None


def _short(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    return shortened(repr(value), 80)
