"""Noise on the observed position."""

from __future__ import annotations

import dataclasses

import numpy as np

from mazebench.tasks.perturbations.perturbation import Perturbation, StateError
from mazebench.tasks.streams import Stream


class PositionNoise(Perturbation):
    """Adds normal noise to x and y of each observed state."""

    help = "Standard deviation of the noise on x and y of each observation, in metres."
    highest = 1000  # m; more would be a mistake
    stream = Stream.POSITION_NOISE

    def state_error(self, level: float, rng: np.random.Generator) -> StateError:
        return NormalNoise(level, rng)


@dataclasses.dataclass
class NormalNoise:
    """Noise of one episode, independent from one observation to the next."""

    deviation: float  # m, the standard deviation in x and in y
    rng: np.random.Generator

    def __call__(self, state: np.ndarray) -> None:
        state[:2] += self.rng.normal(0.0, self.deviation, size=2)
