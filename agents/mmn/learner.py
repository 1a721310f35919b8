"""How MMN learns: sequences with goals relabelled in hindsight, unrolled in the model from what the encoder sees.

`G` is the number of contexts in a batch, `S` of sequences in each, `L` of steps of a sequence, so L + 1 of states.
"""

from __future__ import annotations

import copy
import dataclasses
import pathlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from mazebench.maps.maze import Maze
from mazebench.tasks.context import build_context, resized_map
from mazebench.training.experience import Experience

from .. import symmetry
from ..checkpoint import AGENT_FILE, load_checkpoint, load_into, save_checkpoint
from ..layers import state_features
from ..learner_files import load_learner, save_learner
from ..replay import Hindsight, Replay, SequenceSample
from .hypermodels import Code
from .losses import Batch, Targets, unrolled_losses
from .network import MMNNetwork, Predictions
from .planning import lookahead, plan
from .targets import n_step_returns, tree_backup_returns

if TYPE_CHECKING:
    from .mmn import MMN


class MMNLearner:
    """Remembers and learns for an `MMN`, which acts with what is learned so far."""

    def __init__(self, actor: MMN, mazes: tuple[Maze, ...], seed: int):
        self.actor = actor
        config = self._config = actor.config
        self.num_envs = config.num_envs
        self._mazes = mazes
        self._rng = np.random.default_rng([seed, 1])
        self._device = actor.network.support.device
        self._target = copy.deepcopy(actor.network).requires_grad_(False)
        self._optimizer = torch.optim.AdamW(
            actor.network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        self._replay = Replay(config.num_envs, config.replay_capacity, config.priority_exponent)
        self._visited = np.zeros((len(mazes), mazes[0].size ** 2), dtype=np.float32)  # 1 where the agent has ever been
        self._hindsight = Hindsight(
            config.hindsight_ratio, config.hindsight_mean_offset, config.hindsight_window, config.relabel_start
        )

    def config(self) -> dict[str, Any]:
        """All values of the config."""
        return dataclasses.asdict(self._config)

    def description(self) -> str:
        """The size of the network and of the replay, and where it learns."""
        weights = sum(parameter.numel() for parameter in self.actor.network.parameters())
        megabytes = self._replay.num_bytes / 2**20
        rows = self._config.replay_capacity
        return f"{weights:,} weights on {self._device}; replay of {rows:,} rows, {megabytes:.0f} MiB"

    def task_options(self) -> dict[str, Any]:
        """Episodes of several goals, as the config has it."""
        return {"num_goals": self._config.num_goals}

    def observe(self, experience: Experience, first_env: int = 0) -> None:
        """Remembers one step in the environments from `first_env` on."""
        self._replay.add(experience, first_env)
        self._visited[experience.maze, experience.cell] = 1.0

    def num_updates_due(self, env_steps: int) -> int:
        """One update every `steps_per_update` steps after the first `min_rows`; none while the replay is not filled."""
        if self._replay.num_rows < self._config.min_rows:
            return 0
        return max(0, env_steps - self._config.min_rows) // self._config.steps_per_update

    def update(self) -> dict[str, float]:
        """Learns from one batch; returns the paper's losses by their names, and what tells early if a run will work."""
        config = self._config
        sample = self._replay.sample_sequences(
            config.groups,
            config.sequences,
            config.sequence_steps,
            self._hindsight,
            self._rng,
            config.importance_exponent if config.priority_exponent else 0.0,
        )
        batch = self._batch(sample)
        targets = self._targets(batch)
        weight = torch.from_numpy(sample.weight).to(self._device)
        losses, metrics, value_error = unrolled_losses(self.actor.network, config, batch, targets, weight)
        metrics["gradient_norm"] = self._descend(torch.stack(list(losses.values())).sum())
        if config.priority_exponent:
            seen = (batch.exists & ~batch.at_goal)[:, 0, 0].cpu().numpy()
            self._replay.update_priorities(sample.row[seen], value_error.cpu().numpy()[seen])
        scalars = losses | metrics
        # Read together: on a GPU, each reading waits for all that was launched.
        values = torch.stack([value.detach() for value in scalars.values()]).tolist()
        return dict(zip(scalars, values, strict=True))

    def _batch(self, sample: SequenceSample) -> Batch:
        turned = int(self._rng.integers(symmetry.NUM_SYMMETRIES)) if self._config.symmetries else 0
        size, context_size = self._mazes[0].size, self.actor.context_size_built
        contexts = [
            build_context(self._mazes[maze].walls, divmod(start, size), divmod(goal, size), context_size)
            for maze, start, goal in zip(sample.maze.tolist(), sample.start.tolist(), sample.goal.tolist(), strict=True)
        ]
        visited = [resized_map(self._visited[maze].reshape(size, size), context_size) for maze in sample.maze]
        features = state_features(torch.from_numpy(sample.state), torch.from_numpy(sample.origin)[:, None, None])
        cells = torch.from_numpy(np.stack(np.divmod(sample.cell, size), axis=-1)).float()
        reached = (sample.cell == sample.goal[:, None, None]) & sample.exists
        not_before = np.cumsum(reached, axis=-1) - reached == 0
        batch = Batch(
            symmetry.turn_planes(torch.from_numpy(np.stack(contexts)), turned),
            symmetry.turn_planes(torch.from_numpy(np.stack(visited)[:, None]), turned),
            torch.from_numpy(sample.relabelled),
            symmetry.turn_features(features, turned),
            symmetry.turn_cells(cells, size, turned) * (context_size / size),
            torch.from_numpy(symmetry.turn_actions(sample.action, turned)),
            torch.from_numpy(sample.exists & not_before),
            torch.from_numpy(reached & not_before),
        )
        return Batch(*(part.to(self._device, non_blocking=True) for part in batch))

    @torch.no_grad()
    def _targets(self, batch: Batch) -> Targets:
        """By the target network, for the goals of the batch, real or relabelled."""
        network, config = self._target, self._config
        code = network.hypermodel(batch.context)
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

    def _descend(self, loss: torch.Tensor) -> torch.Tensor:
        """One step of the optimizer, and the target network's after it; returns the gradient's norm."""
        self._optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        parameters = list(self.actor.network.parameters())
        norm = torch.nn.utils.clip_grad_norm_(parameters, self._config.max_gradient_norm)
        self._optimizer.step()
        with torch.no_grad():
            for slow, fast in zip(self._target.parameters(), parameters, strict=True):
                slow.lerp_(fast, self._config.target_rate)
        return norm

    def save(self, folder: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes the agent, the target network and optimizer, the random stream and the replay."""
        metadata = {
            "agent": self.actor.name,
            "config": self.config(),
            "context_size": self.actor.context_size_built,
            "provenance": dict(provenance),
        }
        save_checkpoint(folder / AGENT_FILE, self.actor.network.state_dict(), metadata)
        save_learner(
            folder, self.actor.name, self._target, self._optimizer, self._rng, self._replay, {"visited": self._visited}
        )

    def load(self, folder: pathlib.Path) -> None:
        """Goes on from what `save` wrote; where the replay is gone, learning waits until it is filled again."""
        tensors, _ = load_checkpoint(folder / AGENT_FILE, self.actor.name)
        load_into(folder / AGENT_FILE, self.actor.network, tensors)
        load_learner(
            folder, self.actor.name, self._target, self._optimizer, self._rng, self._replay, {"visited": self._visited}
        )


def _has_fast_bfloat16(device: torch.device) -> bool:
    """Whether products in bfloat16 are faster here; on a CPU with instructions for them, four times."""
    if device.type == "cpu":
        return torch.cpu._is_avx512_bf16_supported()
    return torch.cuda.is_bf16_supported()
