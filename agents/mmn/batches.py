"""A sample of sequences as tensors, from which MMN learns.

`G` is the number of contexts in a batch, `S` of sequences in each, `L` of steps of a sequence, so L + 1 of states.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from ..common import symmetry
from ..common.layers import state_features
from ..common.replay import SequenceSample
from ..common.training_maps import TrainingMaps


class Batch(NamedTuple):
    """A sample as tensors, rotated or mirrored."""

    context: torch.Tensor  # [G, 4, M, M]
    anchor: torch.Tensor  # [G, 2], the position (row, column) from which displacements are measured
    maze: torch.Tensor  # [G], the index of the maze
    features: torch.Tensor  # [G, S, L + 1, 9]
    action: torch.Tensor  # [G, S, L]
    exists: torch.Tensor  # [G, S, L + 1] bool, whether the sequence goes as far without reaching the goal before
    at_goal: torch.Tensor  # [G, S, L + 1] bool, whether the goal is reached here; later states do not exist


def make_batch(sample: SequenceSample, *, maps: TrainingMaps, turned: int, device: torch.device) -> Batch:
    """Returns a sample on a device, turned by a symmetry."""
    features = state_features(torch.from_numpy(sample.state), torch.from_numpy(sample.origin)[:, None, None])
    reached = (sample.cell == sample.goal[:, None, None]) & sample.exists
    not_before = np.cumsum(reached, axis=-1) - reached == 0
    batch = Batch(
        context=maps.contexts(sample, turned),
        anchor=maps.marks(sample.anchor, turned),
        maze=torch.from_numpy(sample.maze),
        features=symmetry.turn_features(features, turned),
        action=torch.from_numpy(symmetry.turn_actions(sample.action, turned)),
        exists=torch.from_numpy(sample.exists & not_before),
        at_goal=torch.from_numpy(reached & not_before),
    )
    return Batch(*(part.to(device, non_blocking=True) for part in batch))
