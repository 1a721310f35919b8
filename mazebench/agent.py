"""What an agent is, and how agents are found: its protocol, and the entry points `mazebench.agents`.

`B` is the number of environments an agent acts in at once, `M` the side of the context's planes.
"""

from __future__ import annotations

import dataclasses
import importlib
import pathlib
import sys
import traceback
from collections.abc import Mapping, Sequence
from importlib import metadata
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.maps.maze import Maze

if TYPE_CHECKING:
    from mazebench.training.experience import Experience

ENTRY_POINT_GROUP = "mazebench.agents"
_IMPORTLIB = pathlib.Path(importlib.__file__).parent

Observation = dict[str, np.ndarray]  # "state" [B, 12] float32, "context" [B, 4, M, M] float32


@dataclasses.dataclass(frozen=True)
class Interface:
    """What an agent is told of the environments it will act in, before it is built."""

    task: str  # "local" or "hierarchical"
    size: int  # N, the cells a side of the mazes
    context_size: int  # M
    num_actions: int = 6


@runtime_checkable
class Agent(Protocol):
    """Acts in `B` environments at once.

    A class named by an entry point is built by `build(interface, seed=..., checkpoint=...)`. Two more methods are
    called where they exist: the class's `context_size(size) -> int`, for an agent that needs another M than
    min(N, 21), and `seed_episodes(seeds, mask)`, for one that draws random numbers or must tell an episode's beginning
    from a landmark's. It is called before each `act` in which `is_first` is set anywhere: `mask` `[B]` bool says where
    an episode begins, `seeds` `[B]` int are the episodes', so that draws belong to the episode and not to its slot. And
    `default_checkpoint() -> Path` of the class names the file that `build` reads if it is given none. Where the class
    has `measure(seconds) -> dict[str, list[dict[str, Any]]]`, `mazebench bench` adds the tables that it returns: rows
    by title, a row's values by column, the first of which is "what". Each figure should take about so many seconds.
    """

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Agent:
        """A new agent; `checkpoint` is for those that learn, None stands for the trained one that ships."""

    def initial_state(self, batch_size: int) -> Any:
        """Whatever the agent carries from step to step in `batch_size` environments."""

    def act(
        self, observation: Observation, is_first: np.ndarray, state: Any, explore: bool = False
    ) -> tuple[np.ndarray, Any]:
        """Actions `[B]` int and the next state.

        Args:
          observation: "state" `[B, 12]` and "context" `[B, 4, M, M]` float32, owned by the caller.
          is_first: `[B]` bool, where the context is new: an episode or the leg to the next landmark begins.
          state: what the last call returned, or `initial_state`.
          explore: whether to act as in training; evaluation never does.
        """


@runtime_checkable
class ExploringAgent(Agent, Protocol):
    """An agent as it collects experience to learn from, in this process or on another machine."""

    def explore_from(self, first_env: int, num_envs: int, seed: int) -> None:
        """Explores from now on as the environments `first_env` to `first_env + num_envs` of all, by a new stream."""

    def parameters(self) -> dict[str, np.ndarray]:
        """What it has learned, to be given to another by `set_parameters`."""

    def set_parameters(self, parameters: dict[str, np.ndarray]) -> None:
        """Takes over what another has learned."""


