"""The tables of results in README.md and docs, in Markdown, by the name that a page gives."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from benchmarks.results.kept import (
    BELIEF_PLANNER,
    IN_DOUBLE_TIME,
    IN_TIME,
    NAVIGATOR,
    NO_MAP,
    PAPER,
    TRACKS_V3,
    TRUE_POSE,
    Kept,
)
from mazebench.constants import ON_TIME
from mazebench.errors import InputError
from mazebench.maps.kinds import KNOWN, NOVEL
from mazebench.report.settings import DEFAULT_LANDMARK_DISTANCE
from mazebench.report.table import escape_markdown
from mazebench.results.comparison import compare_results
from mazebench.results.intervals import Estimate, mean_interval
from mazebench.results.metrics import ON_TIME_METRICS, scores
from mazebench.results.reading import Result
from mazebench.results.records import column
from mazebench.tasks.tracks.base import LEVELS

_PRINTED_DISTANCES = (2, 4, 6, 8, 10)  # those for which the paper prints success rates
# The rows of the paper's protocol, by the report's label.
_PAPER_ROWS = {
    "random": "`random`",
    "dqn": "`dqn`, learned, no map",
    "mah-paper": "`mah-paper`, learned, model-free, closer to the paper",
    "mah": "`mah`, learned, model-free",
    "mmn": "`mmn`, after the paper: learned model and search",
    "MMN (paper)": "the paper's MMN, as printed",
    "belief-planner": "`belief-planner`, classical with a learned belief",
    "planner": "`planner`, hand-written",
    "planner-closed-loop": "`planner-closed-loop`, hand-written",
    "oracle (privileged)": "`oracle`, privileged: gets the true maze and pose",
}

_PARTS = tuple((track, level) for track in TRACKS_V3 for level in LEVELS)
_FACTORS = tuple(f"on time ({factor:g})" for factor in ON_TIME)
_NOT_LOST = "not lost"  # of tracks that are not played with the true pose, since they tell it
# The rows of v3's tables, by the agent and what it was told less or more than others.
_ROWS = {
    "oracle": "`oracle`, privileged: gets the true maze and pose",
    NAVIGATOR: "`navigator`, classical",
    NO_MAP: "`navigator` without the map",
    "navigator without map and goal": "`navigator` without map and goal",
    TRUE_POSE: "`navigator` with the true pose",
    BELIEF_PLANNER: "`belief-planner`, the same robot with a learned belief",
    "planner-closed-loop": "`planner-closed-loop`, trusts the map",
    "sb3_agent:PPOAgent": "PPO of Stable-Baselines3",
    "sb3_agent:RecurrentPPOAgent": "PPO of sb3-contrib, with an LSTM",
    "mah": "`mah`, learned, no lidar",
    "dqn": "`dqn`, learned, no map",
    "random": "`random`",
}


def make_table(kept: Kept, name: str) -> str:
    """Returns a table: one of `TABLES`, or one of the report of the suite `paper` and a metric: "paper local-13 spl".

    Raises:
      InputError: if there is no such table.
    """
    if name in TABLES:
        return TABLES[name](kept)
    suite, *of_report = name.split()
    if suite != PAPER or len(of_report) != 2 or of_report[0] not in kept.report:
        raise InputError(f"unknown table {name!r}; tables: {', '.join(TABLES)}, {PAPER} TABLE METRIC")
    return paper(kept, *of_report)


def paper(kept: Kept, name: str, metric: str) -> str:
    """Returns a metric of a table of the report of the suite `paper`."""
    header, *rows = kept.report[name].lines(metric, escape_markdown)
    return _table(header, rows)


def paper_local(kept: Kept) -> str:
    """Returns success rates by distance and in the hierarchical task, a row for each agent, and the paper's MMN."""
    local, routes = (kept.report[name] for name in ("local-13", "hierarchical-13"))
    chosen = [(local, local.rows.index(str(distance))) for distance in _PRINTED_DISTANCES]
    chosen.append((routes, routes.rows.index(str(DEFAULT_LANDMARK_DISTANCE))))
    labels = [label for label in _PAPER_ROWS if label in {column.label for column in local.columns}]

    def cells(label: str) -> Iterator[str]:
        for table, row in chosen:
            (column,) = (column for column in table.columns_of("success_rate") if column.label == label)
            yield str(column.cells["success_rate"][row] or "")

    header = ["agent", *map(str, _PRINTED_DISTANCES), "hierarchical"]
    return _table(header, [[_PAPER_ROWS[label], *cells(label)] for label in labels])


def v3_rows(metric: str, kept: Kept) -> str:
    """Returns a metric of all agents on v3."""
    played = {row for row, _ in kept.results}
    rows = [
        [description, *(_levels(kept, row, track, metric) for track in TRACKS_V3)]
        for row, description in _ROWS.items()
        if row in played
    ]
    return _table(["agent", *map(_code, TRACKS_V3)], rows)


