"""Perturbations of what the agent is shown: one file per perturbation, and the table of all of them."""

from __future__ import annotations

import typing
from typing import Annotated

from mazebench.options import options
from mazebench.tasks.perturbations.flip import MapFlip
from mazebench.tasks.perturbations.noise import PositionNoise
from mazebench.tasks.perturbations.perturbation import Perturbation
from mazebench.tasks.perturbations.warp import MapWarp


@options
class Perturbations:
    """The table of perturbations, as options of a task; they are applied in this order. Level 0 switches one off.

    Each draws from a random stream of its own (`mazebench.tasks.streams`).
    """

    map_flip: Annotated[float, MapFlip()] = 0.0
    map_warp: Annotated[float, MapWarp()] = 0.0
    position_noise: Annotated[float, PositionNoise()] = 0.0


PERTURBATIONS: dict[str, Perturbation] = {
    name: kind.__metadata__[0] for name, kind in typing.get_type_hints(Perturbations, include_extras=True).items()
}


def perturbation_levels(options: Perturbations) -> dict[str, float]:
    """Returns the levels of all perturbations by name."""
    return {name: getattr(options, name) for name in PERTURBATIONS}


def active_perturbations(options: Perturbations) -> list[tuple[Perturbation, float]]:
    """Returns the perturbations that are switched on, in the order of the table, with their levels."""
    levels = perturbation_levels(options)
    return [(perturbation, levels[name]) for name, perturbation in PERTURBATIONS.items() if levels[name]]
