"""The bound of what agents take in, so that sums and squares of it stay finite and fit an integer."""

from __future__ import annotations

import numpy as np

from mazebench.agent import Inputs

_LARGEST = 1e6  # m, rad and their speeds: more than any maze needs


def bounded(inputs: Inputs) -> Inputs:
    """Returns `inputs` whose states have no number of a larger size than a million."""
    state = np.clip(inputs.observation["state"], -_LARGEST, _LARGEST)
    return inputs._replace(observation={**inputs.observation, "state": state})
