"""The Gymnasium spaces of a navigation task."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from mazebench.tasks.actions import VELOCITY_SIZE
from mazebench.tasks.context import NUM_PLANES
from mazebench.tasks.spec import TaskSpec
from mazebench.world.mjcf import ACTIONS
from mazebench.world.physics import STATE_SIZE


def observation_space(spec: TaskSpec) -> spaces.Dict:
    """`state` `[12]` float32, `context` `[4, M, M]` float32 in [0, 1] and pictures, as `Navigation` documents them."""
    size = spec.context_size
    picture = (spec.camera_size, spec.camera_size, 3)
    return spaces.Dict(
        {
            "state": spaces.Box(-np.inf, np.inf, (STATE_SIZE,), np.float32),
            "context": spaces.Box(0.0, 1.0, (NUM_PLANES, size, size), np.float32),
            **{camera: spaces.Box(0, 255, picture, np.uint8) for camera in spec.cameras},
        }
    )


def action_space(spec: TaskSpec) -> spaces.Discrete | spaces.Box:
    """The six actions, in the order of `mazebench.world.mjcf.ACTIONS`, or velocities, as `Navigation` has them."""
    if spec.continuous:
        return spaces.Box(-1.0, 1.0, (VELOCITY_SIZE,), np.float32)
    return spaces.Discrete(len(ACTIONS))
