"""Building and loading of a network, its parameters, and exploration: shared by the agents that act by one."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
from collections.abc import Callable, Iterator, Mapping
from importlib import resources
from typing import Any, ClassVar, Self, TypeVar

import numpy as np
import torch

from mazebench.agent import Interface
from mazebench.constants import NUM_ACTIONS
from mazebench.errors import UnplayableError
from mazebench.options import override
from mazebench.tasks.task import Task
from mazebench.training.protocol import Learner, LearningAgent

from .checkpoint import load_agent, load_checkpoint, load_into, save_checkpoint


@contextlib.contextmanager
def one_torch_thread() -> Iterator[None]:
    """Leaves PyTorch one thread in the block, or in a function that it decorates; then the process has its own again.

    Results then do not depend on the number of cores, and no thread waits for a core that other work keeps busy.
    """
    num_threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(num_threads)


_Act = TypeVar("_Act", bound=Callable[..., Any])


def acting(act: _Act) -> _Act:
    """Decorates `act` of an agent with a network: PyTorch keeps no gradients, in one thread."""
    return torch.no_grad()(one_torch_thread()(act))


@dataclasses.dataclass
class ActorState:
    """The state of acting in B environments, whose contexts are encoded once."""

    origin: np.ndarray  # [B, 2] float32, m, x and y observed at the point from which displacements are measured
    code: Any  # of the B contexts, as the agent's network encodes them; None before the first step, or without context


class NetworkAgent(LearningAgent):
    """An agent that acts by a network; by default it explores by random actions, in environment i at Ape-X's rate i."""

    name: ClassVar[str]
    shipped_size: ClassVar[int] = 13  # N of the mazes in which the checkpoint that ships was trained
    default_config: ClassVar[Any]  # a frozen dataclass that has num_envs, epsilon_base and epsilon_alpha
    learner_class: ClassVar[Any]  # called with the agent, the task to learn in and a seed
    learns_on_gpu: ClassVar[bool] = False  # whether the learner uses a GPU if there is one
    config: Any
    network: Any  # a torch.nn.Module
    trained_size: int  # M of the contexts that the network was made for

    def __init__(self, config: Any, context_size: int, seed: int = 0, device: str = "cpu"):
        """Makes an agent with a new network for contexts of M x M; `seed` is also that of exploration."""
        self.config = config
        self.trained_size = context_size
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.network = self.make_network(config, context_size).to(device)
        self.explore_from(seed)

    @classmethod
    def make_network(cls, config: Any, context_size: int) -> torch.nn.Module:
        """Returns a new network of a config, for contexts of M x M."""
        raise NotImplementedError

    @classmethod
    def serves_any_size(cls, config: Any) -> bool:
        """Returns whether contexts may have another M than those of the training."""
        return True

    @classmethod
    def context_size(cls, size: int) -> int:
        """Returns N: the map at full resolution, a metre a cell as in the mazes of the training."""
        return size

    @classmethod
    def read_sensors(cls, sensors: tuple[str, ...]) -> tuple[str, ...]:
        """Returns those that it needs."""
        return tuple(name for name in sensors if name in cls.needs_sensors)

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns the agent of a checkpoint, by default of the one that ships.

        Raises:
          InputError: if the checkpoint can't be read, or is another agent's.
          UnplayableError: if it learned on another body, or its network serves contexts of another size only.
        """
        path = cls.default_checkpoint() if checkpoint is None else checkpoint
        tensors, config, trained_size = load_agent(path, cls.name, cls.default_config, interface.body)
        size = interface.context_size
        if size != trained_size and not cls.serves_any_size(config):
            expected = f"its checkpoint reads maps of {trained_size} x {trained_size} only, found {size} x {size}"
            raise UnplayableError(f"agent {cls.name!r}: {expected}; mah and mmn-paths read any size")
        agent = cls(config, trained_size, seed)
        load_into(path, agent.network, tensors)
        return agent.for_interface(interface)

    @classmethod
    def task_options(cls, overrides: Mapping[str, str] | None = None) -> dict[str, Any]:
        """Returns the number of goals of an episode, as configured."""
        return {"num_goals": override(cls.default_config, overrides or {}).num_goals}

    @classmethod
    def build_learner(cls, task: Task, *, seed: int = 0, overrides: Mapping[str, str] | None = None) -> Learner:
        """Returns a learner for an agent of this class."""
        config = override(cls.default_config, overrides or {})
        device = "cuda" if cls.learns_on_gpu and torch.cuda.is_available() else "cpu"
        return cls.learner_class(cls(config, task.context_size, seed, device).for_interface(task.interface), task, seed)

    def initial_state(self, batch_size: int) -> Any:
        """Returns a state without codes: `act` encodes a context where it is new."""
        return ActorState(np.zeros((batch_size, 2), dtype=np.float32), None)

    def explore_from(self, seed: int) -> None:
        """Begins a new stream of exploration.

        The rate of random actions falls from the first environment to the last (Horgan et al. 2018), and so does the
        scale of the noise in the choice of actions, where an agent has such noise.
        """
        rung = np.arange(self.config.num_envs) / max(1, self.config.num_envs - 1)
        self._epsilon = self.config.epsilon_base ** (1 + self.config.epsilon_alpha * rung)
        self._noise_scale = 1.0 - rung
        self._rng = np.random.default_rng(seed)

    def rate(self, parameter: str) -> float:
        """Returns the factor of the learning rate for a parameter of the network, by its name."""
        return 1.0

    def save(self, path: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes the checkpoint that `build` reads."""
        metadata = {
            "agent": self.name,
            "config": dataclasses.asdict(self.config),
            "context_size": self.trained_size,
            "provenance": dict(provenance),
        }
        save_checkpoint(path, self.network.state_dict(), metadata)

    def load(self, path: pathlib.Path) -> None:
        """Takes over the network of a checkpoint.

        Raises:
          InputError: if the file is damaged, or another agent's.
        """
        tensors, _ = load_checkpoint(path, self.name)
        load_into(path, self.network, tensors)

    @classmethod
    def default_checkpoint(cls) -> pathlib.Path:
        """Returns the checkpoint that ships."""
        name = f"{cls.name}-{cls.shipped_size}.safetensors"
        return pathlib.Path(str(resources.files("mazebench_assets").joinpath("checkpoints", name)))

    def _explored(self, actions: np.ndarray) -> np.ndarray:
        """Returns `actions` `[B]`, some of them replaced by random ones."""
        at_random = self._rng.random(len(actions)) < self._epsilon
        return np.where(at_random, self._rng.integers(NUM_ACTIONS, size=len(actions)), actions)
