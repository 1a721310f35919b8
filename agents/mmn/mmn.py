"""MMN, the paper's map-conditioned multi-task navigator: MuZero whose model's weights come from a map.

docs/agents/mmn.md says what was trained, and how it differs from the paper.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import torch

from mazebench.agent import Interface, Observation
from mazebench.errors import InputError, unknown

from ..actor import NetworkAgent
from ..checkpoint import load_agent, load_into
from ..layers import marked_place, state_features
from ..overrides import override
from .config import PRESETS, MMNConfig
from .hypermodels import NUM_ACTIONS, Code
from .network import MMNNetwork
from .planning import plan

_ROWS_AT_ONCE = 64  # contexts or states; always as many, since PyTorch rounds differently at another batch size


@dataclasses.dataclass
class ActorState:
    """What acting carries from step to step in B environments."""

    origin: np.ndarray  # [B, 2] float32, x and y observed where motion is told from
    code: Code | None  # of B contexts; None until there is one


class MMN(NetworkAgent):
    """Acts by tree search in a latent model whose weights the hypermodel predicts from the context, once a leg."""

    name: ClassVar[str] = "mmn"
    default_config: ClassVar[MMNConfig] = PRESETS["default"]
    network: MMNNetwork

    def __init__(self, config: MMNConfig, context_size: int, seed: int = 0, device: str = "cpu"):
        torch.set_num_threads(1)
        self.config = config
        self.context_size_built = context_size
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.network = MMNNetwork(config, context_size).to(device)
        self.explore_from(0, config.num_envs, seed)
        self._begins: np.ndarray | None = None  # [B] bool, where the next step begins an episode

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> MMN:
        """The agent of a checkpoint, by default of the one that ships.

        Raises:
          InputError: if the checkpoint can't be used here.
        """
        path = cls.default_checkpoint() if checkpoint is None else checkpoint
        tensors, config, trained_size = load_agent(path, cls.name, cls.default_config)
        if config.hypermodel != "spatial" and interface.context_size != trained_size:
            raise InputError(
                f"{path}: expected contexts of {trained_size} x {trained_size}, the only ones that its hypermodel "
                f"{config.hypermodel!r} serves, found {interface.context_size} x {interface.context_size}"
            )
        agent = cls(config, trained_size, seed)
        load_into(path, agent.network, tensors)
        return agent

    @classmethod
    def build_learner(
        cls, interface: Interface, mazes: Any, *, seed: int = 0, overrides: Mapping[str, str] | None = None
    ) -> Any:
        """A learner of this agent's kind; see `mazebench.agent.LearningAgent`. The key `preset` names what to override.

        It learns on a GPU if there is one.
        """
        from .learner import MMNLearner

        values = dict(overrides or {})
        preset = values.pop("preset", "default")
        if preset not in PRESETS:
            raise unknown("preset", preset, PRESETS)
        config = override(PRESETS[preset], values)
        device = "cuda" if torch.cuda.is_available() else "cpu"
        return MMNLearner(cls(config, interface.context_size, seed, device), tuple(mazes), seed)

    @classmethod
    def measure(cls, seconds: float) -> dict[str, list[dict[str, Any]]]:
        """Tables for `mazebench bench`: how fast the search is."""
        from .measure import measure

        return measure(seconds)

    def initial_state(self, batch_size: int) -> ActorState:
        """No context encoded yet: `act` does it where one is first."""
        return ActorState(np.zeros((batch_size, 2), dtype=np.float32), None)

    def explore_from(self, first_env: int, num_envs: int, seed: int) -> None:
        """Takes these rungs of the ladder, on which there is less and less noise in the search, too."""
        super().explore_from(first_env, num_envs, seed)
        rung = (first_env + np.arange(num_envs)) / max(1, self.config.num_envs - 1)
        self._noise_scale = 1.0 - rung if self.config.noise_ladder else np.ones(num_envs)

    def seed_episodes(self, seeds: np.ndarray, mask: np.ndarray) -> None:
        """Is told that episodes begin where `mask` `[B]`; without, every new context is taken for an episode's."""
        self._begins = mask

    @torch.no_grad()
    def act(
        self, observation: Observation, is_first: np.ndarray, state: ActorState, explore: bool = False
    ) -> tuple[np.ndarray, ActorState]:
        """Actions `[B]`; the hypermodel runs once for a context, where it is new, and all searches use what it gave."""
        new = np.flatnonzero(is_first)
        if len(new):
            begins, self._begins = is_first if self._begins is None else self._begins, None
            self._encode(observation, new, begins | (not self.config.keep_anchor), state)
        assert state.code is not None, "is_first must be set in an environment's first step"
        device = self.network.support.device
        features = state_features(torch.from_numpy(observation["state"]), torch.from_numpy(state.origin))
        actions = [
            self._plan(rows, features_of_rows[:, None].to(device), state.code, explore)
            for rows, features_of_rows in zip(_slices(len(features)), features.split(_ROWS_AT_ONCE), strict=True)
        ]
        action = np.concatenate(actions)
        if explore:
            action = self._explored(action, NUM_ACTIONS)
        return action, state

    def _encode(self, observation: Observation, new: np.ndarray, begins: np.ndarray, state: ActorState) -> None:
        """Puts the codes of the contexts at `new` into the state; where no episode `begins`, their anchors stay."""
        device = self.network.support.device
        origin = np.where(begins[new, None], observation["state"][new, :2], state.origin[new])
        moved = torch.from_numpy(observation["state"][new, :2] - origin).to(device)
        state.origin[new] = origin
        for rows in _slices(len(new)):
            context = torch.from_numpy(observation["context"][new[rows]]).to(device)
            start = marked_place(context[:, 3])
            anchor = start
            if state.code is not None:
                kept = self.network.reanchored(state.code.places[torch.from_numpy(new[rows]), :2], moved[rows], start)
                anchor = torch.where(torch.from_numpy(begins[new[rows], None]).to(device), start, kept)
            code = self.network.hypermodel(_padded(context), _padded(anchor)).of(slice(len(context)))
            if state.code is None:
                size = len(state.origin)
                state.code = Code(*(part.new_zeros(size, *part.shape[1:]) for part in code))
            for whole, part in zip(state.code, code, strict=True):
                whole[torch.from_numpy(new[rows]).to(device)] = part

    def _plan(self, rows: slice, features: torch.Tensor, code: Code, explore: bool) -> np.ndarray:
        """Actions in some of the environments."""
        config = self.config
        latent = self.network.encode(_padded(features))
        code = Code(*(_padded(part[rows]) for part in code))
        num_simulations = config.num_simulations if explore else config.num_eval_simulations
        scale = np.resize(self._noise_scale[rows], len(latent)) if explore else 1.0
        rng = self._rng if explore else None
        return plan(self.network, config, latent, code, num_simulations, rng, scale).action[: len(features)]


def _slices(num_rows: int) -> list[slice]:
    return [slice(begin, begin + _ROWS_AT_ONCE) for begin in range(0, num_rows, _ROWS_AT_ONCE)]


def _padded(rows: torch.Tensor) -> torch.Tensor:
    """`rows` and as many rows of zeros as are missing."""
    missing = _ROWS_AT_ONCE - len(rows)
    return torch.cat([rows, rows.new_zeros(missing, *rows.shape[1:])]) if missing else rows
