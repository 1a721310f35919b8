"""Perturbations of what the agent is shown: one file per perturbation, and the table of those that are options."""

from __future__ import annotations

from collections.abc import Callable

from mazebench.tasks.perturbations.flip import MapFlip
from mazebench.tasks.perturbations.noise import PositionNoise
from mazebench.tasks.perturbations.perturbation import Perturbation
from mazebench.tasks.perturbations.warp import MapWarp

# By the field of a task that has the strength. They are applied in this order, and strength 0 switches one off.
PERTURBATIONS: dict[str, Callable[[float], Perturbation]] = {
    "map_flip": MapFlip,
    "map_warp": MapWarp,
    "position_noise": PositionNoise,
}
