"""The agent `person`: somebody drives by the keys that are down."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Self

import numpy as np

from mazebench.agent import Agent, AgentConfig, Inputs, Observation
from mazebench.constants import ACTIONS, DISCRETE, VELOCITIES
from mazebench.errors import InputError
from mazebench.options import Doc, ReadBy
from mazebench.world.bodies import Body

_LONGEST_NAME = 60  # characters
# What a key changes: forward, left, turn.
_VELOCITY_OF = dict(zip(ACTIONS, np.kron(np.eye(3), [[1.0], [-1.0]]), strict=True))


def read_name(name: Any) -> str:
    """Returns the name of a person; raises `InputError` if it can't be shown."""
    if not (isinstance(name, str) and len(name) <= _LONGEST_NAME and name.isprintable()):
        raise InputError(f"expected a name of at most {_LONGEST_NAME} printable characters, found {name!r}"[:200])
    return name.strip()


@dataclasses.dataclass(frozen=True, kw_only=True)
class PersonConfig(AgentConfig):
    """Who drives."""

    name: Annotated[str, ReadBy(read_name), Doc("Your name, or any other, by which results tell people apart.")] = ""

    @property
    def needs_one_process(self) -> bool:
        """True: a person drives one robot at a time."""
        return True


class Person(Agent):
    """Does what a person's keys say, which are named as the six actions."""

    plays_actions = (*DISCRETE, *VELOCITIES)
    eval_config = PersonConfig()

    def __init__(self, keys: Callable[[Observation], Sequence[str]], kind: str):
        """Acts in one environment.

        Args:
          keys: returns the keys that are down, the last one pressed last, of what is observed in B = 1 environments.
          kind: of the actions, "six", "four", "velocity" or "diff".
        """
        self._keys, self._kind = keys, kind

    @classmethod
    def build(cls, interface: Any, **others: Any) -> Self:
        """Raises `InputError`, since `mazebench play` makes the agent with its page."""
        raise InputError("agent 'person': expected the command `mazebench play`, found another one")

    def act(self, inputs: Inputs, state: Any, explore: bool = False) -> tuple[np.ndarray, Any]:
        """Returns the action of the key that was pressed last, or velocities of all keys that are down."""
        keys = self._keys(inputs.observation)
        if self._kind in DISCRETE:
            return np.array([DISCRETE[self._kind].index(keys[-1])]), state
        velocity = np.clip(sum((_VELOCITY_OF[key] for key in keys), np.zeros(3)), -1, 1)
        return velocity[None] if self._kind == "velocity" else velocity[None, [0, 2]], state


def keys_of(kind: str, body: Body) -> tuple[str, ...]:
    """Returns the keys with which actions of a kind are chosen, and which move the body: six, or four of them."""
    return DISCRETE["six" if kind in ("six", "velocity") and body.strafes else "four"]