@runtime_checkable
class LearningAgent(Protocol):
    """What the training loop needs beside acting. A class that has `build_learner` can be trained."""

    num_envs: int  # B, environments to collect in
    actor: ExploringAgent  # acts with what is learned so far

    @classmethod
    def build_learner(
        cls, interface: Interface, mazes: Sequence[Maze], *, seed: int = 0, overrides: Mapping[str, str] | None = None
    ) -> LearningAgent:
        """A new learner; `overrides` are config values as text, by name, and an unknown one is an `InputError`."""

    def config(self) -> dict[str, Any]:
        """All values that the learner was built with, as plain data."""

    def description(self) -> str:
        """One line for people: the size of the network, and of the memory that its replay will take."""

    def task_options(self) -> dict[str, Any]:
        """The options of `make_spec` that it wants to collect with."""

    def observe(self, experience: Experience, first_env: int = 0) -> None:
        """Remembers one step in the environments from `first_env` on."""

    def num_updates_due(self, env_steps: int) -> int:
        """How many updates should have been made after `env_steps` agent steps: the replay ratio is fixed."""

    def update(self) -> dict[str, float]:
        """Learns from one batch; returns losses and other scalars by name."""

    def save(self, folder: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes all it needs to go on exactly as it would have, and `agent.safetensors`, what acting alone needs."""

    def load(self, folder: pathlib.Path) -> None:
        """Goes on from what `save` wrote; without the replay, which may be gone, it must first be filled again."""


def agent_names() -> list[str]:
    """The names of all installed agents."""
    return sorted(_entry_points())


def load_agent_class(name: str) -> type[Agent]:
    """The class of an installed agent, or of `module:Class` for a module at hand (the working directory included).

    Raises:
      InputError: if there is no such agent, or it can't be imported; the message says what to install.
    """
    if ":" in name:
        return _class_at_hand(name)
    entry_points = _entry_points()
    if name not in entry_points:
        raise unknown("agent", name, entry_points)
    try:
        loaded = entry_points[name].load()
    except ModuleNotFoundError as error:
        raise InputError(
            f"agent {name!r} needs the module {error.name!r}, which is not installed; "
            "the extra [agents] brings it (docs/start.md)"
        ) from error
    except Exception as error:  # other people's modules may raise anything
        raise _unimportable(name, error) from error
    return _checked(name, loaded)


def place_of(error: BaseException) -> str:
    """Where in an agent's own files `error` arose, as " (FILE:LINE)"; empty if the agent was not even entered."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if not _is_no_agents(frame.filename)]
    if not frames:
        return ""
    # Below what the agent calls are libraries.
    folder = pathlib.Path(frames[0].filename).parent
    last = [frame for frame in frames if folder in pathlib.Path(frame.filename).parents][-1]
    return f" ({pathlib.Path(last.filename).name}:{last.lineno})"


def _is_no_agents(filename: str) -> bool:
    ours = pathlib.Path(__file__).parent
    return filename.startswith("<") or not {ours, _IMPORTLIB}.isdisjoint(pathlib.Path(filename).parents)


def _class_at_hand(name: str) -> type[Agent]:
    module_name, _, class_name = name.partition(":")
    if module_name.endswith(".py"):
        wanted = f"{module_name.removesuffix('.py').replace('/', '.')}:{class_name}"
        raise InputError(f"agent {name!r}: expected module:Class, such as {wanted}, found a file's name")
    if "" not in sys.path and "." not in sys.path:
        sys.path.insert(0, "")
    try:
        loaded = getattr(importlib.import_module(module_name), class_name)
    except (ImportError, AttributeError, ValueError, TypeError) as error:
        said = f"{error}{place_of(error)}"
        raise InputError(f"agent {name!r}: expected module:Class that can be imported, found: {said}") from error
    except Exception as error:
        raise _unimportable(name, error) from error
    return _checked(name, loaded)


def _unimportable(name: str, error: Exception) -> InputError:
    said = f"{type(error).__name__}: {error}{place_of(error)}"
    return InputError(f"agent {name!r}: its module can't be imported: {said}")


def _checked(name: str, loaded: Any) -> type[Agent]:
    missing = [method for method in ("build", "initial_state", "act") if not callable(getattr(loaded, method, None))]
    if missing:
        raise InputError(f"agent {name!r}: expected a class with build, initial_state and act, found no {missing[0]}")
    return loaded


def _entry_points() -> dict[str, metadata.EntryPoint]:
    """By name; two distributions that claim one name are refused."""
    found: dict[str, metadata.EntryPoint] = {}
    for entry_point in metadata.entry_points(group=ENTRY_POINT_GROUP):
        known = found.setdefault(entry_point.name, entry_point)
        if known.value != entry_point.value:
            raise InputError(
                f"two agents are called {entry_point.name!r}: {known.value} of {_distribution(known)} "
                f"and {entry_point.value} of {_distribution(entry_point)}; uninstall one"
            )
    return found


def _distribution(entry_point: metadata.EntryPoint) -> str:
    return entry_point.dist.name if entry_point.dist else "an unknown distribution"
