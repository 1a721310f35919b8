"""Results as the report uses them, told apart.

`E` is the number of episodes of a result.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Callable
from typing import Any

import numpy as np

from mazebench.errors import InputError
from mazebench.evaluation.trajectories import Trajectories

METRICS = {"success_rate": "success rate", "spl": "SPL", "spl_grid": "SPL by grid distance"}
PERTURBATIONS = ("map_flip", "map_warp", "position_noise")

# Called with a line of text about something that was skipped or mended.
Warn = Callable[[str], None]


@dataclasses.dataclass(frozen=True, order=True)
class Setting:
    """What was played. Results of one setting are of the same kind of episodes."""

    task: str
    size: int  # N
    split: str
    landmark_distance: int  # cells; 0 in the local task
    map_flip: float
    map_warp: float
    position_noise: float  # m
    mazes: tuple[str, ...] = ()  # of the split "custom", whose mazes are not the benchmark's

    @property
    def perturbed(self) -> tuple[str, ...]:
        """The names of the perturbations in force."""
        return tuple(name for name in PERTURBATIONS if getattr(self, name))

    def __str__(self) -> str:
        parts = [self.task, f"{self.size} × {self.size}"]
        if self.split != "eval":
            parts.append(f"{self.split} mazes")
        if self.task == "hierarchical":
            parts.append(f"landmarks every {self.landmark_distance}")
        parts += [f"{name.replace('_', ' ')} {getattr(self, name):g}" for name in self.perturbed]
        return ", ".join(parts)


@dataclasses.dataclass(frozen=True)
class Episodes:
    """The records of a result, in columns."""

    maze: np.ndarray  # [E] int, index among `mazes`
    mazes: tuple[str, ...]  # names, in the order in which they come up
    start: np.ndarray  # [E, 2] int, cells
    goal: np.ndarray  # [E, 2] int
    distance: np.ndarray  # [E] int, cells
    success: np.ndarray  # [E] bool
    steps: np.ndarray  # [E] int
    path_length: np.ndarray  # [E] m
    shortest_path: np.ndarray  # [E] m
    spl: np.ndarray  # [E]
    spl_grid: np.ndarray  # [E]
    seed: np.ndarray  # [E] int

    def __len__(self) -> int:
        return len(self.success)

    def values(self, metric: str) -> np.ndarray:
        """`[E]` float: what a metric is the mean of."""
        return self.success.astype(np.float64) if metric == "success_rate" else getattr(self, metric)


@dataclasses.dataclass(frozen=True)
class Result:
    """One evaluation folder that held what it should."""

    path: pathlib.Path
    agent: str
    label: str  # the agent's name in the report, with more where the name alone is ambiguous
    setting: Setting
    seed: int
    checkpoint: str | None  # SHA-256
    benchmark: tuple[str, str]  # version and SHA-256 of the manifest
    episodes: Episodes
    trajectories: Trajectories | None
    provenance: dict[str, Any]


def label_results(results: list[Result]) -> list[Result]:
    """The results with labels under which no two agents go: where names are equal, with checkpoint or seed."""
    labelled = []
    for result in results:
        namesakes = [other for other in results if other.agent == result.agent]
        label = result.agent
        if len({other.checkpoint for other in namesakes}) > 1:
            label += f" {result.checkpoint[:6]}" if result.checkpoint else " without checkpoint"
        if len({other.seed for other in namesakes}) > 1:
            label += f" seed {result.seed}"
        labelled.append(dataclasses.replace(result, label=label))
    return labelled


def drop_repeats(results: list[Result], warn: Warn) -> list[Result]:
    """One result for each agent and setting: of several the one with the most episodes, the first of equals."""
    kept: dict[tuple[str, Setting], Result] = {}
    for result in results:
        other = kept.setdefault((result.label, result.setting), result)
        if other is result:
            continue
        more, less = (result, other) if len(result.episodes) > len(other.episodes) else (other, result)
        warn(f"{less.path}: {less.label}, {less.setting} again, as in {more.path}; skipped")
        kept[result.label, result.setting] = more
    return list(kept.values())


def require_one_benchmark(results: list[Result], installed: tuple[str, str]) -> None:
    """Does nothing if all results are of the installed benchmark (version and SHA-256 of its manifest).

    Raises:
      InputError: if they are not; the message says which is which.
    """
    folders: dict[tuple[str, str], list[str]] = {}
    for result in results:
        folders.setdefault(result.benchmark, []).append(str(result.path))
    foreign = [version for version in folders if version != installed]
    if not foreign:
        return
    which = "; ".join(f"{_name(version)}: {_listing(folders[version])}" for version in sorted(folders))
    kind = "results of different benchmarks can't be reported together" if len(folders) > 1 else "another benchmark"
    raise InputError(f"{kind}: expected {_name(installed)}, found {which}")


def _name(version: tuple[str, str]) -> str:
    return f"{version[0][:40]!r} (manifest {version[1][:8] or 'unknown'})"


def _listing(names: list[str], most: int = 5) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
