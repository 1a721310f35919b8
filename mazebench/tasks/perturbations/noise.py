"""Noise on the observed position."""

from __future__ import annotations

import numpy as np

from mazebench.tasks.perturbations.base import Perturbation, StateError


class PositionNoise(Perturbation):
    """Adds normal noise to x and y of each observed state."""

    help = "Standard deviation of the noise on x and y of each observation, in metres."
    highest = 1000  # m; more would be a mistake
    stream = 2

    def state_error(self, level: float, rng: np.random.Generator) -> StateError:
        def add_noise(state: np.ndarray) -> None:
            state[:2] += rng.normal(0.0, level, size=2)

        return add_noise
