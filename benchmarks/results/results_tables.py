"""The tables of results in README.md and docs. A page holds a table between two lines, the first of which names it:

<!-- table: NAME -->
<!-- end of table -->
"""

from __future__ import annotations

import functools
import itertools
import pathlib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np
import pandas as pd
from scipy import stats

from benchmarks.results.kept import LOCAL, PAPER, Kept, estimate
from mazebench.maps.benchmark import SIZES
from mazebench.maps.kinds import KNOWN, NOVEL
from mazebench.report.curves import SUCCESS
from mazebench.report.table import METRICS, to_markdown
from mazebench.results.intervals import CONFIDENCE, Estimate
from mazebench.results.metrics import ON_TIME_METRICS
from mazebench.tasks.tracks import TRACKS

ROOT = pathlib.Path(__file__).parent.parent.parent
RECORDS = ROOT / "records"
PAGES = (
    "README.md",
    *(f"docs/{name}.md" for name in ("results", "results_full", "tracks", "baselines", "experiments")),
    *(f"docs/agents/{name}.md" for name in ("mmn", "neural_planner")),
)

ON_TIME_125, ON_TIME_2 = ON_TIME_METRICS  # within 1.25 and 2 times the oracle's steps
SATURATED = "At 1.00 ["  # begins the sentence below a table
_BLOCK = re.compile(
    r"(<!-- table: ([^\n]+) -->\n)(?:\|[^\n]*\n)*(?:\n" + re.escape(SATURATED) + r"[^\n]*\n)?(<!-- end of table -->\n)"
)
_PRINTED_DISTANCES = (2, 4, 6, 8, 10)  # those for which the paper prints success rates
_MILESTONES = (0.2, 0.6, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.6)  # million agent steps
_TRACKS = [f"`{track}`" for track in TRACKS]

_TRAINED = {
    "mmn": "`mmn`",
    "mmn-paths": "`mmn-paths`",
    "mmn-model-false": "`mmn` without model and search",
    "mah": "`mah`",
    "mah-long": "`mah`, 6.6 million steps",
    "dqn": "`dqn`",
    "dqn-long": "`dqn`, 6.6 million steps",
    "sb3-her": "DQN with hindsight of Stable-Baselines3",
    "sb3-ppo": "PPO of Stable-Baselines3",
    "random": "`random`",
}
_PAIRS = (
    ("mmn-paths", "mmn"),
    ("mmn", "mmn-model-false"),
    ("mmn-model-false", "mah"),
    ("mmn", "mah"),
    ("mmn", "mah-long"),
    ("mah", "sb3-her"),
    ("mah", "sb3-ppo"),
    ("sb3-ppo", "dqn"),
    ("mah", "dqn"),
    ("mah-long", "dqn-long"),
    ("dqn", "random"),
)
# Archives of training runs of mmn.
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
# The rows of tables of tracks: of the one at a glance, and of the others.
_GLANCE = {
    "oracle": "`oracle`: knows the building",
    "navigator": "`navigator`: a classical robot",
    "neural-planner": "`neural-planner`: learned, plans on learned costs",
    "navigator without map": "`navigator` without the map",
    "sb3_agent:PPOAgent": "PPO, untuned",
}
_ROWS = {
    "oracle": "`oracle`, privileged: gets the true maze and pose",
    "navigator": "`navigator`, classical",
    "navigator without map": "`navigator` without the map",
    "navigator without map and goal": "`navigator` without map and goal",
    "navigator with the true pose": "`navigator` with the true pose",
    "neural-planner": "`neural-planner`, learned from the oracle",
    "neural-planner from rewards": "`neural-planner`, learned from rewards",
    "neural-planner from rewards on building": "`neural-planner`, learned from rewards on `building` alone",
    "planner-closed-loop": "`planner-closed-loop`, follows the map",
    "sb3_agent:PPOAgent": "PPO of Stable-Baselines3",
    "sb3_agent:RecurrentPPOAgent": "PPO of sb3-contrib, with an LSTM",
    "sb3_her_agent:LidarHerAgent": "DQN with hindsight of Stable-Baselines3",
    "mah": "`mah`, learned, no lidar",
    "dqn": "`dqn`, learned, no map",
    "random": "`random`",
}


