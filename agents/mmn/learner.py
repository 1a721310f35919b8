"""How MMN learns: sequences with goals relabelled in hindsight, unrolled in the model from what the encoder sees.

`G` is the number of contexts in a batch, `S` of sequences in each, `L` of steps of a sequence, so L + 1 of states.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from mazebench.maps.maze import Maze
from mazebench.tasks.context import resized_map
from mazebench.training.experience import Experience

from .. import symmetry
from ..layers import state_features
from ..learner import HindsightLearner
from ..replay import SequenceSample
from .hypermodels import Code
from .losses import Batch, Targets, unrolled_losses
from .network import MMNNetwork, Predictions
from .planning import lookahead, plan
from .targets import n_step_returns, tree_backup_returns

if TYPE_CHECKING:
    from .mmn import MMN


class MMNLearner(HindsightLearner):
    """Learns for an `MMN`."""

    def __init__(self, actor: MMN, mazes: tuple[Maze, ...], seed: int):
        config = actor.config
        optimizer = torch.optim.AdamW(
            actor.network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        super().__init__(actor, mazes, seed, optimizer, config.keep_anchor)
        self._device = actor.network.support.device
        self._visited = np.zeros((len(mazes), mazes[0].size ** 2), dtype=np.float32)  # 1 where the agent has ever been
        self._num_updates = np.zeros(1, dtype=np.int64)
        self._arrays |= {"visited": self._visited, "num_updates": self._num_updates}

    def observe(self, experience: Experience, first_env: int = 0) -> None:
        """Remembers one step in the environments from `first_env` on, and where it was."""
        super().observe(experience, first_env)
        self._visited[experience.maze, experience.cell] = 1.0

    def update(self) -> dict[str, float]:
        """Learns from one batch; returns the paper's losses by their names, and what tells early if a run will work."""
        config = self._config
        sample = self.sample()
        batch = self._batch(sample)
        targets = self._targets(batch)
        weight = torch.from_numpy(sample.weight).to(self._device)
        losses, metrics, value_error = unrolled_losses(self.actor.network, config, batch, targets, weight)
        self._num_updates += 1
        for group in self._optimizer.param_groups:
            group["lr"] = config.learning_rate * min(1.0, config.constant_updates / int(self._num_updates[0]))
        metrics["gradient_norm"] = self._descend(torch.stack(list(losses.values())).sum())
        if config.priority_exponent:
            seen = (batch.exists & ~batch.at_goal)[:, 0, 0].cpu().numpy()
            self._replay.update_priorities(sample.row[seen], value_error.cpu().numpy()[seen])
        scalars = losses | metrics
        # Read together: on a GPU, each reading waits for all that was launched.
        values = torch.stack([value.detach() for value in scalars.values()]).tolist()
        return dict(zip(scalars, values, strict=True))

    def sample(self) -> SequenceSample:
        """Draws what is learned from next."""
        config = self._config
        beta = config.importance_exponent if config.priority_exponent else 0.0
        return self._replay.sample_sequences(
            config.groups, config.sequences, config.sequence_steps, self._hindsight, self._rng, beta
        )

    def _batch(self, sample: SequenceSample) -> Batch:
        turned = self._draw_symmetry()
        size, context_size = self._mazes[0].size, self.actor.context_size_built
        visited = [resized_map(self._visited[maze].reshape(size, size), context_size) for maze in sample.maze]
        features = state_features(torch.from_numpy(sample.state), torch.from_numpy(sample.origin)[:, None, None])
        reached = (sample.cell == sample.goal[:, None, None]) & sample.exists
        not_before = np.cumsum(reached, axis=-1) - reached == 0
        batch = Batch(
            self._contexts(sample, turned),
            self._marks(sample.anchor, turned),
            symmetry.turn_planes(torch.from_numpy(np.stack(visited)[:, None]), turned),
            torch.from_numpy(sample.relabelled),
            symmetry.turn_features(features, turned),
            self._places(sample, turned),
            torch.from_numpy(symmetry.turn_actions(sample.action, turned)),
            torch.from_numpy(sample.exists & not_before),
            torch.from_numpy(reached & not_before),
        )
        return Batch(*(part.to(self._device, non_blocking=True) for part in batch))

    @torch.no_grad()
    def _targets(self, batch: Batch) -> Targets:
        """By the target network, for the goals of the batch, real or relabelled."""
        network, config = self._target, self._config
        code = network.hypermodel(batch.context, batch.anchor)
        latent = network.encode(batch.features.flatten(1, 2))
        shape = batch.features.shape[1:3]
        with torch.autocast(self._device.type, torch.bfloat16, enabled=_has_fast_bfloat16(self._device)):
            qvalues = lookahead(network, latent, code, config.predict_reward).float().unflatten(1, shape)
        improved = torch.softmax(qvalues / config.temperature, dim=-1)
        if config.value_target == "tree_backup":
            value = tree_backup_returns(qvalues, improved, batch.action, batch.at_goal, batch.exists)
        else:
            value = network.value(self._predict(network, latent, code).value_logits).unflatten(1, shape)
            value = n_step_returns(value, batch.at_goal, batch.exists, config.n_step)
        policy = improved if config.policy_target == "lookahead" else self._searched(batch, latent, code)
        return Targets(value.clamp(-config.longest_value, 0.0), policy)

    def _searched(self, batch: Batch, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """`[G, S, L + 1, 6]`: policies by search; with the target "paper", by the network where it was relabelled."""
        network, config = self._target, self._config
        policy = torch.softmax(self._predict(network, latent, code).policy_logits, dim=-1)
        wanted = ~batch.relabelled if config.policy_target == "paper" else torch.ones_like(batch.relabelled)
        if wanted.any():
            result = plan(network, config, latent[wanted], code.of(wanted), config.num_simulations, self._rng)
            weights = torch.from_numpy(result.action_weights).to(policy.device)
            policy[wanted] = weights.unflatten(0, (-1, policy.shape[1]))
        return policy.unflatten(1, batch.features.shape[1:3])

    def _predict(self, network: MMNNetwork, latent: torch.Tensor, code: Code) -> Predictions:
        return network.predict(latent, network.look(latent, code), code)


def _has_fast_bfloat16(device: torch.device) -> bool:
    """Whether products in bfloat16 are faster here; on a CPU with instructions for them, four times."""
    if device.type == "cpu":
        return torch.cpu._is_avx512_bf16_supported()
    return torch.cuda.is_bf16_supported()
