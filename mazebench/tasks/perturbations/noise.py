"""Noise on the observed position."""

from __future__ import annotations

import dataclasses
from typing import Annotated

import numpy as np
from annotated_types import Interval

from mazebench.options import Doc
from mazebench.tasks.perturbations.perturbation import Perturbation, StateError
from mazebench.tasks.streams import Stream

PositionDeviation = Annotated[
    float,
    Interval(ge=0, le=1000),  # more would be a mistake
    Doc("Standard deviation of the noise on x and y of each observation, in metres."),
]


@dataclasses.dataclass(frozen=True)
class PositionNoise(Perturbation):
    """Adds normal noise to x and y of each observed state."""

    deviation: float  # m, the standard deviation in x and in y

    stream = Stream.POSITION_NOISE

    def state_error(self, rng: np.random.Generator) -> StateError:
        return NormalNoise(self.deviation, rng)


@dataclasses.dataclass
class NormalNoise:
    """Noise of one episode, independent from one observation to the next."""

    deviation: float  # m, the standard deviation in x and in y
    rng: np.random.Generator

    def __call__(self, state: np.ndarray) -> None:
        state[:2] += self.rng.normal(0.0, self.deviation, size=2)
