"""MMN, after the paper's map-conditioned multi-task navigator: MuZero whose model's weights are generated from a map.

docs/agents/mmn.md describes the training, and how it departs from the paper.
"""

from __future__ import annotations

import dataclasses
import functools
import pathlib
from typing import ClassVar, Self

import numpy as np
import torch

from mazebench.agent import Inputs, Interface, Observation
from mazebench.tasks.context import START

from ..common.actor import ActorState, NetworkAgent, acting
from ..common.layers import in_batches, marked_position, state_features
from .hypermodel import CONTEXTS_AT_ONCE, STATES_AT_ONCE, Code, MMNNetwork
from .mmn_config import MMNConfig, MMNEvalConfig
from .model_learner import MMNLearner
from .search_policy import plan


class MMN(NetworkAgent):
    """Acts by tree search in a latent model, whose weights a hypermodel generates from the context, once a leg.

    Displacements are measured from the anchor, the place where the episode began.
    """

    name: ClassVar[str] = "mmn"
    needs_shown: ClassVar[tuple[str, ...]] = ("map", "goal")
    default_config: ClassVar[MMNConfig] = MMNConfig()
    learner_class: ClassVar[type[MMNLearner]] = MMNLearner
    eval_config: ClassVar[MMNEvalConfig] = MMNEvalConfig()
    learns_on_gpu = True
    config: MMNConfig
    network: MMNNetwork

    @classmethod
    def build(
        cls,
        interface: Interface,
        *,
        seed: int = 0,
        checkpoint: pathlib.Path | None = None,
        config: MMNEvalConfig | None = None,
        folder: pathlib.Path | None = None,
    ) -> Self:
        """Returns the agent of a checkpoint, as `NetworkAgent.build` does, with an evaluation's own search."""
        agent = super().build(interface, seed=seed, checkpoint=checkpoint)
        if config is not None and config.num_eval_simulations is not None:
            agent.config = dataclasses.replace(agent.config, num_eval_simulations=config.num_eval_simulations)
        return agent

    @classmethod
    def make_network(cls, config: MMNConfig, context_size: int) -> MMNNetwork:
        """Returns a new network."""
        return MMNNetwork(config, context_size)

    @classmethod
    def serves_any_size(cls, config: MMNConfig) -> bool:
        """Returns whether the cheapest ways are read: otherwise the code of a context has a fixed size."""
        return config.any_size

    @acting
    def act(self, inputs: Inputs, state: ActorState, explore: bool = False) -> tuple[np.ndarray, ActorState]:
        """Returns actions `[B]`; the hypermodel runs only where a context is new."""
        # Codes of the new contexts.
        new = np.flatnonzero(inputs.new_context)
        if len(new):
            self._encode(inputs.observation, new, inputs.new_episode[new], state, explore)
        assert state.code is not None, "new_context must be set in an environment's first step"

        # Latent states of the environments that are active.
        active = np.ones(len(state.origin), dtype=bool) if inputs.active is None else inputs.active
        observed, origin = torch.from_numpy(inputs.observation["state"]), torch.from_numpy(state.origin)
        features = state_features(observed, origin)[torch.from_numpy(active)].to(self._device)
        latent = in_batches(self.network.encode, STATES_AT_ONCE, features[:, None])
        code = state.code
        if not active.all():
            code = Code(*(part[torch.from_numpy(active).to(self._device)] for part in code))

        # The action that a tree search finds or, exploring, one that is less sure; without a model, the best by value.
        if not self.config.model:

            def action_values(latent: torch.Tensor, *code: torch.Tensor) -> torch.Tensor:  # [B, 1, 6]
                return self.network.predict_without_model(latent, Code(*code))[0]

            values = in_batches(action_values, STATES_AT_ONCE, latent, *code)[:, 0]
            chosen = values.argmax(dim=-1).cpu().numpy()
            chosen = self._explored(chosen) if explore else chosen
        elif explore:
            found = plan(
                self.network, self.config, latent, code, self.config.num_simulations, self._rng, self._noise_scale
            )
            chosen = self._explored(found.action)
        else:
            chosen = plan(self.network, self.config, latent, code, self.config.num_eval_simulations).action
        action = np.zeros(len(active), dtype=np.int64)
        action[active] = chosen
        return action, state

    def _encode(
        self, observation: Observation, new: np.ndarray, new_anchor: np.ndarray, state: ActorState, explore: bool
    ) -> None:
        """Writes the codes of the contexts at the rows `new` `[K]` into `state`.

        Displacements are measured from where bodies are now if `new_anchor` `[K]`, else from the anchor that they have.
        If `explore`, cheapest ways may cross what costs much.
        """
        # How far each body has moved from its anchor.
        position = observation["state"][new, :2]
        origin = np.where(new_anchor[:, None], position, state.origin[new])
        moved = torch.from_numpy(position - origin).to(self._device)
        state.origin[new] = origin

        # Where the anchor is on the map: at the marker of the start, if it is new.
        rows = torch.from_numpy(new).to(self._device)
        context = torch.from_numpy(observation["context"][new]).to(self._device)
        anchor = start = marked_position(context[:, START])
        if state.code is not None:
            kept = self.network.reanchored(state.code.positions[rows, :2], moved, start)
            anchor = torch.where(torch.from_numpy(new_anchor[:, None]).to(self._device), start, kept)

        encode = functools.partial(self.network.hypermodel, closes=not explore)
        code = in_batches(encode, CONTEXTS_AT_ONCE, context, anchor)
        if state.code is None:
            state.code = Code(*(part.new_zeros(len(state.origin), *part.shape[1:]) for part in code))
        for whole, part in zip(state.code, code, strict=True):
            whole[rows] = part

    @property
    def _device(self) -> torch.device:
        return self.network.support.device


class MMNPaths(MMN):
    """MMN whose heads read cheapest ways over learned costs, however far, in the place of convolutions."""

    name: ClassVar[str] = "mmn-paths"
    default_config: ClassVar[MMNConfig] = MMNConfig(far="paths")
