"""Settings: the tasks of evaluations."""

from __future__ import annotations

import dataclasses

from mazebench.options import options_of
from mazebench.results.records import Record, Summary
from mazebench.tasks.perturbations import Perturbations

DEFAULT_LANDMARK_DISTANCE = 5  # cells; the paper's choice wherever it varies something else
CUSTOM = "custom"  # the split of mazes that are not the benchmark's


@dataclasses.dataclass(frozen=True, order=True)
class Setting:
    """The task of results. Results of one setting are of episodes of the same kind."""

    task: str
    size: int  # N
    split: str  # "train", "dev", "eval" or "custom"
    landmark_distance: int  # cells; 0 in the local task
    perturbations: tuple[tuple[str, float], ...] = ()  # those that are switched on, with their levels
    mazes: tuple[str, ...] = ()  # names, of the split "custom"
    track: str = ""  # "" in the paper's protocol
    level: int = 0  # of the track
    cell_size: float = 1.0  # m
    # What a user set beside the mazes, in words: the size of a cell, start and goal, the noise on the senses.
    own: tuple[str, ...] = ()

    @property
    def is_exact(self) -> bool:
        """True if nothing is wrong with the map and the observed states."""
        return not self.perturbations and not self.track

    @property
    def name(self) -> str:
        """Task and size, or track and level, and the perturbations, as names of files have them."""
        levels = "".join(f"-{short_name(name)}-{level:g}" for name, level in self.perturbations)
        return (f"{self.track}-{self.level}" if self.track else f"{self.task}-{self.size}") + levels

    @property
    def place(self) -> str:
        """The name with an unusual landmark distance."""
        is_default = self.landmark_distance in (0, DEFAULT_LANDMARK_DISTANCE)
        return self.name + ("" if is_default else f"-k{self.landmark_distance}")

    def level_of(self, perturbation: str) -> float:
        """Returns the level of a perturbation; 0 if it is switched off."""
        return dict(self.perturbations).get(perturbation, 0.0)

    def without(self, perturbation: str) -> Setting:
        """Returns the setting with a perturbation switched off."""
        left = tuple(pair for pair in self.perturbations if pair[0] != perturbation)
        return dataclasses.replace(self, perturbations=left)

    def __str__(self) -> str:
        parts = [*([self.track, f"level {self.level}"] if self.track else [self.task]), f"{self.size} × {self.size}"]
        if self.split != "eval":
            parts.append(f"{self.split} mazes")
        parts += self.own
        if self.task == "hierarchical":
            parts.append(f"landmarks every {self.landmark_distance}")
        parts += [f"{level_name(name)} {level:g}" for name, level in self.perturbations]
        return ", ".join(parts)


def make_setting(summary: Summary, records: tuple[Record, ...]) -> Setting:
    """Returns the setting of an evaluation."""
    options = summary.provenance.options
    scale = (f"cells of {summary.cell_size:g} m",) if summary.cell_size else ()
    ends = (f"{name} {place}" for name, place in (("start", options.start), ("goal", options.goal)) if place)
    return Setting(
        task=summary.task,
        size=summary.size,
        split=summary.split,
        landmark_distance=options.landmark_distance if summary.task == "hierarchical" else 0,
        perturbations=tuple(sorted((name, level) for name, level in summary.perturbation.items() if level)),
        mazes=tuple(sorted({record.maze for record in records})) if summary.split == CUSTOM else (),
        track=summary.track or "",
        level=summary.level or 0,
        cell_size=summary.cell_size or 1.0,
        own=(*scale, *ends, *summary.senses),
    )


def level_name(perturbation: str) -> str:
    """Returns the name of a perturbation in words."""
    return perturbation.replace("_", " ")


def short_name(perturbation: str) -> str:
    """Returns the last word of the name of a perturbation, for names of files."""
    return perturbation.rpartition("_")[2]


def level_help(perturbation: str) -> str:
    """Returns in a sentence what a level means."""
    return options_of(Perturbations)[perturbation].help
