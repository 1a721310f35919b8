"""The config of the belief planner, with the reason for each number."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Interval

from mazebench.options import options

from ..common.ranges import Ahead, Factor, Share, Size, Steps, Updates
from ..muzero.config import MuZeroConfig


@options
class BeliefPlannerConfig(MuZeroConfig):
    """The config of the belief planner."""

    channels: Size = 32  # of the map encoder
    num_distances: Annotated[int, Interval(ge=1, le=64)] = 2  # maps of learned distances to the goal
    localization_weight: Factor = 0.1  # of the loss on the estimated position on the map
    distance_weight: Factor = 0.02  # of the loss on propagated distances, against values
    hindsight_mean_offset: Ahead = 32.0  # steps; farther than in MMN, since a wrong map makes ways longer
    hindsight_window: Steps = 150  # steps
    belief_channels: Size = 32  # of the belief's convolutions
    belief_weight: Factor = 1.0  # of the losses on where walls and the goal are
    scale_updates: Updates = 300  # before the rate of the map's scale falls: an error of it grows along the way
    belief_rate: Factor = 0.5  # times the learning rate, for the belief
    wrong_maps: Share = 0.7  # share of wrong maps among those that the belief learns from
