"""Holds an agent to its contract: whatever it gets wrong becomes one line that names it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from mazebench.agent import Agent, Observation, place_of
from mazebench.errors import InputError, RunError


class AgentError(RunError):
    """An agent raised an exception or broke its contract."""


@contextmanager
def calling(name: str, method: str) -> Iterator[None]:
    """Around a call of the agent called `name`: turns what it raises into an `AgentError` that says where.

    An agent's own `InputError`, of a checkpoint that it can't use, stays as it is.
    """
    try:
        yield
    except (InputError, RunError):
        raise
    except (Exception, SystemExit) as error:  # other people's code may raise anything
        said = " ".join(f"{type(error).__name__}: {error}".split())[:300].removesuffix(":")
        raise AgentError(f"agent {name!r}: {method}() raised {said}{place_of(error)}") from error


class CheckedAgent:
    """An agent as the runner calls it; a wrong answer is an `AgentError`."""

    def __init__(self, name: str, agent: Agent, num_actions: int):
        """`name` is what messages call it."""
        self.name, self._agent, self._num_actions = name, agent, num_actions
        self._seed_episodes = getattr(agent, "seed_episodes", None)

    def initial_state(self, batch_size: int) -> Any:
        """The agent's state at the beginning."""
        with calling(self.name, "initial_state"):
            return self._agent.initial_state(batch_size)

    def seed_episodes(self, seeds: np.ndarray, mask: np.ndarray) -> None:
        """Tells the agent, if it wants to know, which episodes begin."""
        if self._seed_episodes is not None:
            with calling(self.name, "seed_episodes"):
                self._seed_episodes(seeds, mask)

    def act(self, observation: Observation, is_first: np.ndarray, state: Any) -> tuple[np.ndarray, Any]:
        """Actions `[B]` int in range, without exploring, and the next state."""
        with calling(self.name, "act"):
            answer = self._agent.act(observation, is_first, state)
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise AgentError(f"agent {self.name!r}: expected act() to return (actions, state), found {_short(answer)}")
        with calling(self.name, "act"):
            actions = np.asarray(answer[0])
        fault = self._fault(actions, len(is_first))
        if fault:
            raise AgentError(f"agent {self.name!r}: expected act() to return {fault}")
        return actions, answer[1]

    def _fault(self, actions: np.ndarray, batch_size: int) -> str | None:
        if actions.shape != (batch_size,):
            return f"{batch_size} actions, one an environment, found shape {actions.shape}"
        if not np.issubdtype(actions.dtype, np.integer):
            return f"integer actions, found {actions.dtype}"
        wrong = actions[(actions < 0) | (actions >= self._num_actions)]
        return f"actions from 0 to {self._num_actions - 1}, found {wrong[0]}" if len(wrong) else None


def _short(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    return " ".join(repr(value).split())[:80]
