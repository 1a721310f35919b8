"""The Gymnasium spaces of a navigation task."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from mazebench.tasks.context import NUM_PLANES
from mazebench.tasks.spec import TaskSpec
from mazebench.world.mjcf import ACTIONS
from mazebench.world.physics import STATE_SIZE


def observation_space(spec: TaskSpec) -> spaces.Dict:
    """`state` `[12]` float32 and `context` `[4, M, M]` float32 in [0, 1], as `Navigation` documents them."""
    size = spec.context_size
    return spaces.Dict(
        {
            "state": spaces.Box(-np.inf, np.inf, (STATE_SIZE,), np.float32),
            "context": spaces.Box(0.0, 1.0, (NUM_PLANES, size, size), np.float32),
        }
    )


def action_space() -> spaces.Discrete:
    """The six actions, in the order of `mazebench.world.mjcf.ACTIONS`."""
    return spaces.Discrete(len(ACTIONS))
