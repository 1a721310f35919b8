"""MMN, the paper's map-conditioned multi-task navigator: MuZero whose model's weights come from a map.

docs/agents/mmn.md says what was trained, and how it differs from the paper.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping
from importlib import resources
from typing import Any, ClassVar

import numpy as np
import torch

from mazebench.agent import Interface, Observation
from mazebench.errors import InputError, unknown

from ..checkpoint import load_agent, load_into
from ..layers import state_features
from ..overrides import override
from .config import PRESETS, MMNConfig
from .hypermodels import NUM_ACTIONS, Code
from .network import MMNNetwork
from .planning import plan

_ROWS_AT_ONCE = 64  # contexts or states; always as many, since PyTorch rounds differently at another batch size


@dataclasses.dataclass
class ActorState:
    """What acting carries from step to step in B environments."""

    origin: np.ndarray  # [B, 2] float32, x and y observed where the context was new
    code: Code | None  # of B contexts; None until there is one


class MMN:
    """Acts by tree search in a latent model whose weights the hypermodel predicts from the context, once a leg."""

    name: ClassVar[str] = "mmn"
    default_config: ClassVar[MMNConfig] = PRESETS["default"]

    def __init__(self, config: MMNConfig, context_size: int, seed: int = 0, device: str = "cpu"):
        torch.set_num_threads(1)
        self.config = config
        self.context_size_built = context_size
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.network = MMNNetwork(config, context_size).to(device)
        self.explore_from(0, config.num_envs, seed)

    def explore_from(self, first_env: int, num_envs: int, seed: int) -> None:
        """Takes the rungs `first_env` to `first_env + num_envs` of the ladder, and a new stream of random numbers."""
        rung = (first_env + np.arange(num_envs)) / max(1, self.config.num_envs - 1)
        self._epsilon = self.config.epsilon_base ** (1 + self.config.epsilon_alpha * rung)
        self._rng = np.random.default_rng(seed)

    def parameters(self) -> dict[str, np.ndarray]:
        """The network's, by name."""
        return {name: value.cpu().numpy().copy() for name, value in self.network.state_dict().items()}

    def set_parameters(self, parameters: dict[str, np.ndarray]) -> None:
        """Takes over another network's."""
        self.network.load_state_dict({name: torch.from_numpy(value.copy()) for name, value in parameters.items()})

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
    def default_checkpoint(cls) -> pathlib.Path:
        """The checkpoint that ships."""
        path = resources.files("mazebench_assets").joinpath("checkpoints", f"{cls.name}-13.safetensors")
        return pathlib.Path(str(path))

    @classmethod
    def measure(cls, seconds: float) -> dict[str, list[dict[str, Any]]]:
        """Tables for `mazebench bench`: how fast the search is."""
        from .measure import measure

        return measure(seconds)

    def initial_state(self, batch_size: int) -> ActorState:
        """No context encoded yet: `act` does it where one is first."""
        return ActorState(np.zeros((batch_size, 2), dtype=np.float32), None)

    @torch.no_grad()
    def act(
        self, observation: Observation, is_first: np.ndarray, state: ActorState, explore: bool = False
    ) -> tuple[np.ndarray, ActorState]:
        """Actions `[B]`; the hypermodel runs once for a context, where it is new, and all searches use what it gave."""
        new = np.flatnonzero(is_first)
        if len(new):
            state.origin[new] = observation["state"][new, :2]
            self._encode(observation["context"], new, state)
        assert state.code is not None, "is_first must be set in an environment's first step"
        device = self.network.support.device
        features = state_features(torch.from_numpy(observation["state"]), torch.from_numpy(state.origin))
        actions = [
            self._plan(rows, features_of_rows[:, None].to(device), state.code, explore)
            for rows, features_of_rows in zip(_slices(len(features)), features.split(_ROWS_AT_ONCE), strict=True)
        ]
        action = np.concatenate(actions)
        if explore:
            at_random = self._rng.random(len(action)) < self._epsilon
            action = np.where(at_random, self._rng.integers(NUM_ACTIONS, size=len(action)), action)
        return action, state

    def _encode(self, contexts: np.ndarray, new: np.ndarray, state: ActorState) -> None:
        """Puts the codes of the contexts at `new` into the state."""
        device = self.network.support.device
        for rows in _slices(len(new)):
            context = torch.from_numpy(contexts[new[rows]]).to(device)
            code = self.network.hypermodel(_padded(context)).of(slice(len(context)))
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
        result = plan(self.network, config, latent, code, num_simulations, self._rng if explore else None)
        return result.action[: len(features)]


def _slices(num_rows: int) -> list[slice]:
    return [slice(begin, begin + _ROWS_AT_ONCE) for begin in range(0, num_rows, _ROWS_AT_ONCE)]


def _padded(rows: torch.Tensor) -> torch.Tensor:
    """`rows` and as many rows of zeros as are missing."""
    missing = _ROWS_AT_ONCE - len(rows)
    return torch.cat([rows, rows.new_zeros(missing, *rows.shape[1:])]) if missing else rows
