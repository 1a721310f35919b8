"""Distributions of SPL over episodes at each level of a perturbation: what the violin plots show."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from mazebench.report.measures import measure
from mazebench.report.results import ReportedResult
from mazebench.report.rows import chosen_episodes, common_distances, note_on_distances
from mazebench.report.settings import Setting, level_help, level_name, short_name
from mazebench.report.table import Cell
from mazebench.report.tables import perturbed_groups

GRID = np.linspace(0, 1, 41)  # where densities are given
_BANDWIDTH = 0.04  # of the Gaussian kernel, in SPL; fixed, so that 20 equal values are a narrow bump and no spike


@dataclasses.dataclass(frozen=True)
class Violin:
    """The episodes of one agent at one level."""

    density: np.ndarray  # [len(GRID)], its peak is 1
    mean: Cell


@dataclasses.dataclass(frozen=True)
class Distribution:
    """One perturbation in one setting."""

    name: str  # of its files
    title: str
    note: str
    level_name: str
    levels: tuple[float, ...]
    panels: tuple[tuple[str, tuple[Violin | None, ...]], ...]  # by agent, one violin for each level


def build_distributions(results: Sequence[ReportedResult], labels: Sequence[str]) -> list[Distribution]:
    """Returns a distribution for each perturbation and setting on the benchmark's eval mazes."""
    of_benchmark = [result for result in results if result.setting.split == "eval"]
    return [_distribution(*group, labels) for group in perturbed_groups(of_benchmark)]


def density(values: np.ndarray) -> np.ndarray:
    """Returns `[len(GRID)]`: a kernel density estimate of `values` in [0, 1], with a peak of 1."""
    mirrored = np.concatenate([values, -values, 2 - values])
    estimate = np.exp(-(((GRID[:, None] - mirrored) / _BANDWIDTH) ** 2) / 2).sum(axis=1)
    return estimate / estimate.max()


def _distribution(
    perturbation: str, base: Setting, results: Sequence[ReportedResult], labels: Sequence[str]
) -> Distribution:
    levels = sorted({result.setting.level_of(perturbation) for result in results})
    distances = common_distances(results)
    panels = []
    for label in labels:
        own = {result.setting.level_of(perturbation): result for result in results if result.label == label}
        if own:
            panels.append((label, tuple(_violin(own[level], distances) if level in own else None for level in levels)))
    return Distribution(
        name=f"violins-{short_name(perturbation)}-{base.place}",
        title=f"SPL by {level_name(perturbation)}: {base}",
        note=f"{level_help(perturbation)} {note_on_distances(results)}".strip(),
        level_name=level_name(perturbation),
        levels=tuple(levels),
        panels=tuple(panels),
    )


def _violin(result: ReportedResult, distances: Sequence[int]) -> Violin:
    chosen = chosen_episodes(result, distances)
    return Violin(density(result.episodes.spl[chosen]), measure(result, chosen)["spl"])
