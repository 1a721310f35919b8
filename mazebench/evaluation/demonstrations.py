"""Demonstrations: episodes of an agent, with what a learner may be trained on."""

from __future__ import annotations

import collections
import pathlib
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from mazebench.agent import Observation
from mazebench.errors import InputError
from mazebench.evaluation.chunk import Outcome
from mazebench.storage.array_files import read_arrays
from mazebench.storage.files import open_whole
from mazebench.tasks.rules import reward
from mazebench.tasks.task import Task

_CONTEXT, _CONTEXTS = "context", "infos/context"


class Demonstration(NamedTuple):
    """One episode.

    Those of its `arrays` that are privileged are for training; evaluations show them to no agent.
    """

    seed: int  # with which `reset` of an environment of the task begins the episode
    maze: str  # the name of the maze
    distance: int  # cells from start to goal
    arrays: dict[str, np.ndarray]  # by the names that docs/imitation.md lists, with shape and unit


class StepRecorder:
    """Records the arrays of demonstrations that follow from what is observed and done."""

    def __init__(self) -> None:
        self._noted: collections.defaultdict[int, collections.defaultdict[str, list[Any]]]
        self._noted = collections.defaultdict(lambda: collections.defaultdict(list))

    def add(self, observation: Observation, info: dict[str, Any], actions: np.ndarray, active: np.ndarray) -> None:
        """Notes a step, before it is taken."""
        for slot in np.flatnonzero(active).tolist():
            self._note(slot, {name: values[slot] for name, values in observation.items()}, info)
            self._noted[slot]["actions"].append(actions[slot].copy())

    def take(self, slot: int, observation: Observation, info: dict[str, Any]) -> dict[str, np.ndarray]:
        """Returns the arrays of the episode that ended."""
        self._note(slot, observation, info)
        return {name: np.stack(values) for name, values in self._noted.pop(slot).items()}

    def _note(self, slot: int, observation: Observation, info: dict[str, Any]) -> None:
        noted = self._noted[slot]
        for name, value in observation.items():
            if name != _CONTEXT:
                noted[f"observations/{name}"].append(value.copy())
            elif info["is_first"][slot]:
                noted[_CONTEXTS].append(value.copy())
        noted["infos/leg"].append(np.int32(info["landmark"][slot]))
        noted["infos/privileged/pose"].append(np.array([*info["position"][slot], info["yaw"][slot]]))


def make_demonstration(task: Task, outcome: Outcome) -> Demonstration:
    """Returns the demonstration of an episode whose steps `StepRecorder` has recorded; its index is its seed."""
    episode, recorded = outcome.trial.episode, outcome.recorded
    maze = task.mazes[episode.maze]
    is_last = np.arange(outcome.steps) == outcome.steps - 1
    terminations, truncations = is_last & outcome.success, is_last & (not outcome.success)
    cells = maze.cell_index(recorded["infos/privileged/pose"][:, :2])
    arrays = recorded | {
        "rewards": reward(terminations).astype(np.float32),
        "terminations": terminations,
        "truncations": truncations,
        "infos/privileged/way_left": maze.distances(episode.goal).ravel()[cells],
    }
    return Demonstration(outcome.index, maze.name, outcome.trial.distance, arrays)


def save_demonstrations(path: pathlib.Path, episodes: Sequence[Demonstration]) -> None:
    """Writes episodes, the arrays of one after those of the other; equal episodes give equal bytes.

    The arrays seed, maze, distance, num_steps (T) and num_contexts (K) have a value for each episode.
    """
    arrays = {
        "seed": np.array([episode.seed for episode in episodes]),
        "maze": np.array([episode.maze for episode in episodes]),
        "distance": np.array([episode.distance for episode in episodes]),
        "num_steps": np.array([len(episode.arrays["actions"]) for episode in episodes]),
        "num_contexts": np.array([len(episode.arrays[_CONTEXTS]) for episode in episodes]),
    }
    for name in episodes[0].arrays:
        arrays[name] = np.concatenate([episode.arrays[name] for episode in episodes])
    with open_whole(path) as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def load_demonstrations(path: pathlib.Path) -> list[Demonstration]:
    """Returns the episodes of a file of `save_demonstrations`.

    Raises:
      InputError: if the file can't be read or is damaged.
    """
    arrays = read_arrays(path, "file of demonstrations")
    try:
        seed, maze, distance, num_steps, num_contexts = (
            arrays.pop(name) for name in ("seed", "maze", "distance", "num_steps", "num_contexts")
        )
        split = {}
        for name, values in arrays.items():
            is_of_state = name.startswith(("observations/", "infos/"))
            lengths = num_contexts if name == _CONTEXTS else num_steps + is_of_state
            split[name] = np.split(values, lengths.cumsum()[:-1])
        return [
            Demonstration(*of_episode, {name: parts[i] for name, parts in split.items()})
            for i, of_episode in enumerate(zip(seed.tolist(), maze.tolist(), distance.tolist(), strict=True))
        ]
    except (KeyError, IndexError, ValueError) as error:
        raise InputError(f"{path}: expected demonstrations, found a damaged file: {error}") from error
