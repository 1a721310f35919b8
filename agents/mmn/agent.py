"""MMN, after the paper's map-conditioned multi-task navigator: MuZero whose model's weights are generated from a map.

docs/agents/mmn.md describes the training, and how it departs from the paper.
"""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np
import torch

from mazebench.agent import Inputs, Observation

from ..common.actor import NetworkAgent, one_torch_thread
from ..common.bounds import bounded
from ..common.layers import in_batches, marked_position, state_features
from ..muzero.network import CONTEXTS_AT_ONCE, NUM_ACTIONS, STATES_AT_ONCE, Code, rows_of, with_codes
from .config import MMNConfig
from .learner import MMNLearner
from .network import MMNNetwork
from .planning import plan


@dataclasses.dataclass
class ActorState:
    """The state of acting in B environments."""

    origin: np.ndarray  # [B, 2] float32, x and y observed at the anchor, from which displacements are measured
    code: Code | None  # of B contexts; None before the first step


class MMN(NetworkAgent):
    """Acts by tree search in a latent model, whose weights a hypermodel generates from the context, once a leg."""

    name: ClassVar[str] = "mmn"
    default_config: ClassVar[MMNConfig] = MMNConfig()
    learner_class: ClassVar[type[MMNLearner]] = MMNLearner
    learns_on_gpu = True
    config: MMNConfig
    network: MMNNetwork

    @classmethod
    def make_network(cls, config: MMNConfig, context_size: int) -> MMNNetwork:
        """Returns a new network."""
        return MMNNetwork(config, context_size)

    @classmethod
    def serves_any_size(cls, config: MMNConfig) -> bool:
        """Returns that it does not: the code of a context has a fixed size."""
        return False

    @classmethod
    def measure(cls, seconds: float) -> dict[str, list[dict[str, Any]]]:
        """Returns tables for `mazebench bench`: of the search, and of the parts of an update."""
        from ..muzero.measure import update_table
        from .measure import search_table

        return search_table(seconds) | update_table(seconds, cls.build_learner)

    def initial_state(self, batch_size: int) -> ActorState:
        """Returns a state without codes: `act` encodes a context where it is new."""
        return ActorState(np.zeros((batch_size, 2), dtype=np.float32), None)

    @torch.no_grad()
    @one_torch_thread()
    def act(self, inputs: Inputs, state: ActorState, explore: bool = False) -> tuple[np.ndarray, ActorState]:
        """Returns actions `[B]`; the hypermodel runs only where a context is new."""
        inputs = bounded(inputs)
        new = np.flatnonzero(inputs.new_context)
        if len(new):
            new_anchor = inputs.new_episode | (not self.config.keep_anchor)
            self._encode(inputs.observation, new, new_anchor, state)
        assert state.code is not None, "new_context must be set in an environment's first step"
        features = state_features(torch.from_numpy(inputs.observation["state"]), torch.from_numpy(state.origin))
        return self._planned(features, state.code, inputs.active, explore), state

    def _planned(self, features: torch.Tensor, code: Code, active: np.ndarray | None, explore: bool) -> np.ndarray:
        """Returns actions `[B]` in states with features `[B, 9]`; 0 where an environment is not `active`."""
        if active is not None and not active.all():
            rows, action = torch.from_numpy(active), np.zeros(len(features), dtype=np.int64)
            some = rows_of(code, rows.to(code.positions.device))
            action[active] = self._planned(features[rows], some, None, explore)
            return action
        latent = in_batches(self.network.encode, STATES_AT_ONCE, features[:, None].to(self.network.support.device))
        num_simulations = self.config.num_simulations if explore else self.config.num_eval_simulations
        noise = (self._rng, self._noise_scale) if explore else ()
        action = plan(self.network, self.config, latent, code, num_simulations, *noise).action
        return self._explored(action, NUM_ACTIONS) if explore else action

    def _encode(self, observation: Observation, new: np.ndarray, new_anchor: np.ndarray, state: ActorState) -> None:
        """Writes the codes of the contexts at `new` into `state`; where no anchor is new, the old one is kept."""
        device = self.network.support.device
        origin = np.where(new_anchor[new, None], observation["state"][new, :2], state.origin[new])
        moved = torch.from_numpy(observation["state"][new, :2] - origin).to(device)
        state.origin[new] = origin
        rows = torch.from_numpy(new).to(device)
        context = torch.from_numpy(observation["context"][new]).to(device)
        anchor = start = marked_position(context[:, 3])
        if state.code is not None:
            kept = self.network.reanchored(state.code.positions[rows, :2], moved, start)
            anchor = torch.where(torch.from_numpy(new_anchor[new, None]).to(device), start, kept)
        code = in_batches(self.network.hypermodel, CONTEXTS_AT_ONCE, context, anchor)
        state.code = with_codes(state.code, len(state.origin), rows, code)
