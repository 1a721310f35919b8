"""The config of the belief planner, with the reason for each number."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar

from ..muzero.config import MuZeroConfig


@dataclasses.dataclass(frozen=True)
class BeliefPlannerConfig(MuZeroConfig):
    """The config of the belief planner."""

    RANGES: ClassVar[dict[str, tuple[float, float]]] = MuZeroConfig.RANGES | {
        "channels": (1, 1024),
        "num_distances": (1, 64),
        "localization_weight": (0.0, math.inf),
        "distance_weight": (0.0, math.inf),
        "belief_channels": (1, 1024),
        "belief_weight": (0.0, math.inf),
        "belief_rate": (0.0, math.inf),
        "scale_updates": (1, 1_000_000_000),
        "wrong_maps": (0.0, 1.0),
    }

    channels: int = 32  # of the map encoder
    num_distances: int = 2  # maps of learned distances to the goal
    localization_weight: float = 0.1  # of the loss on the estimated position on the map
    distance_weight: float = 0.02  # of the loss on propagated distances, against values
    hindsight_mean_offset: float = 32.0  # steps; farther than in MMN, since a wrong map makes ways longer
    hindsight_window: int = 150  # steps
    belief_channels: int = 32  # of the belief's convolutions
    belief_weight: float = 1.0  # of the losses on where walls and the goal are
    scale_updates: int = 300  # before the learning rate of the map's scale falls: an error of it grows along the way
    belief_rate: float = 0.5  # times the learning rate, for the belief
    wrong_maps: float = 0.7  # share of wrong maps among those that the belief learns from