def with_tables(text: str, kept: Kept) -> str:
    """Returns a page with its tables made from the records.

    A table is one of `TABLES`, or one of the report of the suite `paper`, as "paper local-13 spl".
    """

    def make(block: re.Match[str]) -> str:
        name, *of_report = block[2].split()
        return block[1] + (report_table(kept, *of_report) if name == PAPER else TABLES[name](kept)) + block[3]

    return _BLOCK.sub(make, text)


def report_table(kept: Kept, name: str, metric: str) -> str:
    """Returns a metric of a table of the report of the suite `paper`; a sentence has the agents that saturate it."""
    table = kept.report[name]
    values = table.values[table.values.metric == metric]
    highest = values.groupby("column", observed=True).filter(
        lambda own: len(own) == values.row.nunique() and own.value.eq(1).all() and own.low95.notna().all()
    )
    labels = highest.column.unique()
    text = to_markdown(table.wide(metric).drop(columns=labels))
    if len(labels):
        lowest = _number(highest.low95.min())
        text += f"\n{SATURATED}{lowest}, 1.00] in every row, and so not in the table: {', '.join(labels)}.\n"
    return text


def paper_runs(metric: str, kept: Kept) -> str:
    """Returns the mean of a metric over training runs by distance, and the differences of `_PAIRS`."""
    found = {name: kept.of(name, LOCAL) for name in _TRAINED}
    rows = [_by_distance(label, found[name], metric) for name, label in _TRAINED.items()]
    rows += [_by_distance(f"{_TRAINED[a]} - {_TRAINED[b]}", found[a], metric, found[b]) for a, b in _PAIRS]
    return format_table(["agent", "runs", *map(str, _PRINTED_DISTANCES)], rows)


def mah_curve(kept: Kept) -> str:
    """Returns success rates of mah over training on the watched mazes: the mean, lowest and highest of the runs."""
    rates = [kept.success_rates("mah-long", distance) for distance in _PRINTED_DISTANCES]
    rows = [[f"{steps:g}", *(format_interval(Estimate(*each.loc[steps])) for each in rates)] for steps in _MILESTONES]
    return format_table(["million steps", *map(str, _PRINTED_DISTANCES)], rows)


def short_runs(archives: Mapping[str, str], metrics: Mapping[str, str], kept: Kept) -> str:
    """Returns what runs logged after 0.4 million steps: mean success rates, and `metrics` of each run in a format."""
    rows = []
    for name, description in archives.items():
        runs = kept.milestones(name).loc[[0.4]]
        rates = [_over_values(runs[f"{SUCCESS}{distance}"]) for distance in _PRINTED_DISTANCES]
        logged = runs.reindex(columns=list(metrics)).dropna().items()
        texts = [", ".join(format(value, metrics[metric]) for value in values) for metric, values in logged]
        rows.append([description, str(len(runs)), *rates, *texts])
    logs = (name.replace("_", " ") for name in metrics)
    return format_table(["trained", "runs", *map(str, _PRINTED_DISTANCES), *logs], rows)


def mmn_sizes(kept: Kept) -> str:
    """Returns mean success rates of mmn-paths over its training runs, in the mazes of each size of the benchmark."""
    at = (*_PRINTED_DISTANCES, 12, 15)
    rows = [_by_distance(f"{size} x {size}", kept.of("mmn-paths", f"local-{size}"), at=at) for size in SIZES]
    return format_table(["mazes", "runs", *map(str, at)], rows)


def tracks_table(metric: str, rows: Mapping[str, str], kept: Kept) -> str:
    """Returns a metric of agents on the tracks."""
    lines = [[text, *(_levels(kept, track, agent, metric) for track in TRACKS)] for agent, text in rows.items()]
    return format_table(["agent", *_TRACKS], lines)


