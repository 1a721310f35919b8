"""Turns the actions of agents into controls of the body's actuators, and checks them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dm_env import specs

from mazebench.constants import ACTIONS, DISCRETE, VELOCITIES
from mazebench.errors import InputError
from mazebench.world.mjcf import action_controls, velocity_controls

_CONTROLS = {kind: action_controls()[list(map(ACTIONS.index, names))] for kind, names in DISCRETE.items()}


def action_spec(kind: str) -> specs.DiscreteArray | specs.BoundedArray:
    """Returns which actions there are, of the kind "six", "four", "velocity" or "diff"."""
    if kind in VELOCITIES:
        return specs.BoundedArray((len(VELOCITIES[kind]),), np.float32, -1.0, 1.0, name="action")
    return specs.DiscreteArray(len(DISCRETE[kind]), name="action")


def controls_of_action(kind: str, action: int) -> np.ndarray:
    """Returns `[5]` float: the controls of a discrete action of a kind."""
    names = DISCRETE[kind]
    try:
        index = int(action)
        is_one = 0 <= index < len(names) and index == action
    except (TypeError, ValueError, OverflowError):  # a text, None, several, NaN, infinity
        is_one = False
    if not is_one:
        expected = f"expected an action from 0 to {len(names) - 1} ({', '.join(names)})"
        raise InputError(f"{expected}, found {_in_short(action)}")
    return _CONTROLS[kind][index]


def controls_of_actions(kind: str, actions: np.ndarray, num_envs: int) -> np.ndarray:
    """Returns `[B, 5]` float: the controls of `[B]` int actions of a kind, one for each of B environments."""
    actions, num_actions = np.asarray(actions), len(DISCRETE[kind])
    is_integer = np.issubdtype(actions.dtype, np.integer)
    if actions.shape != (num_envs,) or not is_integer or actions.min() < 0 or actions.max() >= num_actions:
        raise InputError(
            f"expected {num_envs} actions from 0 to {num_actions - 1}, found shape {actions.shape}, "
            f"values {_in_short(actions)}"
        )
    return _CONTROLS[kind][actions.astype(np.int64, copy=False)]


def controls_of_velocities(kind: str, velocities: np.ndarray, batch: Sequence[int] = ()) -> np.ndarray:
    """Returns `[*batch, 5]` float: the controls of continuous actions of a kind, which are clipped to [-1, 1].

    Raises:
      InputError: if `velocities` are not finite numbers of the shape `[*batch, 3]`, or `[*batch, 2]` for "diff".
    """
    names, velocities = VELOCITIES[kind], np.asarray(velocities)
    shape = (*batch, len(names))
    is_numeric = np.issubdtype(velocities.dtype, np.floating) or np.issubdtype(velocities.dtype, np.integer)
    if velocities.shape != shape or not is_numeric or not np.isfinite(velocities).all():
        raise InputError(
            f"expected velocities ({', '.join(names)}) from -1 to 1 of shape {shape}, "
            f"found shape {velocities.shape}, values {_in_short(velocities)}"
        )
    clipped = np.clip(velocities, -1.0, 1.0)
    return velocity_controls(np.insert(clipped, 1, 0.0, axis=-1) if kind == "diff" else clipped)


def _in_short(value: object) -> str:
    """Returns `value` in one line of at most 80 letters."""
    return " ".join(str(value).split())[:80]
