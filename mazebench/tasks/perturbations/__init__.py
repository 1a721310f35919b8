"""What may be wrong with what the agent is shown: one file a perturbation, and the table of all of them."""

from __future__ import annotations

import dataclasses

from mazebench.options import Options
from mazebench.tasks.perturbations.base import Perturbation, level
from mazebench.tasks.perturbations.flip import MapFlip
from mazebench.tasks.perturbations.noise import PositionNoise
from mazebench.tasks.perturbations.warp import MapWarp


@dataclasses.dataclass(frozen=True, kw_only=True)
class Perturbations(Options):
    """The table of perturbations, as options of a task; they are applied in this order. Level 0 switches one off.

    Each draws from a random stream of its own. Streams 0 to 2 are taken by these, stream 3 by the goals after the first
    one (`mazebench.tasks.route`), streams 4 to 8 by the tracks; a new perturbation takes 9, 10, ...
    """

    map_flip: float = level(MapFlip())
    map_warp: float = level(MapWarp())
    position_noise: float = level(PositionNoise())


PERTURBATIONS: dict[str, Perturbation] = {
    field.name: field.metadata["perturbation"] for field in dataclasses.fields(Perturbations)
}


def perturbation_levels(options: Perturbations) -> dict[str, float]:
    """Returns the levels of all perturbations by name."""
    return {name: getattr(options, name) for name in PERTURBATIONS}


def active_perturbations(options: Perturbations) -> list[tuple[Perturbation, float]]:
    """Returns the perturbations that are switched on, in the order of the table, with their levels."""
    levels = perturbation_levels(options)
    return [(perturbation, levels[name]) for name, perturbation in PERTURBATIONS.items() if levels[name]]
