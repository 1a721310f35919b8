"""Perturbations of what the agent is shown: one file per perturbation, and the table of all of them."""

from __future__ import annotations

from mazebench.tasks.perturbations.flip import MapFlip
from mazebench.tasks.perturbations.noise import PositionNoise
from mazebench.tasks.perturbations.perturbation import Perturbation
from mazebench.tasks.perturbations.warp import MapWarp

# By the field of a task that has the level. They are applied in this order, and level 0 switches one off. Each draws
# from a random stream of its own (`mazebench.tasks.streams`).
PERTURBATIONS: dict[str, Perturbation] = {
    "map_flip": MapFlip(),
    "map_warp": MapWarp(),
    "position_noise": PositionNoise(),
}
