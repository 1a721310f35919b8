"""How a DQN learns: double n-step targets on relabelled experience, by priority.

`G` groups of `K` steps make a batch; the steps of a group share one context.
"""

from __future__ import annotations

import copy
import dataclasses
import pathlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch.nn import functional

from mazebench.maps.maze import Maze
from mazebench.tasks.context import build_context
from mazebench.training.experience import Experience

from .. import symmetry
from ..checkpoint import AGENT_FILE, load_checkpoint, load_into, save_checkpoint
from ..layers import state_features
from ..learner_files import load_learner, save_learner
from ..replay import Hindsight, Replay, Sample

if TYPE_CHECKING:
    from .dqn import DQN


class DQNLearner:
    """Remembers and learns for a `DQN`, which acts with what is learned so far."""

    def __init__(self, actor: DQN, mazes: tuple[Maze, ...], seed: int):
        self.actor = actor
        config = self._config = actor.config
        self.num_envs = config.num_envs
        self._mazes = mazes
        self._rng = np.random.default_rng([seed, 1])
        self._target = copy.deepcopy(actor.network).requires_grad_(False)
        self._optimizer = torch.optim.Adam(actor.network.parameters(), lr=config.learning_rate)
        self._replay = Replay(config.num_envs, config.replay_capacity, config.priority_exponent)
        self._hindsight = Hindsight(
            config.hindsight_ratio, config.hindsight_mean_offset, config.hindsight_window, config.relabel_start
        )

    def config(self) -> dict[str, Any]:
        """All values of the config."""
        return dataclasses.asdict(self._config)

    def description(self) -> str:
        """The size of the network and of the replay."""
        weights = sum(parameter.numel() for parameter in self.actor.network.parameters())
        megabytes = self._replay.num_bytes / 2**20
        return f"{weights:,} weights; replay of {self._config.replay_capacity:,} rows, {megabytes:.0f} MiB"

    def task_options(self) -> dict[str, Any]:
        """Episodes of several goals, as the config has it."""
        return {"num_goals": self._config.num_goals}

    def observe(self, experience: Experience, first_env: int = 0) -> None:
        """Remembers one step in the environments from `first_env` on."""
        self._replay.add(experience, first_env)

    def num_updates_due(self, env_steps: int) -> int:
        """One update every `steps_per_update` steps after the first `min_rows`; none while the replay is not filled."""
        if self._replay.num_rows < self._config.min_rows:
            return 0
        return max(0, env_steps - self._config.min_rows) // self._config.steps_per_update

    def update(self) -> dict[str, float]:
        """Learns from one batch."""
        config = self._config
        sample = self._replay.sample(
            config.groups, config.steps, config.n_step, self._hindsight, self._rng, config.importance_exponent
        )
        turned = int(self._rng.integers(symmetry.NUM_SYMMETRIES)) if config.symmetries else 0
        code, target_code = self._codes(sample, turned)
        target = self._targets(sample, turned, code, target_code)
        features = self._features(sample.state, sample.origin, turned)
        action = torch.from_numpy(symmetry.turn_actions(np.maximum(sample.action, 0), turned))
        q_tm1 = self.actor.network(features, code).gather(-1, action[..., None])[..., 0]
        valid = torch.from_numpy(sample.valid).float()
        weight = torch.from_numpy(sample.weight)[:, None] * valid
        td_loss = (weight * functional.smooth_l1_loss(q_tm1, target, reduction="none")).sum() / valid.sum().clamp(min=1)
        metrics = {"td_loss": td_loss, "q": q_tm1.mean()}
        loss = td_loss
        if code is not None:
            metrics["localization_error"] = self._localization_error(sample, turned, features, code)
            loss = loss + config.localization_weight * metrics["localization_error"]
        metrics["gradient_norm"] = self._descend(loss)
        # The first step of a group is the row that was drawn; what was not learned from keeps its priority.
        seen = sample.valid[:, 0]
        self._replay.update_priorities(sample.row[seen], (q_tm1 - target).detach().numpy()[seen, 0])
        return {name: float(value.detach()) for name, value in metrics.items()}

    def _descend(self, loss: torch.Tensor) -> torch.Tensor:
        """One step of the optimizer, and the target network's after it; returns the gradient's norm."""
        self._optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        network = self.actor.network
        norm = torch.nn.utils.clip_grad_norm_(network.parameters(), self._config.max_gradient_norm)
        self._optimizer.step()
        with torch.no_grad():
            for slow, fast in zip(self._target.parameters(), network.parameters(), strict=True):
                slow.lerp_(fast, self._config.target_rate)
        return norm

    def _features(self, state: np.ndarray, origin: np.ndarray, turned: int) -> torch.Tensor:
        features = state_features(torch.from_numpy(state), torch.from_numpy(origin)[:, None])
        return symmetry.turn_features(features, turned)

    def _codes(self, sample: Sample, turned: int) -> tuple[torch.Tensor | None, torch.Tensor | None]:
        """The sample's contexts, turned, as the network and the target network encode them."""
        if not self._config.use_context:
            return None, None
        size = self._mazes[0].size
        contexts = [
            build_context(
                self._mazes[maze].walls, divmod(start, size), divmod(goal, size), self.actor.context_size_built
            )
            for maze, start, goal in zip(sample.maze.tolist(), sample.start.tolist(), sample.goal.tolist(), strict=True)
        ]
        planes = symmetry.turn_planes(torch.from_numpy(np.stack(contexts)), turned)
        with torch.no_grad():
            target_code = self._target.encode(planes)
        return self.actor.network.encode(planes), target_code

    @torch.no_grad()
    def _targets(
        self, sample: Sample, turned: int, code: torch.Tensor | None, target_code: torch.Tensor | None
    ) -> torch.Tensor:
        """`[G, K]`: n-step double-Q targets (van Hasselt et al. 2016), within the values that there are."""
        features = self._features(sample.next_state, sample.origin, turned)
        q_selector, q_value = self.actor.network(features, code), self._target(features, target_code)
        reward, discount = torch.from_numpy(sample.reward), torch.from_numpy(sample.discount)
        return double_q_target(reward, discount, q_value, q_selector).clamp(-self._config.longest_value, 0.0)

    def _localization_error(
        self, sample: Sample, turned: int, features: torch.Tensor, code: torch.Tensor
    ) -> torch.Tensor:
        """The mean distance, in cells, of where the network believes the steps to be from the cells they were in."""
        size = self._mazes[0].size
        cells = torch.from_numpy(np.stack(np.divmod(sample.cell, size), axis=-1)).float()
        cells = symmetry.turn_cells(cells, size, turned) * (self.actor.context_size_built / size)
        return (self.actor.network.locate(features[..., :2], code) - cells).abs().mean()

    def save(self, folder: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes the agent, the target network and optimizer, the random stream and the replay."""
        metadata = {
            "agent": self.actor.name,
            "config": self.config(),
            "context_size": self.actor.context_size_built,
            "provenance": dict(provenance),
        }
        save_checkpoint(folder / AGENT_FILE, self.actor.network.state_dict(), metadata)
        save_learner(folder, self.actor.name, self._target, self._optimizer, self._rng, self._replay)

    def load(self, folder: pathlib.Path) -> None:
        """Goes on from what `save` wrote; where the replay is gone, learning waits until it is filled again."""
        tensors, _ = load_checkpoint(folder / AGENT_FILE, self.actor.name)
        load_into(folder / AGENT_FILE, self.actor.network, tensors)
        load_learner(folder, self.actor.name, self._target, self._optimizer, self._rng, self._replay)


def double_q_target(
    r_t: torch.Tensor, discount_t: torch.Tensor, q_t_value: torch.Tensor, q_t_selector: torch.Tensor
) -> torch.Tensor:
    """`[...]`: r + discount * q_value(argmax q_selector) (van Hasselt et al. 2016, eq. 4).

    Args:
      r_t: `[...]` sums of rewards.
      discount_t: `[...]` of what follows them.
      q_t_value: `[..., 6]` action values that are believed, the target network's.
      q_t_selector: `[..., 6]` action values that choose, the online network's.
    """
    best = q_t_selector.argmax(dim=-1, keepdim=True)
    return r_t + discount_t * q_t_value.gather(-1, best)[..., 0]