def v3_map_worth(kept: Kept) -> str:
    """Returns the navigator's headline numbers with their intervals, and what the map is worth to it."""
    rows = []
    for track, level in _PARTS:
        navigator, without = (kept.results[row, f"{track}-{level}"] for row in (NAVIGATOR, NO_MAP))
        worth = compare_results(navigator, without).overall.metrics[IN_TIME].difference
        figures = [_estimate(navigator, metric) for metric in ("success_rate", IN_DOUBLE_TIME, IN_TIME)]
        rows.append([f"`{track}` {level}", *map(_interval, [*figures, _estimate(without, IN_TIME), worth])])
    return _table(["part", "success", *reversed(_FACTORS), "the same without the map", "map worth"], rows)


def v3_belief_planner(kept: Kept) -> str:
    """Returns belief-planner's numbers and its paired differences to the navigator."""
    rows = []
    for track, level in _PARTS:
        ours, theirs = (kept.results[row, f"{track}-{level}"] for row in (BELIEF_PLANNER, NAVIGATOR))
        paired = compare_results(ours, theirs).overall.metrics
        numbers = [_number(paired[metric].a) for metric in ("success_rate", *ON_TIME_METRICS)]
        differences = [_interval(paired[metric].difference) for metric in ("success_rate", IN_TIME, "spl")]
        rows.append([f"`{track}` {level}", *numbers, *differences])
    return _table(["part", "success", *_FACTORS, "less `navigator`, success", _FACTORS[0], "SPL"], rows)


def v3_novel_kinds(kept: Kept) -> str:
    """Returns what the two robots reach in the kinds that they could know, and in those that are in eval alone."""
    rows = [
        [
            *map(_code, (track, row)),
            *(
                _levels(kept, row, track, *each)
                for each in itertools.product(("success_rate", IN_TIME), (KNOWN, NOVEL))
            ),
        ]
        for track in TRACKS_V3
        for row in (NAVIGATOR, BELIEF_PLANNER)
    ]
    header = ["track", "agent", "success, known kinds", "novel kinds", f"{_FACTORS[0]}, known kinds", "novel kinds"]
    return _table(header, rows)


def v3_navigator(kept: Kept) -> str:
    """Returns the navigator's numbers on v3."""
    metrics = ("success_rate", *ON_TIME_METRICS, "spl")
    rows = [[_code(track), *(_levels(kept, NAVIGATOR, track, metric) for metric in metrics)] for track in TRACKS_V3]
    return _table(["track", "success", *_FACTORS, "SPL"], rows)


def v3_navigator_kinds(kept: Kept) -> str:
    """Returns the navigator's share on time in each kind of maze."""
    kinds = (*KNOWN, *NOVEL)
    rows = [
        [_code(track), *(_levels(kept, NAVIGATOR, track, IN_TIME, (kind,)) for kind in kinds)] for track in TRACKS_V3
    ]
    return _table(["track", *map(_code, kinds)], rows)


# By the name that a page gives.
TABLES: dict[str, Callable[[Kept], str]] = {
    "paper-local": paper_local,
    "v3-success": functools.partial(v3_rows, "success_rate"),
    "v3-on-time": functools.partial(v3_rows, IN_TIME),
    "v3-on-time-2": functools.partial(v3_rows, IN_DOUBLE_TIME),
    "v3-map-worth": v3_map_worth,
    "v3-belief-planner": v3_belief_planner,
    "v3-novel-kinds": v3_novel_kinds,
    "v3-navigator": v3_navigator,
    "v3-navigator-kinds": v3_navigator_kinds,
}


def _levels(kept: Kept, row: str, track: str, metric: str, kinds: Sequence[str] = ()) -> str:
    """Returns the means of a metric at the levels of a track, of all kinds of mazes or of some."""
    numbers = []
    for level in LEVELS:
        result = kept.results.get((row, f"{track}-{level}"))
        if result is None:
            return _NOT_LOST
        values = scores(result.records, result.oracle_steps)[metric]
        if kinds:
            values = values[np.isin(column(result.records, "kind"), kinds)]
        numbers.append(_number(float(values.mean())))
    return " / ".join(numbers)


def _estimate(result: Result, metric: str) -> Estimate:
    return mean_interval(scores(result.records, result.oracle_steps)[metric], column(result.records, "maze"))


def _interval(estimate: Estimate) -> str:
    return f"{_number(estimate.value)} [{_number(estimate.low)}, {_number(estimate.high)}]"


def _number(value: float) -> str:
    return f"{value:.2f}".replace("-0.00", "0.00")


def _code(text: str) -> str:
    return f"`{text}`"


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Returns a table in Markdown."""
    return "".join(f"| {' | '.join(line)} |\n" for line in (header, ["---"] * len(header), *rows))
