"""Batches of sequences from which MMN learns, and the targets of values and policies in their states.

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
from .hypermodel import MMNNetwork
from .mmn_config import MMNConfig
from .search_policy import plan


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
    contexts = sample.contexts
    features = state_features(torch.from_numpy(sample.state), torch.from_numpy(contexts.origin)[:, None, None])
    reached = (sample.cell == contexts.goal[:, None, None]) & sample.exists
    not_before = np.cumsum(reached, axis=-1) - reached == 0
    batch = Batch(
        context=maps.contexts(contexts, turned),
        anchor=maps.marks(contexts.anchor, turned),
        maze=torch.from_numpy(contexts.maze),
        features=symmetry.turn_features(features, turned),
        action=torch.from_numpy(symmetry.turn_actions(sample.action, turned)),
        exists=torch.from_numpy(sample.exists & not_before),
        at_goal=torch.from_numpy(reached & not_before),
    )
    return Batch(*(part.to(device, non_blocking=True) for part in batch))


class Targets(NamedTuple):
    """The targets of the heads for the states of a batch."""

    value: torch.Tensor  # [G, S, L + 1]
    policy: torch.Tensor  # [G, S, L + 1, 6]


@torch.no_grad()
def targets_of(network: MMNNetwork, config: MMNConfig, batch: Batch) -> Targets:
    """Returns the targets of a batch by the target network: n-step values, and the policies that a search finds."""
    states = batch.exists.shape[1:]
    code = network.hypermodel(batch.context, batch.anchor)
    latent = network.encode(batch.features.flatten(1, 2))  # [G, S (L + 1), D]

    predictions = network.predict(latent, network.look(latent, code), code)
    bootstrap = network.value(predictions.value_logits).unflatten(1, states)
    value = n_step_returns(bootstrap, batch.at_goal, batch.exists, config.n_step)

    weights = plan(network, config, latent, code, config.num_simulations).action_weights
    policy = torch.from_numpy(weights).to(latent.device).unflatten(0, (-1, *states))
    return Targets(value.clamp(-config.longest_value, 0.0), policy)


def n_step_returns(value: torch.Tensor, at_goal: torch.Tensor, exists: torch.Tensor, n: int) -> torch.Tensor:
    """Returns the paper's n-step returns `[..., L + 1]`: -1 a step, and after n steps the value of the state reached.

    A step into the goal is rewarded 0 and ends the return. A return ends early at the last existing state. All
    arguments are `[..., L + 1]`: the values to bootstrap from, whether states are at the goal, and whether they exist.
    """
    returns = value
    for _ in range(n):
        outcome = torch.where(at_goal[..., 1:], 0.0, returns[..., 1:] - 1)
        returns = torch.cat([torch.where(exists[..., 1:], outcome, value[..., :-1]), value[..., -1:]], dim=-1)
    return returns
