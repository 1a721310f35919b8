"""Parts of a suite that are summed up together: one evaluation for each building, one row for each setting."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence

from mazebench.results.comparison import Row, compare_records, paired_records
from mazebench.results.metrics import summarize
from mazebench.results.reading import Result
from mazebench.results.records import Summary

OF = "--"  # in the name of a part, between its group and the building
WITHOUT_MAP, WITH_RIGHT_MAP = "-no-map", "-right-map"  # end the names of groups in which another map is shown


def group_of(part: str) -> str:
    """Returns the group of a part; a part without one is a group of its own."""
    return part.partition(OF)[0]


def summarize_groups(results: Sequence[Result]) -> list[Summary]:
    """Returns the summaries of an agent's results, of each group one: over all episodes, with intervals over mazes."""
    summaries = []
    for group, members in _groups(results).items():
        first = members[0].summary
        if first.part == group:
            summaries.append(first)
            continue
        records = list(itertools.chain.from_iterable(each.records for each in members))
        counts = sum((Counter(each.summary.counts) for each in members), Counter())
        told = {"part": group, "episodes": len(records), "counts": dict(counts)}
        # What is read back is checked; these values come from what was.
        summaries.append(Summary.model_validate(dict(first) | told | summarize(records)))
    return summaries


def compare_maps(results: Sequence[Result]) -> dict[str, Row]:
    """Returns what one map is worth more than another in the same episodes of an agent, in words.

    The right map is compared with the older one that is shown, and the map that is shown with none.
    """
    groups = _groups(results)
    rows = {}
    for group in groups:
        pairs = (("right map - old map", group + WITH_RIGHT_MAP, group), ("map - no map", group, group + WITHOUT_MAP))
        for words, a, b in pairs:
            ours, theirs = ({_building(each): each for each in groups.get(name, ())} for name in (a, b))
            shared = [name for name in ours if name in theirs]
            both = [paired_records(ours[name], theirs[name], of_one_map=False) for name in shared]
            if both:
                rows[f"{group}, {words}"] = compare_records(itertools.chain.from_iterable(both))
    return rows


def _groups(results: Sequence[Result]) -> dict[str, list[Result]]:
    groups: dict[str, list[Result]] = {}
    for result in results:
        groups.setdefault(group_of(str(result.summary.part)), []).append(result)
    return groups


def _building(result: Result) -> str:
    return str(result.summary.part).partition(OF)[2]
