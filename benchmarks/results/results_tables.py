"""The tables of results in README.md and docs, in Markdown, by the name that a page gives."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from benchmarks.results.kept import (
    LEARNED,
    LOCAL,
    NAVIGATOR,
    NO_MAP,
    ON_TIME_2,
    ON_TIME_125,
    PAPER,
    PATHS,
    RANDOM,
    REWARDED,
    REWARDED_BUILDING,
    TRUE_POSE,
    WAYS,
    Kept,
    estimate,
    mean_estimate,
)
from mazebench.errors import InputError
from mazebench.maps.benchmark import SIZES
from mazebench.maps.kinds import KNOWN, NOVEL
from mazebench.report.curves import SUCCESS
from mazebench.report.table import METRICS, to_markdown
from mazebench.report.tables import DEFAULT_LANDMARK_DISTANCE
from mazebench.results.comparison import compare_results
from mazebench.results.intervals import CONFIDENCE, Estimate, runs_interval
from mazebench.results.metrics import ON_TIME_METRICS, scores
from mazebench.results.reading import Result
from mazebench.results.records import column
from mazebench.tasks.tracks import LEVELS, TRACKS

SATURATED = "At 1.00 ["  # begins the sentence below a table
_PAPERS_MMN = "MMN (paper)"
_PRINTED_DISTANCES = (2, 4, 6, 8, 10)  # those for which the paper prints success rates
_FARTHER = (12, 15)
_MILESTONES = (0.2, 0.6, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.6)  # million agent steps
# The rows of the paper's protocol, by the report's label.
_PAPER_ROWS = {
    RANDOM: "`random`",
    "dqn": "`dqn`, learned, no map",
    "mah-paper": "`mah-paper`, learned, model-free, closer to the paper",
    "mah": "`mah`, learned, model-free",
    "mmn": "`mmn`, follows the paper: learned model and search",
    _PAPERS_MMN: "the paper's MMN, as printed",
    NAVIGATOR: "`navigator`, a classical robot that feels walls",
    "planner": "`planner`, hand-written",
    "planner-closed-loop": "`planner-closed-loop`, hand-written",
    "oracle (privileged)": "`oracle`, privileged: gets the true maze and pose",
}

_TRAINED = {  # by name of the kept runs
    "mmn": "`mmn`",
    WAYS: "`mmn-paths`",
    "mmn-model-false": "`mmn` without model and search",
    "mah": "`mah`",
    "mah-long": "`mah`, 6.6 million steps",
    "dqn": "`dqn`",
    "dqn-long": "`dqn`, 6.6 million steps",
    "sb3-her": "DQN with hindsight of Stable-Baselines3",
    "sb3-ppo": "PPO of Stable-Baselines3",
}
_PAIRS = (
    (WAYS, "mmn"),
    ("mmn", "mmn-model-false"),
    ("mmn-model-false", "mah"),
    ("mmn", "mah"),
    ("mmn", "mah-long"),
    ("mah", "sb3-her"),
    ("mah", "sb3-ppo"),
    ("sb3-ppo", "dqn"),
    ("mah", "dqn"),
    ("mah-long", "dqn-long"),
    ("dqn", RANDOM),
)

_SHORT = 0.4  # million agent steps
# Archives of runs of mmn of this length, or longer.
_INGREDIENTS = {
    "mmn": "`mmn`",
    "mmn-hypermodel-false": "nothing generated: features of the map at the position and the code are inputs "
    "(`hypermodel=false`)",
    "mmn-nothing-read": "generated from the code, nothing read at the position (`rows=false reading=false`)",
    "mmn-neither": "neither generated nor read: the code is an input (`hypermodel=false rows=false reading=false`)",
    "mmn-no-search": "without search in training (`num_simulations=0`)",
    "mmn-model-false": "without model and search: Q-learning (`model=false`)",
}
_REGIMES = {
    "mmn": "20 mazes (`mmn`)",
    "mmn-5-mazes": "5 mazes, the same ones in each run (`--kinds dfs --num-mazes 5`)",
    "mmn-100-mazes": "100 mazes (`--kinds dfs --num-mazes 100`)",
    "mmn-fresh": "a new maze in each episode (`--fresh`)",
    "mmn-fixed": "20 mazes, a fixed pair in each (`--pairs fixed`)",
    "mmn-one-goal": "20 mazes, one goal an episode (`num_goals=1`)",
}

_PARTS = tuple((track, level) for track in TRACKS for level in LEVELS)
_NOT_RUN = "-"  # of the navigator with the true pose, on tracks that tell it to all, and of runs without results
# The rows of the table at a glance.
_GLANCE = {
    "oracle": "`oracle`: knows the building",
    NAVIGATOR: "`navigator`: a classical robot",
    LEARNED: "`neural-planner`: learned, plans on learned costs",
    NO_MAP: "`navigator` without the map",
    "sb3_agent:PPOAgent": "PPO, untuned",
}
# The rows of tables of tracks, by the agent and what it was told less or more than others.
_ROWS = {
    "oracle": "`oracle`, privileged: gets the true maze and pose",
    NAVIGATOR: "`navigator`, classical",
    NO_MAP: "`navigator` without the map",
    "navigator without map and goal": "`navigator` without map and goal",
    TRUE_POSE: "`navigator` with the true pose",
    LEARNED: "`neural-planner`, learned from the oracle",
    REWARDED: "`neural-planner`, learned from rewards",
    REWARDED_BUILDING: "`neural-planner`, learned from rewards on `building` alone",
    "planner-closed-loop": "`planner-closed-loop`, follows the map",
    "sb3_agent:PPOAgent": "PPO of Stable-Baselines3",
    "sb3_agent:RecurrentPPOAgent": "PPO of sb3-contrib, with an LSTM",
    "sb3_her_agent:LidarHerAgent": "DQN with hindsight of Stable-Baselines3",
    "mmn": "`mmn`, learned model and search, no lidar",
    "mah": "`mah`, learned, no lidar",
    "dqn": "`dqn`, learned, no map",
    RANDOM: "`random`",
}


def make_table(kept: Kept, name: str) -> str:
    """Returns a table: one of `TABLES`, or one of the report of the suite `paper` and a metric: "paper local-13 spl".

    Raises:
      InputError: if there is no such table, or a record that it needs is missing.
    """
    if name in TABLES:
        return TABLES[name](kept)
    suite, _, of_report = name.partition(" ")
    report, _, metric = of_report.partition(" ")
    if suite != PAPER or report not in kept.report or metric not in kept.report[report].metrics:
        reports = ", ".join(kept.report)
        raise InputError(f"unknown table {name!r}; tables: {', '.join(TABLES)}, {PAPER} TABLE METRIC, of: {reports}")
    return report_table(kept, report, metric)


def report_table(kept: Kept, name: str, metric: str) -> str:
    """Returns a metric of a table of the report of the suite `paper`; a sentence has the agents that saturate it."""
    table = kept.report[name]
    values = table.values[table.values.metric == metric]
    highest = values.groupby("column", observed=True).filter(
        lambda own: len(own) == values.row.nunique() and own.value.eq(1).all() and own.low95.notna().all()
    )
    text = to_markdown(table.wide(metric).drop(columns=highest.column.unique()))
    if highest.empty:
        return text
    labels = ", ".join(highest.column.unique())
    return (
        f"{text}\n{SATURATED}{_number(highest.low95.min())}, 1.00] in every row, and so not in the table: {labels}.\n"
    )


def paper_table(kept: Kept) -> str:
    """Returns success rates by distance and in the hierarchical task, a row for each agent, and the paper's MMN."""
    local, routes = (kept.report[name].wide("success_rate") for name in (LOCAL, "hierarchical-13"))
    if unnamed := set(local) - _PAPER_ROWS.keys():
        raise InputError(f"expected results of {', '.join(_PAPER_ROWS)}, found those of {', '.join(sorted(unnamed))}")
    header = ["agent", *map(str, _PRINTED_DISTANCES), "hierarchical"]
    rows = [
        [description, *local.loc[map(str, _PRINTED_DISTANCES), label], routes.at[str(DEFAULT_LANDMARK_DISTANCE), label]]
        for label, description in _PAPER_ROWS.items()
        if label in local
    ]
    return _table(header, rows)


