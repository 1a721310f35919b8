"""The learner of DQN and MAH: double n-step targets on relabelled experience, drawn by priority.

`G` groups of `K` steps make a batch; the steps of a group share one context.
"""

from __future__ import annotations

import numpy as np
import torch
from torch.nn import functional

from mazebench.maps.maze import Maze

from ..common import symmetry
from ..common.actor import NetworkAgent, one_torch_thread
from ..common.layers import state_features
from ..common.learner import HindsightLearner
from ..common.replay import Sample


class DQNLearner(HindsightLearner):
    """Updates the Q-network of its actor."""

    def __init__(self, actor: NetworkAgent, mazes: tuple[Maze, ...], seed: int):
        optimizer = torch.optim.Adam(actor.network.parameters(), lr=actor.config.learning_rate)
        super().__init__(actor, mazes, seed, optimizer, priority_exponent=actor.config.priority_exponent)

    @one_torch_thread()
    def update(self) -> dict[str, float]:
        """Learns from one batch; returns its losses and other scalars by name."""
        config = self._config
        sample = self._replay.sample(
            config.groups, config.steps, config.n_step, self._hindsight, self._rng, config.importance_exponent
        )
        turned = self._draw_symmetry()
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
        if code is not None and config.reading:
            metrics["localization_error"] = self._localization_error(sample, turned, features, code)
            loss = loss + config.localization_weight * metrics["localization_error"]
        metrics["gradient_norm"] = self._descend(loss)
        # The first step of a group is the row that was drawn. A row that was not learned from keeps its priority.
        seen = sample.valid[:, 0]
        self._replay.update_priorities(sample.row[seen], (q_tm1 - target).detach().numpy()[seen, 0])
        return {name: float(value.detach()) for name, value in metrics.items()}

    def _features(self, state: np.ndarray, origin: np.ndarray, turned: int) -> torch.Tensor:
        features = state_features(torch.from_numpy(state), torch.from_numpy(origin)[:, None])
        return symmetry.turn_features(features, turned)

    def _codes(self, sample: Sample, turned: int) -> tuple[torch.Tensor | None, torch.Tensor | None]:
        """Returns the turned contexts of a sample, encoded by the network and by the target network."""
        if not self._config.use_context:
            return None, None
        planes = self._contexts(sample, turned)
        with torch.no_grad():
            target_code = self._target.encode(planes)
        return self.actor.network.encode(planes), target_code

    @torch.no_grad()
    def _targets(
        self, sample: Sample, turned: int, code: torch.Tensor | None, target_code: torch.Tensor | None
    ) -> torch.Tensor:
        """Returns n-step double-Q targets `[G, K]` (van Hasselt et al. 2016), clipped to the possible values."""
        features = self._features(sample.next_state, sample.origin, turned)
        q_selector, q_value = self.actor.network(features, code), self._target(features, target_code)
        reward, discount = torch.from_numpy(sample.reward), torch.from_numpy(sample.discount)
        return double_q_target(reward, discount, q_value, q_selector).clamp(-self._config.longest_value, 0.0)

    def _localization_error(
        self, sample: Sample, turned: int, features: torch.Tensor, code: torch.Tensor
    ) -> torch.Tensor:
        """Returns the mean error, in cells, of the network's estimated positions on the map."""
        true_position = self._positions(sample, turned)
        return (self.actor.network.locate(features[..., :2], code) - true_position).abs().mean()


def double_q_target(
    r_t: torch.Tensor, discount_t: torch.Tensor, q_t_value: torch.Tensor, q_t_selector: torch.Tensor
) -> torch.Tensor:
    """Returns r + discount * q_value(argmax q_selector), `[...]` (van Hasselt et al. 2016, eq. 4).

    Args:
      r_t: `[...]`, sums of rewards.
      discount_t: `[...]`, of the value after them.
      q_t_value: `[..., 6]`, action values that are taken over, the target network's.
      q_t_selector: `[..., 6]`, action values that choose the action, the online network's.
    """
    best = q_t_selector.argmax(dim=-1, keepdim=True)
    return r_t + discount_t * q_t_value.gather(-1, best)[..., 0]
