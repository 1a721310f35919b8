"""The Gymnasium spaces of a navigation task."""

from __future__ import annotations

import numpy as np
from dm_env import specs
from gymnasium import spaces

from mazebench.tasks.actions import action_spec
from mazebench.tasks.observation import observation_specs
from mazebench.tasks.task import Task


def observation_space(task: Task) -> spaces.Dict:
    """Returns the space of the observations that `Rules` documents, except `is_first`, which is in `info`."""
    return spaces.Dict({name: _box(array) for name, array in observation_specs(task).items()})


def _box(array: specs.Array) -> spaces.Box:
    if isinstance(array, specs.BoundedArray):
        low, high = (np.broadcast_to(bound, array.shape) for bound in (array.minimum, array.maximum))
        return spaces.Box(low, high, array.shape, array.dtype)
    return spaces.Box(-np.inf, np.inf, array.shape, array.dtype)


def action_space(task: Task) -> spaces.Discrete | spaces.Box:
    """Returns the space of discrete actions, in the order of `mazebench.constants.DISCRETE`, or of velocities."""
    found = action_spec(task.actions)
    if isinstance(found, specs.DiscreteArray):
        return spaces.Discrete(found.num_values)
    return spaces.Box(-1.0, 1.0, found.shape, np.float32)