def paper_runs(field: str, kept: Kept) -> str:
    """Returns the mean of a field of records over training runs, and the differences of `_PAIRS`."""
    runs = {name: kept.training_runs(name) for name in _TRAINED}
    runs[RANDOM] = [kept.result(RANDOM, LOCAL)]
    found = {name: _values(each, field) for name, each in runs.items()}
    records = runs[RANDOM][0].records
    labels = {**_TRAINED, RANDOM: _code(RANDOM)}
    means = [[labels[name], str(len(values)), *_over_runs(records, values)] for name, values in found.items()]
    differences = [
        [f"{labels[a]} - {labels[b]}", f"{len(found[a])}, {len(found[b])}", *_over_runs(records, found[a], found[b])]
        for a, b in _PAIRS
    ]
    return _table(["agent", "runs", *map(str, _PRINTED_DISTANCES)], [*means, *differences])


def mah_curve(kept: Kept) -> str:
    """Returns success rates of mah over training on the watched mazes: the mean, lowest and highest of the runs."""
    rates = [kept.success_rates("mah-long", distance) for distance in _PRINTED_DISTANCES]
    rows = []
    for steps in _MILESTONES:
        runs = [at[steps] for at in rates]
        rows.append([f"{steps:g}", *(_interval(Estimate(float(np.mean(at)), min(at), max(at))) for at in runs)])
    return _table(["million steps", *map(str, _PRINTED_DISTANCES)], rows)


