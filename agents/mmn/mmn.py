"""The paper's MMN, the map-conditioned multi-task navigator: MuZero whose model's weights are generated from a map.

docs/agents/mmn-paper.md describes the training, and how it differs from the paper.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np
import torch

from mazebench.agent import Inputs, Interface, Observation
from mazebench.maps.maze import Maze

from ..common.actor import NetworkAgent
from ..common.checkpoint import check_size, load_agent, load_into
from ..common.layers import in_batches, marked_position, state_features
from ..common.overrides import override
from .config import PaperConfig, PlanningConfig
from .learner import MMNLearner
from .network import NUM_ACTIONS, Code, Network, rows_of
from .paper import PaperNetwork
from .planning import plan

# Contexts and states are computed as many at once, always, since PyTorch rounds differently at another batch size.
CONTEXTS_AT_ONCE = 16  # few are new in one step
STATES_AT_ONCE = 64


@dataclasses.dataclass
class ActorState:
    """The state of acting in B environments."""

    origin: np.ndarray  # [B, 2] float32, x and y observed at the anchor, from which displacements are measured
    code: Code | None  # of B contexts; None before the first step


class MMNPaper(NetworkAgent):
    """Acts by tree search in a latent model, whose weights a hypermodel generates from the context, once a leg."""

    name: ClassVar[str] = "mmn-paper"
    default_config: ClassVar[PlanningConfig] = PaperConfig()
    network_class: ClassVar[type[Network]] = PaperNetwork
    learner_class: ClassVar[type[MMNLearner]] = MMNLearner
    config: Any
    network: Network

    def __init__(self, config: PlanningConfig, context_size: int, seed: int = 0, device: str = "cpu"):
        torch.set_num_threads(1)
        self.config = config
        self.trained_size = context_size
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.network = self.network_class(config, context_size).to(device)
        self.explore_from(0, config.num_envs, seed)

    @property
    def keeps_anchor(self) -> bool:
        """Whether displacements are measured from where the episode began, through all its legs."""
        return self.config.keep_anchor

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns the agent of a checkpoint, by default of the one that ships.

        Raises:
          InputError: if the checkpoint can't be used here.
        """
        path = cls.default_checkpoint() if checkpoint is None else checkpoint
        tensors, config, trained_size = load_agent(path, cls.name, cls.default_config)
        if not cls.network_class.serves_any_size:
            check_size(path, trained_size, interface.context_size)
        agent = cls(config, trained_size, seed)
        load_into(path, agent.network, tensors)
        return agent

    @classmethod
    def build_learner(
        cls, interface: Interface, mazes: Sequence[Maze], *, seed: int = 0, overrides: Mapping[str, str] | None = None
    ) -> MMNLearner:
        """Returns a learner for an agent of this class, on a GPU if there is one."""
        config = override(cls.default_config, overrides or {})
        device = "cuda" if torch.cuda.is_available() else "cpu"
        return cls.learner_class(cls(config, interface.context_size, seed, device), tuple(mazes), seed)

    @classmethod
    def measure(cls, seconds: float) -> dict[str, list[dict[str, Any]]]:
        """Returns the speed of the parts of an update; that of the search is measured with MMN."""
        from .measure import update_table

        return update_table(seconds, cls.build_learner)

    def initial_state(self, batch_size: int) -> ActorState:
        """Returns a state without codes: `act` encodes a context where it is new."""
        return ActorState(np.zeros((batch_size, 2), dtype=np.float32), None)

    def explore_from(self, first_env: int, num_envs: int, seed: int) -> None:
        """Begins a new stream of exploration; the search's noise falls from the first environment to the last, too."""
        super().explore_from(first_env, num_envs, seed)
        rung = (first_env + np.arange(num_envs)) / max(1, self.config.num_envs - 1)
        self._noise_scale = 1.0 - rung

    @torch.no_grad()
    def act(self, inputs: Inputs, state: ActorState, explore: bool = False) -> tuple[np.ndarray, ActorState]:
        """Returns actions `[B]`; the hypermodel runs only where a context is new."""
        new = np.flatnonzero(inputs.new_context)
        if len(new):
            new_anchor = inputs.new_episode | (not self.keeps_anchor)
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
        write_codes(state, rows, in_batches(self.network.hypermodel, CONTEXTS_AT_ONCE, context, anchor))


def write_codes(state: ActorState, rows: torch.Tensor, code: Code) -> None:
    """Writes codes into `rows` of a state's."""
    if state.code is None:
        size = len(state.origin)
        state.code = code._make(part.new_zeros(size, *part.shape[1:]) for part in code)
    for whole, part in zip(state.code, code, strict=True):
        whole[rows] = part
