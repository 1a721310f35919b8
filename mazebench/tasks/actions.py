"""Turns the actions of agents into controls of the body's actuators, and checks them."""

from __future__ import annotations

import numpy as np

from mazebench.world.mjcf import ACTIONS, action_controls, velocity_controls

VELOCITY_SIZE = 3  # forward, left, turn to the left

_CONTROLS = action_controls()


def controls_of_action(action: int) -> np.ndarray:
    """Returns `[5]` float: the controls of one of the six actions.

    Raises:
      ValueError: if there is no such action.
    """
    index = int(action)
    if not (0 <= index < len(ACTIONS) and index == action):
        raise ValueError(f"expected an action from 0 to {len(ACTIONS) - 1} ({', '.join(ACTIONS)}), found {action!r}")
    return _CONTROLS[index]


def controls_of_actions(actions: np.ndarray, num_envs: int) -> np.ndarray:
    """Returns `[B, 5]` float: the controls of `[B]` int actions, one for each of B environments.

    Raises:
      ValueError: if `actions` are not B of the six actions.
    """
    actions = np.asarray(actions)
    is_integer = np.issubdtype(actions.dtype, np.integer)
    if actions.shape != (num_envs,) or not is_integer or actions.min() < 0 or actions.max() >= len(ACTIONS):
        raise ValueError(
            f"expected {num_envs} actions from 0 to {len(ACTIONS) - 1}, found shape {actions.shape}, values {actions}"
        )
    return _CONTROLS[actions.astype(np.int64, copy=False)]


def controls_of_velocities(velocities: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Returns `[..., 5]` float: the controls of continuous actions `[..., 3]`, which are clipped to [-1, 1].

    Raises:
      ValueError: if `velocities` are not finite numbers of that shape.
    """
    velocities = np.asarray(velocities)
    is_numeric = np.issubdtype(velocities.dtype, np.floating) or np.issubdtype(velocities.dtype, np.integer)
    if velocities.shape != shape or not is_numeric or not np.isfinite(velocities).all():
        raise ValueError(
            f"expected velocities (forward, left, turn) from -1 to 1 of shape {shape}, "
            f"found shape {velocities.shape}, values {velocities}"
        )
    return velocity_controls(np.clip(velocities, -1.0, 1.0))