def short_runs(rows: Mapping[str, str], metrics: Mapping[str, str], kept: Kept) -> str:
    """Returns what runs logged after 0.4 million steps: mean success rates, and metrics of the single runs.

    Intervals are Student's over the runs.

    Args:
      rows: descriptions of the runs, by the name of their archive.
      metrics: formats, by the name that the runs logged.
      kept: the records.
    """
    lines = []
    for name, description in rows.items():
        runs = kept.milestones(name).loc[[_SHORT]]
        rates = [_over_values(runs[f"{SUCCESS}{distance}"].tolist()) for distance in _PRINTED_DISTANCES]
        logged = [
            ", ".join(format(value, form) for value in runs.get(metric, pd.Series(dtype=float)).dropna())
            for metric, form in metrics.items()
        ]
        lines.append([description, str(len(runs)), *rates, *logged])
    logs = (name.replace("_", " ") for name in metrics)
    return _table(["trained", "runs", *map(str, _PRINTED_DISTANCES), *logs], lines)


def mmn_runs(kept: Kept) -> str:
    """Returns mean success rates of mmn and mmn-paths over their training runs, and the paper's."""
    paper = kept.report[LOCAL].wide("success_rate").loc[map(str, _PRINTED_DISTANCES), _PAPERS_MMN]
    distances = (*_PRINTED_DISTANCES, *_FARTHER)
    runs = {name: _values(kept.training_runs(name), "success") for name in ("mmn", WAYS)}
    records = kept.training_runs(WAYS)[0].records
    rows = [
        *([_code(name), str(len(own)), *_over_runs(records, own, at=distances)] for name, own in runs.items()),
        [f"`{WAYS}` - `mmn`", "", *_over_runs(records, runs[WAYS], runs["mmn"], distances)],
        ["the paper's MMN, as printed", "", *paper, *[""] * len(_FARTHER)],
    ]
    return _table(["agent", "runs", *map(str, distances)], rows)


def mmn_sizes(kept: Kept) -> str:
    """Returns mean success rates of mmn-paths over its training runs, in the mazes of each size of the benchmark."""
    distances = (*_PRINTED_DISTANCES, *_FARTHER)
    rows = []
    for size in SIZES:
        part = f"local-{size}"
        runs = kept.training_runs(WAYS) if part == LOCAL else kept.several.get((WAYS, part), [])
        if not runs:
            raise InputError(f"expected evaluations of {WAYS} on {part} among the records, found none")
        rates = _over_runs(runs[0].records, _values(runs, "success"), at=distances)
        rows.append([f"{size} x {size}", str(len(runs)), *rates])
    return _table(["mazes", "runs", *map(str, distances)], rows)


def tracks_table(metric: str, chosen: Mapping[str, str], kept: Kept) -> str:
    """Returns a metric of agents on the tracks."""
    played = _rows_of_tracks(kept)
    rows = [
        [description, *(_levels(kept, row, track, metric) for track in TRACKS)]
        for row, description in chosen.items()
        if row in played
    ]
    return _table(["agent", *map(_code, TRACKS)], rows)


