"""Two evaluations on the same episodes: of two agents, or of one agent at two levels of a track.

docs/metrics.md has the definitions.

`E` is the number of episodes.
"""

from __future__ import annotations

import dataclasses
import itertools
import pathlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from mazebench.errors import InputError
from mazebench.results.intervals import Estimate, difference_interval
from mazebench.results.metrics import by_distance, by_fact, scores
from mazebench.results.naming import noise_in_words, title_of
from mazebench.results.reading import Result, find_parts, load_result
from mazebench.results.records import Record, Summary, column

# What must be equal, of tasks, of their provenance and of records: what was played, whatever was shown.
_SAME_TASK = ("benchmark", "task", "size", "cell_size", "split_in_results", "num_goals")
_SAME_PROVENANCE = ("benchmark_manifest_sha256", "mazes_sha256")
_ENOUGH = 20  # episodes of a bin of distances
_SAME_EPISODE = ("maze", "start", "goal", "seed", "distance")


@dataclasses.dataclass(frozen=True)
class Paired:
    """One metric of both evaluations."""

    a: float
    b: float
    difference: Estimate  # a - b


@dataclasses.dataclass(frozen=True)
class Row:
    """Two evaluations on the same episodes."""

    num_episodes: int  # of several goals, the legs
    metrics: dict[str, Paired]  # by the names of `metrics.scores`
    win_share: Estimate  # of episodes in which A's SPL is higher than B's; a tie counts half


@dataclasses.dataclass(frozen=True)
class PairedResults:
    """Two evaluations on the same episodes."""

    overall: Row
    by_distance: dict[int, Row]  # by distance from start to goal: in cells, on tracks in metres
    by_fact: dict[str, Row] = dataclasses.field(default_factory=dict)  # "blocked" and "not blocked", on tracks
    by_bin: dict[str, Row] = dataclasses.field(default_factory=dict)  # of distances with enough episodes, in words


@dataclasses.dataclass(frozen=True)
class Comparison:
    """Two folders of results."""

    title: str  # who is A and who is B
    parts: dict[str, PairedResults]  # by part of a suite; two single evaluations have the one part ""
    has_distances: bool  # whether a table by distance makes sense
    notes: list[str]  # on parts that only one folder has
    worth: str = ""  # which difference of the on-time rates is a map worth, in words


def compare_folders(a: pathlib.Path, b: pathlib.Path) -> Comparison:
    """Compares two evaluations, or two runs of a suite part by part.

    Raises:
      InputError: if a folder holds no results, they are damaged, or don't pair.
    """
    a_parts, b_parts = find_parts(a), find_parts(b)
    common = [name for name in a_parts if name in b_parts]
    if not common:
        ours, theirs = (", ".join(name or "a single evaluation" for name in parts) for parts in (a_parts, b_parts))
        raise InputError(f"expected results of the same parts, found {ours} in {a} and {theirs} in {b}")
    notes = [
        f"{folder}: {', '.join(only)} not in the other folder; left out"
        for folder, parts in ((a, a_parts), (b, b_parts))
        if (only := [name for name in parts if name not in common])
    ]
    pairs = {name: (load_result(a_parts[name]), load_result(b_parts[name])) for name in common}
    first, second = (result.summary for result in pairs[common[0]])
    task = first.task
    title = f"A is {_who(first, common)} in {a}, B is {_who(second, common)} in {b}"
    title += f"; {title_of(task)}, {task.split_in_results} mazes {task.size} x {task.size}" if common == [""] else ""
    return Comparison(
        title=title,
        parts={name: compare_results(*pair) for name, pair in pairs.items()},
        has_distances=not task.is_hierarchical,
        notes=notes,
        worth=_worth(first, second),
    )


def compare_results(a: Result, b: Result) -> PairedResults:
    """Compares two evaluations over all episodes and by distance.

    Of several goals, each leg is a pair. Legs that one of the two began elsewhere, after a missed goal, are left out.

    Raises:
      InputError: if the two are not of the same episodes of one version of the benchmark.
    """
    pairs = paired_records(a, b)
    of_ours, of_theirs = zip(*pairs, strict=True)
    ours, theirs = by_distance(of_ours), by_distance(of_theirs)
    at = {distance: list(zip(ours[distance], theirs[distance], strict=True)) for distance in ours}
    facts = {name: holds for name, holds in by_fact(of_ours).items() if name.removeprefix("not ") == "blocked"}
    unit = "cells" if a.summary.task.track is None else "m"
    return PairedResults(
        overall=compare_records(pairs),
        by_distance={distance: compare_records(own) for distance, own in at.items()},
        by_fact={
            name: compare_records(itertools.compress(pairs, holds)) for name, holds in facts.items() if holds.any()
        },
        by_bin={f"{name} {unit}": compare_records(own) for name, own in _bins(at).items()},
    )


