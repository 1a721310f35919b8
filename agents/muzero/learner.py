"""The learner of agents with a learned model: sequences with goals relabelled in hindsight, and unrolled models.

`G` is the number of contexts in a batch, `S` of sequences in each, `L` of steps of a sequence, so L + 1 of states.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from mazebench.maps.maze import Maze

from ..common import symmetry
from ..common.actor import one_torch_thread
from ..common.layers import state_features
from ..common.learner import HindsightLearner
from ..common.replay import SequenceSample
from .lookahead import lookahead
from .losses import Batch, Targets, unrolled_losses
from .network import Code
from .targets import tree_backup_returns


class MuZeroLearner(HindsightLearner):
    """Updates the network of its actor."""

    def __init__(self, actor: Any, mazes: tuple[Maze, ...], seed: int, keep_anchor: bool):
        config = actor.config
        groups = actor.network.parameter_groups()
        optimizer = torch.optim.AdamW(groups, lr=config.learning_rate, weight_decay=config.weight_decay)
        super().__init__(actor, mazes, seed, optimizer, keep_anchor)
        self._device = actor.network.support.device
        self._num_updates = np.zeros(1, dtype=np.int64)
        self._arrays |= {"num_updates": self._num_updates}

    @one_torch_thread()
    def update(self) -> dict[str, float]:
        """Learns from one batch; returns its losses and, to judge a run early, other scalars by name."""
        config = self._config
        losses, metrics = self._losses(self.sample())
        self._num_updates += 1
        for group in self._optimizer.param_groups:
            constant_updates = group.get("constant_updates", config.constant_updates)
            falling = min(1.0, constant_updates / int(self._num_updates[0]))
            group["lr"] = group["rate"] * config.learning_rate * falling
        metrics["gradient_norm"] = self._descend(torch.stack(list(losses.values())).sum())
        scalars = losses | metrics
        # Copied from the device at once: on a GPU, each copy waits for all kernels launched before.
        values = torch.stack([value.detach() for value in scalars.values()]).tolist()
        return dict(zip(scalars, values, strict=True))

    def sample(self) -> SequenceSample:
        """Draws the sequences of the next batch."""
        config = self._config
        return self._replay.sample_sequences(
            config.groups, config.sequences, config.sequence_steps, self._hindsight, self._rng
        )

    def _losses(self, sample: SequenceSample) -> tuple[dict[str, torch.Tensor], dict[str, torch.Tensor]]:
        """Returns losses by name, to be summed, and other scalars by name."""
        turned = self._draw_symmetry()
        marks = self._marks(sample.anchor, turned), self._positions(sample, turned)
        return self._unrolled(self._batch(sample, turned, self._contexts(sample, turned), *marks))

    def _unrolled(self, batch: Batch) -> tuple[dict[str, torch.Tensor], dict[str, torch.Tensor]]:
        return unrolled_losses(self.actor.network, self._config, batch, self._targets(batch))

    def _batch(
        self,
        sample: SequenceSample,
        turned: int,
        context: torch.Tensor,
        anchor: torch.Tensor,
        position: torch.Tensor,
    ) -> Batch:
        """Returns a sample as tensors, with what the hypermodel reads and with positions on the turned map."""
        features = state_features(torch.from_numpy(sample.state), torch.from_numpy(sample.origin)[:, None, None])
        reached = (sample.cell == sample.goal[:, None, None]) & sample.exists
        not_before = np.cumsum(reached, axis=-1) - reached == 0
        batch = Batch(
            context,
            anchor,
            torch.from_numpy(sample.maze),
            torch.from_numpy(sample.relabelled),
            symmetry.turn_features(features, turned),
            position,
            torch.from_numpy(symmetry.turn_actions(sample.action, turned)),
            torch.from_numpy(sample.exists & not_before),
            torch.from_numpy(reached & not_before),
        )
        return Batch(*(part.to(self._device, non_blocking=True) for part in batch))

    @torch.no_grad()
    def _targets(self, batch: Batch) -> Targets:
        """Returns the targets of the batch by one step of the target network's model; goals are real or relabelled."""
        code = self._target.hypermodel(batch.context, batch.anchor)
        return self._lookahead_targets(batch, self._target.encode(batch.features.flatten(1, 2)), code)

    def _lookahead_targets(self, batch: Batch, latent: torch.Tensor, code: Code) -> Targets:
        """Returns values by tree backup and policies by lookahead; states and codes are the target network's."""
        network, config = self._target, self._config
        with torch.autocast(self._device.type, torch.bfloat16, enabled=_has_fast_bfloat16(self._device)):
            qvalues = lookahead(network, latent, code).float().unflatten(1, batch.exists.shape[1:])
        policy = torch.softmax(qvalues / config.temperature, dim=-1)
        value = tree_backup_returns(qvalues, policy, batch.action, batch.at_goal, batch.exists)
        return Targets(value.clamp(-config.longest_value, 0.0), policy)


def _has_fast_bfloat16(device: torch.device) -> bool:
    """Returns whether the device has instructions for bfloat16; on a CPU, products then take a quarter of the time."""
    if device.type == "cpu":
        return torch.cpu._is_avx512_bf16_supported()
    return torch.cuda.is_bf16_supported()