def tracks_learned(row: str, kept: Kept) -> str:
    """Returns a learned agent's rates over its training runs, and the paired differences to the navigator."""
    lines = []
    for track, level in _PARTS:
        if runs := kept.several.get((row, f"{track}-{level}")):
            navigator = kept.result(NAVIGATOR, f"{track}-{level}")
            maze = column(navigator.records, "maze")
            own, other = (
                {metric: np.array([scores(each.records)[metric] for each in results], dtype=float)
                 for metric in ("success_rate", ON_TIME_125)}
                for results in (runs, [navigator])
            )  # fmt: skip
            means = [_interval(runs_interval(values, maze)) for values in own.values()]
            differences = [_interval(runs_interval(own[metric], maze, other[metric])) for metric in own]
            lines.append([f"{_code(track)} {level}", str(len(runs)), *means, *differences])
    header = ["setting", "runs", "success rate", "on-time rate"]
    return _table([*header, "success - `navigator`", "on-time rate - `navigator`"], lines)


def tracks_worst_tenth(kept: Kept) -> str:
    """Returns on-time rates in the tenth of the mazes in which an agent is late most often, after JaxNav."""
    lines = []
    for row in (NAVIGATOR, LEARNED, NO_MAP):
        cells = [
            " / ".join(_number(float(np.mean([_worst_tenth(run) for run in runs]))) for runs in kept.levels(row, track))
            for track in TRACKS
        ]
        if any(cells):
            lines.append([_ROWS[row], *(cell or _NOT_RUN for cell in cells)])
    return _table(["agent", *map(_code, TRACKS)], lines)


