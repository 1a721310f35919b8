"""How SPL is spread over episodes, as the strength of a perturbation grows: what the violin plots show."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from mazebench.report.results import Result
from mazebench.report.table import Cell
from mazebench.report.tables import LEVEL_NAMES, chosen_episodes, common_distances, format_distances, levels_of, measure

METRIC = "spl"
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
    panels: tuple[tuple[str, tuple[Violin | None, ...]], ...]  # by agent, a violin a level


def build_distributions(results: Sequence[Result], labels: Sequence[str]) -> list[Distribution]:
    """A distribution for each flip and noise experiment on the benchmark's eval mazes."""
    of_benchmark = [result for result in results if result.setting.split == "eval"]
    return [
        _distribution(perturbation, str(base), f"{base.task}-{base.size}-k{base.landmark_distance}", group, labels)
        for perturbation in ("map_flip", "position_noise")
        for base, group in levels_of(of_benchmark, perturbation)
    ]


def density(values: np.ndarray) -> np.ndarray:
    """`[len(GRID)]` with a peak of 1: a kernel estimate of the spread of `values` in [0, 1], reflected."""
    mirrored = np.concatenate([values, -values, 2 - values])
    estimate = np.exp(-(((GRID[:, None] - mirrored) / _BANDWIDTH) ** 2) / 2).sum(axis=1)
    return estimate / estimate.max()


def _distribution(
    perturbation: str, base: str, place: str, results: Sequence[Result], labels: Sequence[str]
) -> Distribution:
    levels = sorted({getattr(result.setting, perturbation) for result in results})
    distances = common_distances(results)
    panels = []
    for label in labels:
        at_level = {getattr(result.setting, perturbation): result for result in results if result.label == label}
        if at_level:
            violins = [_violin(at_level[level], distances) if level in at_level else None for level in levels]
            panels.append((label, tuple(violins)))
    kind = perturbation.removeprefix("map_").removeprefix("position_")
    return Distribution(
        name=f"violins-{kind}-{place.removesuffix('-k0').removesuffix('-k5')}",
        title=f"SPL by {LEVEL_NAMES[perturbation].partition(' (')[0]}: {base}",
        note=f"Distances {format_distances(distances)}." if distances else "",
        level_name=LEVEL_NAMES[perturbation],
        levels=tuple(levels),
        panels=tuple(panels),
    )


def _violin(result: Result, distances: Sequence[int]) -> Violin:
    chosen = chosen_episodes(result, distances)
    return Violin(density(result.episodes.values(METRIC)[chosen]), measure(result, chosen)[METRIC])