def tracks_learned(agent: str, kept: Kept) -> str:
    """Returns a learned agent's rates over its training runs, and the paired differences to the navigator."""
    rows = []
    for name, setting, own in _settings(kept, agent):
        others = (None, kept.of("navigator", setting))
        pairs = itertools.product(others, ("success_rate", ON_TIME_125))
        means = (format_interval(estimate(own, metric, other)) for other, metric in pairs)
        rows.append([name, str(own.run.nunique()), *means])
    header = ["setting", "runs", "success rate", "on-time rate"]
    return format_table([*header, "success - `navigator`", "on-time rate - `navigator`"], rows)


def tracks_worst_tenth(kept: Kept) -> str:
    """Returns on-time rates in the tenth of the mazes in which an agent is late most often, after JaxNav."""

    def worst(own: pd.DataFrame) -> float:
        by_maze = own.groupby(["run", "maze"])[ON_TIME_125].mean()
        return by_maze.groupby("run").apply(lambda of_run: of_run.nsmallest(-(-len(of_run) // 10)).mean()).mean()

    agents = ("navigator", "neural-planner", "navigator without map")
    rows = [
        [_ROWS[agent], *(_joined(map(worst, kept.on_track(agent, track).values())) for track in TRACKS)]
        for agent in agents
    ]
    return format_table(["agent", *_TRACKS], rows)


def tracks_map_worth(kept: Kept) -> str:
    """Returns the navigator's headline numbers with their intervals, and what the map is worth to it."""
    rows = []
    for name, setting, own in _settings(kept, "navigator"):
        without = kept.of("navigator without map", setting)
        means = [estimate(own, metric) for metric in ("success_rate", ON_TIME_2, ON_TIME_125)]
        means += [estimate(without, ON_TIME_125), estimate(own, ON_TIME_125, without)]
        rows.append([name, *map(format_interval, means)])
    names = [METRICS[metric] for metric in (ON_TIME_2, ON_TIME_125)]
    return format_table(["part", "success", *names, f"without the map, {names[1]}", "map worth"], rows)


def tracks_blocked(kept: Kept) -> str:
    """Returns the navigator's share on time where the shortest path on the map is open, and where it is blocked."""
    rows = []
    for name, setting, own in _settings(kept, "navigator"):
        if not setting.startswith("building"):  # whose maps are right
            groups = [own[own.blocked == is_blocked] for is_blocked in (False, True)]
            cells = [[str(len(each)), format_interval(estimate(each, ON_TIME_125))] for each in groups]
            rows.append([name, *cells[0], *cells[1]])
    open_path, blocked = (f"episodes, path on the map {name}" for name in ("open", "blocked"))
    return format_table(["part", open_path, METRICS[ON_TIME_125], blocked, METRICS[ON_TIME_125]], rows)


def by_track(head: str, columns: Mapping[str, tuple[str, str, Sequence[str]]], kept: Kept) -> str:
    """Returns a row for each track; a column is of an agent and a metric in some kinds of mazes."""
    rows = [[f"`{track}`", *(_levels(kept, track, *chosen) for chosen in columns.values())] for track in TRACKS]
    return format_table([head, *columns], rows)


_NOVEL_KINDS = {
    f"`{agent}`, {name} layouts": (agent, ON_TIME_125, kinds)
    for agent in ("navigator", "neural-planner")
    for name, kinds in (("known", KNOWN), ("held-out", NOVEL))
}
_NAVIGATOR = {
    METRICS[each]: ("navigator", each, (*KNOWN, *NOVEL)) for each in ("success_rate", *ON_TIME_METRICS, "spl")
}
_NAVIGATOR_KINDS = {f"`{kind}`": ("navigator", ON_TIME_125, (kind,)) for kind in (*KNOWN, *NOVEL)}
# By the name that a page gives.
TABLES: dict[str, Callable[[Kept], str]] = {
    "paper-runs": functools.partial(paper_runs, "success_rate"),
    "paper-runs-spl": functools.partial(paper_runs, "spl"),
    "mmn-sizes": mmn_sizes,
    "mah-curve": mah_curve,
    "mmn-ingredients": functools.partial(short_runs, _INGREDIENTS, {"model_error_1": ".3f", "map_ratio": ".1f"}),
    "mmn-regimes": functools.partial(short_runs, _REGIMES, {}),
    "tracks-glance": functools.partial(tracks_table, ON_TIME_125, _GLANCE),
    "tracks-success": functools.partial(tracks_table, "success_rate", _ROWS),
    "tracks-on-time": functools.partial(tracks_table, ON_TIME_125, _ROWS),
    "tracks-on-time-2": functools.partial(tracks_table, ON_TIME_2, _ROWS),
    "tracks-learned": functools.partial(tracks_learned, "neural-planner"),
    "tracks-rewarded": functools.partial(tracks_learned, "neural-planner from rewards"),
    "tracks-rewarded-building": functools.partial(tracks_learned, "neural-planner from rewards on building"),
    "tracks-ways": functools.partial(tracks_learned, "mmn-paths"),
    "tracks-worst-tenth": tracks_worst_tenth,
    "tracks-map-worth": tracks_map_worth,
    "tracks-novel-kinds": functools.partial(by_track, "track", _NOVEL_KINDS),
    "tracks-blocked": tracks_blocked,
    "tracks-navigator": functools.partial(by_track, "track", _NAVIGATOR),
    "tracks-navigator-kinds": functools.partial(by_track, f"track, {METRICS[ON_TIME_125]}", _NAVIGATOR_KINDS),
}


def _by_distance(
    name: str,
    own: pd.DataFrame,
    metric: str = "success_rate",
    other: pd.DataFrame | None = None,
    at: Sequence[int] = _PRINTED_DISTANCES,
) -> list[str]:
    """Returns a row: a name, the number of runs, and at each distance the mean, or the difference to another."""
    frames = [own] if other is None else [own, other]
    groups = ([frame[frame.distance == distance] for frame in frames] for distance in at)
    cells = [format_interval(estimate(group[0], metric, *group[1:])) for group in groups]
    return [name, ", ".join(str(each.run.nunique()) for each in frames), *cells]


def _settings(kept: Kept, agent: str) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Yields the name in tables, the name, and the agent's episodes for each setting of the tracks that it played."""
    for track in TRACKS:
        for setting, own in kept.on_track(agent, track).items():
            yield f"`{track}` {setting[-1]}", setting, own


def _levels(kept: Kept, track: str, agent: str, metric: str, kinds: Sequence[str] = (*KNOWN, *NOVEL)) -> str:
    """Returns the means of a metric at the levels of a track, in mazes of some kinds; "-" without evaluations."""
    return _joined(own[own.kind.isin(kinds)][metric].mean() for own in kept.on_track(agent, track).values())


def _joined(values: Iterable[float]) -> str:
    return " / ".join(map(_number, values)) or "-"


def _over_values(rates: pd.Series) -> str:
    """Returns the mean of success rates of training runs, with Student's interval if they differ."""
    if rates.nunique() == 1:
        return _number(rates.iloc[0])
    low, high = np.clip(stats.t.interval(CONFIDENCE, len(rates) - 1, rates.mean(), rates.sem()), 0, 1)
    return format_interval(Estimate(rates.mean(), low, high))


def format_interval(mean: Estimate) -> str:
    """Returns a mean with its interval, as "0.50 [0.25, 0.75]"."""
    return f"{_number(mean.value)} [{_number(mean.low)}, {_number(mean.high)}]"


def _number(value: float) -> str:
    value = round(value, 9)  # means that differ by the order of their sum give the same two digits
    return f"{value:.2f}".replace("-0.00", "0.00")


def format_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Returns a table in Markdown."""
    return "".join(f"| {' | '.join(line)} |\n" for line in (header, ["---"] * len(header), *rows))