def _worst_tenth(result: Result) -> float:
    on_time = scores(result.records)[ON_TIME_125]
    by_maze = pd.Series(np.asarray(on_time, dtype=float)).groupby(column(result.records, "maze")).mean()
    return float(by_maze.nsmallest(-(-len(by_maze) // 10)).mean())


def tracks_map_worth(kept: Kept) -> str:
    """Returns the navigator's headline numbers with their intervals, and what the map is worth to it."""
    rows = []
    for track, level in _PARTS:
        navigator, without = (kept.result(row, f"{track}-{level}") for row in (NAVIGATOR, NO_MAP))
        worth = compare_results(navigator, without).overall.metrics[ON_TIME_125].difference
        figures = [estimate(navigator, metric) for metric in ("success_rate", ON_TIME_2, ON_TIME_125)]
        rows.append([f"`{track}` {level}", *map(_interval, [*figures, estimate(without, ON_TIME_125), worth])])
    names = [METRICS[metric] for metric in (ON_TIME_2, ON_TIME_125)]
    return _table(["part", "success", *names, f"without the map, {names[1]}", "map worth"], rows)


def tracks_novel_kinds(kept: Kept) -> str:
    """Returns shares on time in the kinds of all splits, and in those that are in eval alone."""
    chosen = list(itertools.product((NAVIGATOR, LEARNED), (("known", KNOWN), ("held-out", NOVEL))))
    rows = [
        [_code(track), *(_levels(kept, row, track, ON_TIME_125, "kind", kinds) for row, (_, kinds) in chosen)]
        for track in TRACKS
    ]
    return _table(["track", *(f"{_code(row)}, {name} layouts" for row, (name, _) in chosen)], rows)


def tracks_blocked(kept: Kept) -> str:
    """Returns the navigator's share on time where the shortest path on the map is open, and where it is blocked."""
    rows = []
    for track, level in _PARTS:
        if track != "building":  # whose maps are right
            result = kept.result(NAVIGATOR, f"{track}-{level}")
            cells = [f"`{track}` {level}"]
            for is_blocked in PATHS.values():
                count = int((column(result.records, "blocked") == is_blocked).sum())
                cells += [str(count), _interval(estimate(result, ON_TIME_125, "blocked", (is_blocked,)))]
            rows.append(cells)
    header = itertools.chain.from_iterable((f"episodes, {name}", METRICS[ON_TIME_125]) for name in PATHS)
    return _table(["part", *header], rows)


def tracks_navigator(kept: Kept) -> str:
    """Returns the navigator's numbers on the tracks."""
    metrics = ("success_rate", *ON_TIME_METRICS, "spl")
    rows = [[_code(track), *(_levels(kept, NAVIGATOR, track, metric) for metric in metrics)] for track in TRACKS]
    return _table(["track", *(METRICS[metric] for metric in metrics)], rows)


def tracks_navigator_kinds(kept: Kept) -> str:
    """Returns the navigator's share on time in each kind of maze."""
    kinds = (*KNOWN, *NOVEL)
    rows = [
        [_code(track), *(_levels(kept, NAVIGATOR, track, ON_TIME_125, "kind", (kind,)) for kind in kinds)]
        for track in TRACKS
    ]
    return _table([f"track, {METRICS[ON_TIME_125]}", *map(_code, kinds)], rows)


# By the name that a page gives.
TABLES: dict[str, Callable[[Kept], str]] = {
    "paper-local": paper_table,
    "paper-runs": functools.partial(paper_runs, "success"),
    "paper-runs-spl": functools.partial(paper_runs, "spl"),
    "mmn-runs": mmn_runs,
    "mmn-sizes": mmn_sizes,
    "mah-curve": mah_curve,
    "mmn-ingredients": functools.partial(short_runs, _INGREDIENTS, {"model_error_1": ".3f", "map_ratio": ".1f"}),
    "mmn-regimes": functools.partial(short_runs, _REGIMES, {}),
    "tracks-glance": functools.partial(tracks_table, ON_TIME_125, _GLANCE),
    "tracks-success": functools.partial(tracks_table, "success_rate", _ROWS),
    "tracks-on-time": functools.partial(tracks_table, ON_TIME_125, _ROWS),
    "tracks-on-time-2": functools.partial(tracks_table, ON_TIME_2, _ROWS),
    "tracks-learned": functools.partial(tracks_learned, LEARNED),
    "tracks-rewarded": functools.partial(tracks_learned, REWARDED),
    "tracks-ways": functools.partial(tracks_learned, WAYS),
    "tracks-rewarded-building": functools.partial(tracks_learned, REWARDED_BUILDING),
    "tracks-worst-tenth": tracks_worst_tenth,
    "tracks-map-worth": tracks_map_worth,
    "tracks-novel-kinds": tracks_novel_kinds,
    "tracks-blocked": tracks_blocked,
    "tracks-navigator": tracks_navigator,
    "tracks-navigator-kinds": tracks_navigator_kinds,
}


def _values(runs: Sequence[Result], field: str) -> np.ndarray:
    """Returns `[R, E]` float: a field of the records of each run."""
    return np.array([column(each.records, field) for each in runs], dtype=float)


def _over_runs(
    records: Sequence[Any], values: np.ndarray, others: np.ndarray | None = None, at: Sequence[int] = _PRINTED_DISTANCES
) -> list[str]:
    """Returns the mean of values `[R, E]`, or the difference to others' mean, at each of some distances.

    `records` are those of one run, with the mazes and distances of its episodes.
    """
    maze, distance = column(records, "maze"), column(records, "distance")
    counted = [distance == each for each in at]
    return [
        _interval(runs_interval(values[:, own], maze[own], None if others is None else others[:, own]))
        for own in counted
    ]


def _over_values(rates: Sequence[float]) -> str:
    """Returns the mean of success rates of training runs, with Student's interval if they differ."""
    mean = float(np.mean(rates))
    if len(set(rates)) == 1:
        return _number(mean)
    low, high = np.clip(stats.t.interval(CONFIDENCE, len(rates) - 1, mean, stats.sem(rates)), 0, 1)
    return _interval(Estimate(mean, float(low), float(high)))


def _rows_of_tracks(kept: Kept) -> dict[str, str]:
    """Returns those of `_ROWS` that are evaluated on the tracks."""
    played = {row for (row, _), result in kept.results.items() if result.summary.task.track}
    played |= {row for row, _ in kept.several} - {WAYS}  # which has tables of its own
    if not played:
        raise InputError("expected evaluations on tracks among the records, found none")
    if unnamed := played - _ROWS.keys():
        raise InputError(f"expected results of {', '.join(_ROWS)}, found those of {', '.join(sorted(unnamed))}")
    return {row: description for row, description in _ROWS.items() if row in played}


def _levels(kept: Kept, row: str, track: str, metric: str, field: str = "", values: Sequence[Any] = ()) -> str:
    """Returns the means of a metric at the levels of a track, of the episodes that `estimate` counts."""
    means = [mean_estimate(runs, metric, field, values) for runs in kept.levels(row, track)]
    return " / ".join("none" if mean is None else _number(mean) for mean in means) or _NOT_RUN


def _interval(mean: Estimate | None) -> str:
    return "none" if mean is None else f"{_number(mean.value)} [{_number(mean.low)}, {_number(mean.high)}]"


def _number(value: float) -> str:
    value = round(value, 9)  # means that differ by the order of their sum give the same two digits
    return f"{value:.2f}".replace("-0.00", "0.00")


def _code(text: str) -> str:
    return f"`{text}`"


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Returns a table in Markdown."""
    return "".join(f"| {' | '.join(line)} |\n" for line in (header, ["---"] * len(header), *rows))
