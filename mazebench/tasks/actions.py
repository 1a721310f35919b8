"""The actions of agents, their checks, and the controls of a body's actuators that they set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dm_env import specs

from mazebench.constants import ACTIONS, DISCRETE, VELOCITIES
from mazebench.errors import InputError
from mazebench.world.bodies import Body


def action_spec(kind: str) -> specs.DiscreteArray | specs.BoundedArray:
    """Returns which actions there are, of the kind "six", "four", "velocity" or "diff"."""
    if kind in VELOCITIES:
        return specs.BoundedArray((len(VELOCITIES[kind]),), np.float32, -1.0, 1.0, name="action")
    return specs.DiscreteArray(len(DISCRETE[kind]), name="action")


class Actions:
    """The actions of a kind, and what they set the `C` controls of a body to."""

    def __init__(self, kind: str, body: Body):
        """`kind` is "six", "four", "velocity" or "diff"."""
        self._kind, self._body = kind, body
        self._names = VELOCITIES[kind] if kind in VELOCITIES else DISCRETE[kind]
        self._is_continuous = kind in VELOCITIES
        if not self._is_continuous:
            self._controls = body.action_controls()[list(map(ACTIONS.index, self._names))]

    def controls_of_one(self, action: int | np.ndarray) -> np.ndarray:
        """Returns `[C]` float: the controls of an action.

        Raises:
          InputError: if there is no such action.
        """
        if self._is_continuous:
            return self._of_velocities(action, ())
        try:
            index = int(action)
            is_one = 0 <= index < len(self._names) and index == action
        except (TypeError, ValueError, OverflowError):  # a text, None, several, NaN, infinity
            is_one = False
        if not is_one:
            expected = f"expected an action from 0 to {len(self._names) - 1} ({', '.join(self._names)})"
            raise InputError(f"{expected}, found {_in_short(action)}")
        return self._controls[index]

    def controls(self, actions: np.ndarray, num_envs: int) -> np.ndarray:
        """Returns `[B, C]` float: the controls of actions, one for each of B environments.

        Raises:
          InputError: if `actions` are not B legal actions.
        """
        if self._is_continuous:
            return self._of_velocities(actions, (num_envs,))
        actions, num_actions = np.asarray(actions), len(self._names)
        if actions.shape == (num_envs,) and actions.dtype.kind in "iu":
            indices = actions.astype(np.int64, copy=False)
            if indices.view(np.uint64).max() < num_actions:  # as which numbers below 0 are large
                return self._controls[indices]
        raise InputError(
            f"expected {num_envs} actions from 0 to {num_actions - 1}, found shape {actions.shape}, "
            f"values {_in_short(actions)}"
        )

    def _of_velocities(self, velocities: int | np.ndarray, batch: Sequence[int]) -> np.ndarray:
        """Returns `[*batch, C]` float: the controls of continuous actions, which are clipped to [-1, 1]."""
        velocities, shape = np.asarray(velocities), (*batch, len(self._names))
        is_numeric = np.issubdtype(velocities.dtype, np.floating) or np.issubdtype(velocities.dtype, np.integer)
        if velocities.shape != shape or not is_numeric or not np.isfinite(velocities).all():
            raise InputError(
                f"expected velocities ({', '.join(self._names)}) from -1 to 1 of shape {shape}, "
                f"found shape {velocities.shape}, values {_in_short(velocities)}"
            )
        clipped = np.clip(velocities.astype(float), -1.0, 1.0)  # of any type, equal velocities give equal controls
        return self._body.velocity_controls(np.insert(clipped, 1, 0.0, axis=-1) if self._kind == "diff" else clipped)


def _in_short(value: object) -> str:
    """Returns `value` in one line of at most 80 letters."""
    return " ".join(str(value).split())[:80]