def _bins(at: dict[int, list[tuple[Record, Record]]]) -> dict[str, list[tuple[Record, Record]]]:
    """Returns the pairs of neighbouring distances with enough episodes, such as "15-17"; none for a single bin."""
    bins: list[tuple[list[int], list[tuple[Record, Record]]]] = []
    for distance, own in at.items():
        if not bins or len(bins[-1][1]) >= _ENOUGH:
            bins.append(([], []))
        bins[-1][0].append(distance)
        bins[-1][1].extend(own)
    if len(bins) > 1 and len(bins[-1][1]) < _ENOUGH:
        distances, own = bins.pop()
        bins[-1][0].extend(distances)
        bins[-1][1].extend(own)
    named = {"-".join(map(str, dict.fromkeys((each[0], each[-1])))): own for each, own in bins}
    return named if len(named) > 1 else {}


def paired_records(a: Result, b: Result, *, of_one_map: bool = True) -> list[tuple[Record, Record]]:
    """Returns the records of the same episodes or legs of two evaluations; raises as `compare_results` does.

    Unless both are `of_one_map`, other older maps may have been shown.
    """
    for key in (*_SAME_TASK, *_SAME_PROVENANCE):
        of_a, of_b = (
            getattr(result.summary.provenance if key in _SAME_PROVENANCE else result.summary.task, key)
            for result in (a, b)
        )
        if of_a != of_b and (of_one_map or key != "mazes_sha256"):
            raise InputError(
                f"expected results of one {key.removesuffix('_in_results')} to compare, "
                f"found {str(of_a)[:80]} in {a.folder} and {str(of_b)[:80]} in {b.folder}"
            )
    same = f"expected the same episodes in {a.folder} and {b.folder}, found"
    if len(a.records) != len(b.records):
        raise InputError(f"{same} {len(a.records)} and {len(b.records)} of them")
    both = zip(a.records, b.records, strict=True)
    pairs = [pair for pair in both if not any(record.after_missed_goal for record in pair)]
    of_ours, of_theirs = zip(*pairs, strict=True)
    for name in _SAME_EPISODE:
        of_a, of_b = column(of_ours, name), column(of_theirs, name)
        differs = (of_a != of_b).reshape(len(of_a), -1).any(axis=1)
        if differs.any():
            first = int(differs.argmax())
            raise InputError(
                f"{same} episode {of_ours[first].episode} with {name} {of_a[first].tolist()} and {of_b[first].tolist()}"
            )
    return pairs


def to_json(comparison: Comparison) -> dict[str, Any]:
    """Returns what `mazebench compare --json` prints: of a suite by part, of two single evaluations without a part.

    Returns:
      dict: {"overall": {"n", "win_share", "win_share_ci95", and of each metric M of `metrics.scores`
       "M_a", "M_b", "M_difference" and "M_difference_ci95"}, "by_distance": {"1": {the same}, ...},
       "by_fact": {"blocked": {the same}, ...}}
    """
    parts = {
        name: {
            "overall": _row_to_json(part.overall),
            "by_distance": {str(distance): _row_to_json(row) for distance, row in part.by_distance.items()},
            "by_fact": {name: _row_to_json(row) for name, row in part.by_fact.items()},
        }
        for name, part in comparison.parts.items()
    }
    return parts.get("", parts)


def compare_records(pairs: Iterable[tuple[Record, Record]]) -> Row:
    """Returns the row of some records of two evaluations, which pair."""
    a, b = zip(*pairs, strict=True)
    mazes = column(a, "maze")
    ours, theirs = scores(a), scores(b)
    metrics = {
        metric: Paired(
            a=float(ours[metric].mean()),
            b=float(theirs[metric].mean()),
            difference=difference_interval(ours[metric] - theirs[metric], mazes),
        )
        for metric in ours
        if metric in theirs
    }
    # Won is 1, lost is -1 and a tie 0: the share of wins is half of their mean, and a half.
    outcome = difference_interval(np.sign(ours["spl"] - theirs["spl"]), mazes)
    win_share = Estimate(*(0.5 + share / 2 for share in (outcome.value, outcome.low, outcome.high)))
    return Row(len(a), metrics, win_share)


def _row_to_json(row: Row) -> dict[str, Any]:
    content: dict[str, Any] = {"n": row.num_episodes}
    for metric, paired in row.metrics.items():
        difference = paired.difference
        content |= {f"{metric}_a": paired.a, f"{metric}_b": paired.b}
        content |= {f"{metric}_difference": difference.value}
        content |= {f"{metric}_difference_ci95": [difference.low, difference.high]}
    win_share = row.win_share
    return content | {"win_share": win_share.value, "win_share_ci95": [win_share.low, win_share.high]}


def _worth(a: Summary, b: Summary) -> str:
    """Returns which difference of the on-time rates is a map worth; empty if none is."""
    shown, hidden = [(), ("map",)], [each.task.hide for each in (a, b)]
    if (a.agent, a.config) != (b.agent, b.config) or hidden not in (shown, shown[::-1]):
        return ""
    return f"{'A - B' if hidden == shown else 'B - A'}, on time: the map worth of {a.agent}"


def _who(summary: Summary, parts: list[str]) -> str:
    """Returns the agent's row and, for a single evaluation, its track and level or its perturbations."""
    task = summary.task
    wrong = [*(f"{key} {value}" for key, value in task.perturbations.items() if value), *noise_in_words(task)]
    if task.track is not None:
        wrong.insert(0, f"track {title_of(task).replace(' ', ', level ', 1)}")
    return summary.row + (f" ({', '.join(wrong)})" if wrong and parts == [""] else "")
