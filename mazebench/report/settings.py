"""Settings: what was played in an evaluation."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from mazebench.errors import unknown
from mazebench.evaluation.records import Record, Summary
from mazebench.maps.benchmark import SIZES, SPLITS
from mazebench.options import options_of
from mazebench.tasks.options import TaskOptions
from mazebench.tasks.perturbations import Perturbations

DEFAULT_LANDMARK_DISTANCE = 5  # cells; the paper's choice wherever it varies something else
_CUSTOM = "custom"  # the split of mazes that are not the benchmark's


@dataclasses.dataclass(frozen=True, order=True)
class Setting:
    """What was played. Results of one setting are of episodes of the same kind."""

    task: str
    size: int  # N
    split: str  # "train", "eval" or "custom"
    landmark_distance: int  # cells; 0 in the local task
    levels: tuple[tuple[str, float], ...] = ()  # of the perturbations that are switched on, by name
    mazes: tuple[str, ...] = ()  # names, of the split "custom"

    @property
    def perturbed(self) -> tuple[str, ...]:
        """The names of the perturbations that are switched on."""
        return tuple(name for name, _ in self.levels)

    @property
    def place(self) -> str:
        """Task, size and an unusual landmark distance, as names of files have them."""
        is_default = self.landmark_distance in (0, DEFAULT_LANDMARK_DISTANCE)
        return f"{self.task}-{self.size}" + ("" if is_default else f"-k{self.landmark_distance}")

    def level(self, perturbation: str) -> float:
        """Returns the level of a perturbation; 0 if it is switched off."""
        return dict(self.levels).get(perturbation, 0.0)

    def without(self, perturbation: str) -> Setting:
        """Returns the setting with a perturbation switched off."""
        return dataclasses.replace(self, levels=tuple(pair for pair in self.levels if pair[0] != perturbation))

    def __str__(self) -> str:
        parts = [self.task, f"{self.size} × {self.size}"]
        if self.split != "eval":
            parts.append(f"{self.split} mazes")
        if self.task == "hierarchical":
            parts.append(f"landmarks every {self.landmark_distance}")
        parts += [f"{level_name(name)} {level:g}" for name, level in self.levels]
        return ", ".join(parts)


def make_setting(summary: Summary, records: tuple[Record, ...]) -> Setting:
    """Returns the setting of an evaluation.

    Raises:
      InputError: if this version of the benchmark has no such task, size, split or level.
    """
    TaskOptions(task=summary.task, **known_levels(summary.perturbation))  # raises if one of them is not allowed
    if summary.split not in (*SPLITS, _CUSTOM):
        raise unknown("split", summary.split, (*SPLITS, _CUSTOM))
    if summary.split in SPLITS and summary.size not in SIZES:
        raise unknown("size", summary.size, SIZES)
    return Setting(
        task=summary.task,
        size=summary.size,
        split=summary.split,
        landmark_distance=summary.provenance.options.landmark_distance if summary.task == "hierarchical" else 0,
        levels=tuple(sorted((name, level) for name, level in summary.perturbation.items() if level)),
        mazes=tuple(sorted({record.maze for record in records})) if summary.split == _CUSTOM else (),
    )


def known_levels(levels: Mapping[str, float]) -> dict[str, Any]:
    """Returns the levels of those perturbations that this version of the package has."""
    return {name: level for name, level in levels.items() if name in options_of(Perturbations)}


def level_name(perturbation: str) -> str:
    """Returns the name of a perturbation in words."""
    return perturbation.replace("_", " ")


def short_name(perturbation: str) -> str:
    """Returns the last word of the name of a perturbation, for names of files."""
    return perturbation.rpartition("_")[2]


def level_help(perturbation: str) -> str:
    """Returns in a sentence what a level means; nothing for a perturbation that this version does not have."""
    found = options_of(Perturbations).get(perturbation)
    return "" if found is None else found.help
