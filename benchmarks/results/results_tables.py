"""The tables of results in README.md and docs. A page holds a table between two lines, the first of which names it:

<!-- table: NAME -->
<!-- end of table -->
"""

from __future__ import annotations

import csv
import functools
import itertools
import os
import pathlib
import re
from collections.abc import Callable, Iterable, Mapping, Sequence

import pandas as pd
from scipy import stats

from benchmarks.results.kept import (
    LLM_DEV,
    LOCAL,
    ON_TIME_2,
    ON_TIME_125,
    PAPER,
    RECALL,
    RECALL_AGENTS,
    RECALL_SETTINGS,
    SUCCESS,
    TURTLEBOT3,
    WORST_TENTH,
    Kept,
    ceilings,
    estimate,
)
from mazebench.constants import STEP_TIME
from mazebench.maps.benchmark import FROZEN_SPLITS, REAL_BENCHMARK, SIZES, read_asset
from mazebench.maps.kinds import KNOWN, NOVEL
from mazebench.maps.real_buildings import ORIGINS, SCAN, buildings
from mazebench.report.table import to_markdown
from mazebench.results.intervals import CONFIDENCE, Estimate
from mazebench.results.metrics import METRICS, ON_TIMES, RECALLS, SPL, SUCCESS_RATE
from mazebench.results.suite_groups import WITH_RIGHT_MAP, WITHOUT_MAP
from mazebench.tasks.tracks import LEVELS, STANDING

ROOT = pathlib.Path(__file__).parent.parent.parent
RECORDS = ROOT / "records"
PAGES = (
    "README.md",
    *(f"docs/{name}.md" for name in ("index", "results", "results_full", "tracks", "baselines", "experiments", "llm")),
    *(f"docs/{name}.md" for name in ("real", "datasheet", "your_map")),
    *(f"docs/agents/{name}.md" for name in ("mmn", "neural_planner", "map_policy", "believer", "neural_mapper")),
    *(f"docs/environments/{name}.md" for name in (*STANDING, "doors", "local", "hierarchical")),
    "docs/reproduce.md",  # the last one, since it lists the tables of the others
)

SATURATED = "At 1.00 ["  # begins the sentence below a table
_SOURCE = "Records: "  # begins the line below a table that names its archives
_BLOCK = re.compile(
    r"(<!-- table: ([^\n]+) -->\n)(?:\|[^\n]*\n)*"
    rf"(?:\n(?:{re.escape(SATURATED)}|{_SOURCE})[^\n]*\n)*(<!-- end of table -->\n)"
)
_PRINTED_DISTANCES = (2, 4, 6, 8, 10)  # those for which the paper prints success rates
_MILESTONES = (0.2, 0.6, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.6)  # million agent steps
DOOR_AGENTS = {  # of the track `doors`, by what the table calls them
    **{f"`{name}`": name for name in ("oracle", "oracle-hurrying", "always-waits", "navigator")},
    "`navigator-without-waiting`": "navigator-without-waiting",
    "`navigator` without the map": "navigator without map",
    "`neural-planner`, shipped": "neural-planner",
    "`neural-planner`, trained on `doors`, too": "neural-planner trained on doors",
    "`random`": "random",
}
_TRACKS = [f"`{track}`" for track in STANDING]
_KINDS = (*KNOWN, *NOVEL)
_WITHOUT_MEMORY = "navigator-without-memory"
_BELIEVERS = ("believer", "believer-learned")

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
    ("mmn", "mah-long"),
    ("mmn", "mah"),
    ("mmn-paths", "mmn"),
    ("mmn", "mmn-model-false"),
    ("mmn-model-false", "mah"),
    ("mah", "sb3-her"),
    ("mah", "sb3-ppo"),
    ("sb3-ppo", "dqn"),
    ("mah", "dqn"),
    ("mah-long", "dqn-long"),
    ("dqn", "random"),
)
# Settings and agents, by what a table calls them.
_LOCAL_RUNS = {text: (LOCAL, name) for name, text in _TRAINED.items()}
_LOCAL_RUNS |= {f"{_TRAINED[a]} - {_TRAINED[b]}": (LOCAL, a, b) for a, b in _PAIRS}
_SIZES = {f"{size} x {size}": (f"local-{size}", "mmn-paths") for size in SIZES}
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
# The rows of tables of tracks: of the one at a glance, and of the others. The last row has the best of some agents.
_GLANCE = {
    "oracle": "`oracle`: knows the building",
    "navigator": "`navigator`: a classical robot",
    "believer-learned": "`believer-learned`: the same, with a learned belief of what has changed",
    "neural-planner": "`neural-planner`: learned driving, hand-written localization",
    "navigator without map": "`navigator` without the map",
}
_UNSOLVED = "**Unsolved**: the best agent without hand-written localization"
_NOTHING_BY_HAND = (
    *("dagger:Student", "sb3_agent:FieldPPOAgent", "sb3_agent:FieldRecurrentPPOAgent", "sb3_agent:PPOAgent"),
    *("sb3_agent:RecurrentPPOAgent", "sb3_her_agent:LidarHerAgent", "mah", "dqn", "map-policy-camera"),
    "neural-mapper",
)
# Learned agents, and what was trained by the same recipe with the map hidden.
_WITHOUT_MAP = {
    "neural-planner": ("`neural-planner`", "neural-planner trained without the map"),
    "sb3_agent:FieldPPOAgent": ("PPO", "PPO trained without the map"),
}
# Of the tables of expected scores, on tracks and else.
_EXPECTED = {
    "random": "`random`",
    "navigator without map": "`navigator` without the map",
    "navigator": "`navigator`, classical",
    "neural-planner": "`neural-planner`, learned",
    "oracle": "`oracle`, the ceiling",
}
_EXPECTED_LOCAL = {
    "random": "`random`",
    "dqn": "`dqn`, learned without the map",
    "mmn": "`mmn`, learned",
    "navigator": "`navigator`, classical",
    "oracle": "`oracle`, the ceiling",
}
# In real buildings: agents, and settings by what a table calls them.
_IN_REAL_BUILDINGS = {
    "oracle": "`oracle`, privileged",
    "navigator": "`navigator`, classical",
    "believer": "`believer`: the navigator with a belief over passages",
    "navigator-camera": "`navigator` by camera",
    "neural-planner": "`neural-planner`, learned",
    "sb3_agent:FieldPPOAgent": "PPO, reads distances on the map, one run",
    "dagger:Student": "90-second imitation of the oracle, reads distances on the map, one run",
    "map-policy-camera": "`map-policy`, learned, by camera",
    "random": "`random`",
}
_REAL_SETTINGS = {
    "right": "right map",
    "right-no-map": "no map",
    "lost": "lost pose",
    "changed-1": "changed 1",
    "changed-2": "changed 2",
    "years": "years",
}
# Of the table at a glance: what a robot would know, by setting.
_REAL_GLANCE = {
    "right": "right map",
    "changed-1": "old map, few changes",
    "changed-2": "old map, many changes",
    "lost": "right map, place unknown",
}
_ROWS = {
    "oracle": "`oracle`, privileged: gets the true maze and pose",
    "navigator": "`navigator`, classical",
    "believer": "`believer`: the navigator with a belief over doors, by the model of how they move",
    "believer-learned": "`believer-learned`: the navigator with a learned belief of what has changed",
    "navigator without map": "`navigator` without the map",
    "navigator without map and goal": "`navigator` without map and goal",
    "navigator with the true pose": "`navigator` with the true pose",
    "neural-planner": "`neural-planner`, trained by the oracle's labels",
    "neural-planner from rewards": "`neural-planner`, trained with rewards",
    "neural-mapper": "`neural-mapper`: the same with a learned map and belief, no localization, one run",
    "dagger:Student": "90-second imitation of the oracle, reads distances on the map",
    "sb3_agent:FieldPPOAgent": "PPO, reads distances on the map, progress reward",
    "sb3_agent:FieldRecurrentPPOAgent": "the same with an LSTM, one run",
    "planner-closed-loop": "`planner-closed-loop`, follows the map",
    "sb3_agent:PPOAgent": "PPO, reads the raw map, sparse reward, one run",
    "sb3_agent:RecurrentPPOAgent": "PPO with an LSTM, reads the raw map, sparse reward, one run",
    "sb3_her_agent:LidarHerAgent": "DQN with hindsight, reads the raw map, one run",
    "mah": "`mah`, learned, no lidar",
    "dqn": "`dqn`, learned, no map",
    "random": "`random`",
}
# Rows of tables of one evaluation each: agents and settings, by what a table calls them.
_MAP_POLICY = {
    f"`{track}` {level}, `{look}`": (f"map-policy/{look}", f"{track}-{level}")
    for track, level, look in (
        ("building", 1, "plain"), ("building", 1, "varied"), *(("rebuilt", level, "plain") for level in LEVELS)
    )
}  # fmt: skip
_TURTLEBOT3 = {
    f"{text}, `{agent}`": (f"{TURTLEBOT3}/{agent}", setting)
    for setting, text in {
        "rebuilt-2": "`rebuilt` 2", "changed-1": "`real`, changed 1", "years": "`real`, years"
    }.items()
    for agent in ("costmap-dwa", "navigator")
}  # fmt: skip
_IN_WORDS = ("building-1", "rebuilt-2", "adrift-1", "adrift-2")  # the settings of the suites `llm` and `llm-dev`
# The numbers of simulations of mmn in evaluation.
_SEARCHES = {str(number): ("local-13", f"mmn-search/simulations-{number}") for number in (0, 64)}
_SEARCHES["64 - 0"] = (*_SEARCHES["64"], _SEARCHES["0"][1])


def with_tables(page: str, text: str, kept: Kept) -> str:
    """Returns the text of a page with its tables made from the records, each with the names of its archives.

    A table is one of `TABLES`, or one of the report of the suite `paper`, as "paper local-13 spl".
    """
    commands = os.path.relpath("docs/reproduce.md", pathlib.PurePath(page).parent) + "#commands"

    def make(block: re.Match[str]) -> str:
        name, *of_report = block[2].split()
        kept.read.clear()
        table = report_table(kept, *of_report) if name == PAPER else TABLES[name](kept)
        archives = ", ".join(f"`{name}`" for name in sorted(kept.read))
        source = f"\n{_SOURCE}{archives} ([commands]({commands})).\n" if archives else ""
        return f"{block[1]}{table}{source}{block[3]}"

    return _BLOCK.sub(make, text)


def published(_: Kept) -> str:
    """Returns the tables of all other pages, with the archives of each and the time that they take to make again.

    The times are those of the rows of docs/reproduce.md that begin with an archive.
    """
    costs = re.findall(
        r"^\| `([\w/-]+)` \|.*\| (\d+) \| (\d+) \|$", (ROOT / PAGES[-1]).read_text("utf-8"), re.MULTILINE
    )
    minutes = {name: (int(evaluation), int(training)) for name, evaluation, training in costs}
    rows = []
    for page in PAGES[:-1]:
        text = (ROOT / page).read_text(encoding="utf-8")
        for block in _BLOCK.finditer(text):
            first, *titles = re.findall(r"^#+ (.+)$", text[: block.start()], re.MULTILINE)
            section = titles[-1] if titles else first
            place = ": ".join([first, *titles[-1:]])
            slug = re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", section.lower()))
            is_on_site = page.startswith("docs/")
            place = f"[{place}]({page.removeprefix('docs/')}#{slug})" if is_on_site else f"{page}: {section}"
            archives = re.findall(r"`([^`]+)`(?=.* \(\[commands)", block[0].rpartition(f"\n{_SOURCE}")[2])
            parts = [minutes[name] for name in archives if name in minutes]
            times = [str(sum(each)) for each in zip(*parts, strict=True)] if parts else ["", ""]
            names = ", ".join(f"`{name}`" for name in archives) or "none: made from `assets/real`"
            rows.append([place, *times, names, f"`{block[2]}`"])
    return format_table(["table", "evaluation, minutes", "training, minutes", "archives", "name in its page"], rows)


def report_table(kept: Kept, name: str, metric: str) -> str:
    """Returns a metric of a table of the report of the suite `paper`; a sentence has the agents that saturate it."""
    kept.read.add(PAPER)
    table = kept.report[name]
    values = table.values[table.values.metric == metric]
    highest = values.groupby("column", observed=True).filter(
        lambda own: len(own) == values.row.nunique() and own.value.eq(1).all() and own.low95.notna().all()
    )
    labels, lowest = highest.column.unique(), highest.low95.min()
    text = to_markdown(table.wide(metric).drop(columns=labels))
    if len(labels):
        text += f"\n{SATURATED}{lowest:.2f}, 1.00] in every row, and so not in the table: {', '.join(labels)}.\n"
    return text


def by_distance(head: str, lines: Mapping[str, Sequence[str]], metric: str, at: Sequence[int], kept: Kept) -> str:
    """Returns the mean of a metric over training runs by distance.

    A line names a setting and an agent, or two agents, of which it shows the difference.
    """
    rows = []
    for text, (setting, *names) in lines.items():
        agents = [kept.of(name, setting) for name in names]
        cells = [_interval(metric, *(own[own.distance == distance] for own in agents)) for distance in at]
        rows.append([text, ", ".join(str(own.run.nunique()) for own in agents), *cells])
    return format_table([head, "runs", *map(str, at)], rows)


def by_row(head: str, rows: Mapping[str, tuple[str, str]], metrics: Sequence[str], kept: Kept) -> str:
    """Returns the means of metrics of an agent in a setting in each row, and the number of its episodes."""
    lines = [
        [text, str(len(own := kept.of(agent, setting))), *(_interval(metric, own) for metric in metrics)]
        for text, (agent, setting) in rows.items()
    ]
    return format_table([head, "episodes", *(METRICS[metric].title for metric in metrics)], lines)


def plans_in_words(kept: Kept) -> str:
    """Returns on-time rates of agents on the suite `llm-dev`, also where the path on the map is blocked."""
    rows, header = [], ["agent"]
    for agent in ("llm-bfs", "llm-told", "llm-hope", "navigator"):
        played = {name: kept.of(agent, f"{name}-words-{LLM_DEV}") for name in _IN_WORDS}
        cells, header = [f"`{agent}`"], ["agent"]
        for name, own in played.items():
            cells.append(_number(own[ON_TIME_125].mean()))
            header.append(f"`{name.replace('-', '` ')}")
            if own.blocked.any():
                cells.append(_number(own[own.blocked][ON_TIME_125].mean()))
                header.append("its blocked")
        answers = pd.concat(played.values()).notes.dropna().map(lambda notes: notes["decisions"])
        rows.append([*cells, f"{answers.mean():.1f}" if len(answers) else ""])
    return format_table([*header, "answers per episode"], rows)


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
        cells, quantile = [description, str(len(runs))], stats.t.ppf((1 + CONFIDENCE) / 2, len(runs) - 1)
        for distance in _PRINTED_DISTANCES:
            # The mean, with Student's interval if the runs differ.
            rates = runs[f"{SUCCESS}{distance}"]
            mean, half_width = rates.mean(), quantile * rates.sem()
            text = format_interval(Estimate(mean, max(mean - half_width, 0), min(mean + half_width, 1)))
            cells.append(text if rates.nunique() > 1 else _number(mean))
        for metric, form in metrics.items():
            cells.append(", ".join(format(value, form) for value in runs.reindex(columns=[metric])[metric].dropna()))
        rows.append(cells)
    logs = (name.replace("_", " ") for name in metrics)
    return format_table(["trained", "runs", *map(str, _PRINTED_DISTANCES), *logs], rows)


def by_agent(agents: Mapping[str, str], metric: str, kept: Kept) -> str:
    """Returns a row for each agent, with a metric at the levels of each track."""
    rows = [[text, *_levels(kept, agent, metric)] for agent, text in agents.items()]
    return format_table(["agent", *_TRACKS], rows)


def tracks_glance(kept: Kept) -> str:
    """Returns on-time rates at the levels of each track, with the highest rates of `_NOTHING_BY_HAND` below."""
    rows = [[text, *_levels(kept, agent, ON_TIME_125)] for agent, text in _GLANCE.items()]
    rates: dict[tuple[str, int], list[float]] = {}
    for agent in _NOTHING_BY_HAND:
        for track, level, own in kept.on_tracks(agent):
            rates.setdefault((track, level), []).append(own[ON_TIME_125].mean())
    best = [" / ".join(_number(max(rates[track, level])) for level in LEVELS) for track in STANDING]
    return format_table(["agent", *_TRACKS], [*rows, [_UNSOLVED, *best]])


def real_glance(kept: Kept) -> str:
    """Returns on-time rates in all real buildings, with the highest rates of `_NOTHING_BY_HAND` in the last row."""

    def rate(agent: str, setting: str) -> float | None:
        own = kept.find(agent, setting)
        return None if own is None else own[ON_TIME_125].mean()

    counts = [kept.of("navigator", setting).maze.nunique() for setting in _REAL_GLANCE]
    header = [f"{text} ({count})" for text, count in zip(_REAL_GLANCE.values(), counts, strict=True)]
    rows = []
    for agent, text in _GLANCE.items():
        if kept.find(agent, "right") is not None:
            rates = [rate(agent, setting) for setting in _REAL_GLANCE]
            rows.append([text, *("-" if each is None else _number(each) for each in rates)])
    found = [[rate(agent, setting) for agent in _NOTHING_BY_HAND] for setting in _REAL_GLANCE]
    best = [_number(max(each for each in rates if each is not None)) for rates in found]
    return format_table(["agent", *header], [*rows, [_UNSOLVED, *best]])


def by_track(columns: Mapping[str, tuple[str, str, Sequence[str]]], kept: Kept, head: str = "track") -> str:
    """Returns a row for each track; a column is of an agent and a metric in some kinds of mazes."""
    cells = [_levels(kept, *chosen) for chosen in columns.values()]
    return format_table([head, *columns], zip(_TRACKS, *cells, strict=True))


def tracks_learned(agent: str, kept: Kept) -> str:
    """Returns a learned agent's rates over its training runs, and the paired differences to the navigator."""
    rows = []
    for track, level, own in kept.on_tracks(agent):
        both = own, kept.of("navigator", f"{track}-{level}")
        columns = [(metric, *agents) for agents in ((own,), both) for metric in ("success_rate", ON_TIME_125)]
        rows.append([f"`{track}` {level}", str(own.run.nunique()), *itertools.starmap(_interval, columns)])
    header = ["setting", "runs", "success rate", "on-time rate", "success - `navigator`", "on-time rate - `navigator`"]
    return format_table(header, rows)


def tracks_map_worth(kept: Kept) -> str:
    """Returns the navigator's headline numbers with their intervals, and what the map is worth to it."""
    rows = []
    metrics = {"success_rate": "success", ON_TIME_2: METRICS[ON_TIME_2].title, ON_TIME_125: METRICS[ON_TIME_125].title}
    for track, level, own in kept.on_tracks("navigator"):
        both = own, kept.of("navigator without map", f"{track}-{level}")
        rows.append([f"`{track}` {level}", *(_interval(metric, own) for metric in metrics), *_compared(both)[1:]])
    return format_table(
        ["setting", *metrics.values(), f"without the map, {METRICS[ON_TIME_125].title}", "map worth"], rows
    )


def tracks_learned_worth(kept: Kept) -> str:
    """Returns the on-time rates of learned agents with the map and of those trained without it, and their difference.

    The latter are evaluated without the map, too.
    """
    rows = []
    for track, level, _ in kept.on_tracks(next(iter(_WITHOUT_MAP))):
        both = [
            [kept.of(name, f"{track}-{level}") for name in (agent, _WITHOUT_MAP[agent][1])] for agent in _WITHOUT_MAP
        ]
        rows.append([f"`{track}` {level}", *(cell for agents in both for cell in _compared(agents))])
    names = [name for name, _ in _WITHOUT_MAP.values()]
    header = [text for name in names for text in (name, f"{name} without the map", f"map worth, {name}")]
    return format_table(["setting", *header], rows)


def tracks_ceilings(kept: Kept) -> str:
    """Returns the on-time rates of the navigator without the map, and told more and more of the truth."""
    rows = []
    for track, level, own in kept.on_tracks("navigator without map"):
        told = [kept.of(*played) for played in ceilings(track, level).values()]
        believers = [kept.of(agent, f"{track}-{level}") for agent in _BELIEVERS]
        rows.append([f"`{track}` {level}", *(_number(each[ON_TIME_125].mean()) for each in (own, *told, *believers))])
    header = ["setting", "`navigator` without the map", *ceilings("building", 1), *(f"`{name}`" for name in _BELIEVERS)]
    return format_table(header, rows)


def tracks_headroom(kept: Kept) -> str:
    """Returns each agent's share of the headroom: 0 is the navigator without the map, and 1 the highest ceiling."""
    rows = []
    for agent in (
        "navigator",
        *_BELIEVERS,
        "neural-planner",
        "neural-planner from rewards",
        "dagger:Student",
        "sb3_agent:FieldPPOAgent",
    ):
        shares: dict[str, list[str]] = {track: [] for track in STANDING}
        for track, level, own in kept.on_tracks(agent):
            *_, told = ceilings(track, level).values()
            low, high = (
                each[ON_TIME_125].mean()
                for each in (kept.of("navigator without map", f"{track}-{level}"), kept.of(*told))
            )
            shares[track].append(_number((own[ON_TIME_125].mean() - low) / (high - low)))
        rows.append([_ROWS[agent], *(" / ".join(levels) or "-" for levels in shares.values())])
    return format_table(["agent", *_TRACKS], rows)


def tracks_memory(kept: Kept) -> str:
    """Returns the navigator's share on time at each goal of several, with and without memory, and their difference.

    Only legs count that begin in the goal before in both.
    """
    rows = []
    for level, goal in itertools.product(LEVELS, (1, 2, 3)):
        both = [kept.of(agent, f"rebuilt-{level}-goals") for agent in ("navigator", _WITHOUT_MEMORY)]
        legs = [own[own.leg.eq(goal) & ~own.after_miss.astype(bool)] for own in both]
        episodes = set.intersection(*(set(own.episode) for own in legs))
        cells = _compared([own[own.episode.isin(episodes)] for own in legs])
        rows.append([f"`rebuilt` {level}", str(goal), str(len(episodes)), *cells])
    header = ["setting", "goal", "legs", f"in a row, {METRICS[ON_TIME_125].title}", "without memory", "memory worth"]
    return format_table(header, rows)


def tracks_blocked(kept: Kept) -> str:
    """Returns the navigator's share on time where the shortest path on the map is open, and where it is blocked."""
    rows = []
    for track, level, own in kept.on_tracks("navigator"):
        if own.blocked.any():  # the maps of `building` are right
            groups = [own[own.blocked == is_blocked] for is_blocked in (False, True)]
            cells = [(str(len(each)), _interval(ON_TIME_125, each)) for each in groups]
            rows.append([f"`{track}` {level}", *cells[0], *cells[1]])
    open_path, blocked = (f"episodes, path on the map {name}" for name in ("open", "blocked"))
    return format_table(["setting", open_path, METRICS[ON_TIME_125].title, blocked, METRICS[ON_TIME_125].title], rows)


def real_on_time(kept: Kept, origins: Sequence[str]) -> str:
    """Returns agents' on-time rates in real buildings of some origins, with the maps that a robot would have."""

    def played(agent: str, setting: str) -> pd.DataFrame | None:
        own = kept.find(agent, setting)
        return None if own is None else own[own.kind.isin(origins)]

    header = [f"{text} ({played('navigator', name).maze.nunique()})" for name, text in _REAL_SETTINGS.items()]
    rows = []
    for agent, text in _IN_REAL_BUILDINGS.items():
        groups = [played(agent, setting) for setting in _REAL_SETTINGS]
        cells = ["-" if own is None else _interval(ON_TIME_125, own) for own in groups]
        rows += [[text, *cells]] * (set(cells) != {"-"})
    return format_table(["agent", *header], rows)


def real_maps(kept: Kept) -> str:
    """Returns what maps are worth to the navigator in real buildings that have changed, in the same episodes."""
    rows = []
    for setting, words in _REAL_SETTINGS.items():
        if kept.find("navigator", right := setting + WITH_RIGHT_MAP) is None:
            continue
        names = {"right": right, "old": setting, "none": setting + WITHOUT_MAP}
        own = {name: kept.of("navigator", group) for name, group in names.items()}
        rates = [_number(each[ON_TIME_125].mean()) for each in own.values()]
        more = [own[name].path_length.mean() - own["right"].path_length.mean() for name in ("old", "none")]
        costs = [_interval(ON_TIME_125, own[a], own[b]) for a, b in (("right", "old"), ("old", "none"))]
        num_buildings = own["old"].maze.nunique()
        rows.append([words, str(num_buildings), *rates, *costs, *(f"{metres:.1f}" for metres in more)])
    header = ["setting", "buildings", "right map", "old map", "no map", "right - old", "old - none"]
    return format_table([*header, "m more with the old map", "with none"], rows)


def real_buildings(kept: Kept) -> str:
    """Returns how many real buildings each setting has in each split, and how many of them robots scanned."""
    rows = []
    for setting in dict.fromkeys(each.setting for each in buildings().values()):
        counts = [
            [each for each in buildings().values() if (each.setting, each.split) == (setting, split)]
            for split in FROZEN_SPLITS
        ]
        cells = [f"{len(own)} ({sum(each.origin == SCAN for each in own)})" for own in counts]
        rows.append([f"`{setting}`", *cells, str(len({each.site for own in counts for each in own}))])
    return format_table(["setting", *(f"{split} (scans)" for split in FROZEN_SPLITS), "sites"], rows)


def real_sources(kept: Kept) -> str:
    """Returns the repositories from which maps of real buildings come, with their licences and the maps."""
    sources = pd.DataFrame(csv.DictReader(read_asset("sources.csv", REAL_BENCHMARK).splitlines()))
    rows = [
        [repository, ", ".join(sorted(set(own.licence))), ", ".join(own["name"])]
        for repository, own in sources.groupby("repository")
    ]
    return format_table(["repository", "licence", "maps"], rows)


def real_left_out(kept: Kept) -> str:
    """Returns the maps of which no building was made, and the changes that a building can't carry, by reason."""
    left_out = pd.DataFrame(csv.DictReader(read_asset("left_out.csv", REAL_BENCHMARK).splitlines()))
    rows = [[reason, ", ".join(own["map"])] for reason, own in left_out.groupby("reason")]
    return format_table(["reason", "maps"], rows)


def doors(kept: Kept) -> str:
    """Returns the table of the track `doors`: on time, success and seconds waited by level."""
    rows = []
    for text, agent in DOOR_AGENTS.items():
        levels = [kept.of(agent, f"doors-{level}") for level in LEVELS]
        on_time = [_interval(ON_TIME_125, own) for own in levels]
        success, waited = (
            " / ".join(f"{value:{form}}" for value in values)
            for values, form in (
                ([own.success.astype(float).mean() for own in levels], ".2f"),
                ([STEP_TIME * own.waited.astype(float).mean() for own in levels], ".1f"),
            )
        )
        rows.append([text, *on_time, success, waited])
    head = ["agent", *(f"on time, level {level}" for level in LEVELS), "success, 1 / 2 / 3", "s waited, 1 / 2 / 3"]
    return format_table(head, rows)


def expected_on_track(track: str, kept: Kept) -> str:
    """Returns each agent's on-time rate at the levels of a track with its interval, and its success rates."""
    rows = []
    for agent, text in _EXPECTED.items():
        levels = [kept.of(agent, f"{track}-{level}") for level in LEVELS]
        success = " / ".join(_number(own.success_rate.mean()) for own in levels)
        rows.append([text, *(_interval(ON_TIME_125, own) for own in levels), success])
    return format_table(["agent", *(f"on time, level {level}" for level in LEVELS), "success, 1 / 2 / 3"], rows)


def expected_hierarchical(kept: Kept) -> str:
    """Returns each agent's success rate and on-time rate from corner to corner, with a landmark every 5 cells."""
    agents = {text: kept.of(agent, "hierarchical-13-k5") for agent, text in _EXPECTED_LOCAL.items()}
    rows = [
        [text, *(_interval(metric, own) for metric in ("success_rate", ON_TIME_125))] for text, own in agents.items()
    ]
    return format_table(["agent", "success", METRICS[ON_TIME_125].title], rows)


def tracks_recall(kept: Kept) -> str:
    """Returns the recall of the poses that agents report, over episodes and at their ends."""
    rows = []
    for agent, (track, level) in itertools.product(RECALL_AGENTS, RECALL_SETTINGS):
        own = kept.of(agent, f"{track}-{level}-{RECALL}")
        rows.append([f"`{agent}`", f"`{track}` {level}", *(_interval(metric.name, own) for metric in RECALLS)])
    return format_table(["agent", "setting", *(metric.title for metric in RECALLS)], rows)


# By the name that a page gives.
TABLES: dict[str, Callable[[Kept], str]] = {
    "paper-runs": lambda kept: by_distance("agent", _LOCAL_RUNS, "success_rate", _PRINTED_DISTANCES, kept),
    "paper-runs-spl": lambda kept: by_distance("agent", _LOCAL_RUNS, "spl", _PRINTED_DISTANCES, kept),
    "mmn-sizes": lambda kept: by_distance("mazes", _SIZES, "success_rate", (*_PRINTED_DISTANCES, 12, 15), kept),
    "mah-curve": mah_curve,
    "mmn-ingredients": lambda kept: short_runs(_INGREDIENTS, {"model_error_1": ".3f", "map_ratio": ".1f"}, kept),
    "mmn-regimes": lambda kept: short_runs(_REGIMES, {}, kept),
    "tracks-glance": tracks_glance,
    "real-glance": real_glance,
    "tracks-success": lambda kept: by_agent(_ROWS, "success_rate", kept),
    "tracks-on-time": lambda kept: by_agent(_ROWS, ON_TIME_125, kept),
    "tracks-on-time-2": lambda kept: by_agent(_ROWS, ON_TIME_2, kept),
    "tracks-learned": lambda kept: tracks_learned("neural-planner", kept),
    "tracks-rewarded": lambda kept: tracks_learned("neural-planner from rewards", kept),
    "tracks-believer": lambda kept: tracks_learned("believer", kept),
    "tracks-believer-learned": lambda kept: tracks_learned("believer-learned", kept),
    "tracks-mapper": lambda kept: tracks_learned("neural-mapper", kept),
    "tracks-ppo": lambda kept: tracks_learned("sb3_agent:FieldPPOAgent", kept),
    "tracks-learned-worth": tracks_learned_worth,
    "tracks-ceilings": tracks_ceilings,
    "tracks-headroom": tracks_headroom,
    "tracks-ways": lambda kept: tracks_learned("mmn-paths", kept),
    "tracks-worst-tenth": lambda kept: by_agent(
        {name: _ROWS[name] for name in ("navigator", "neural-planner", "navigator without map")}, WORST_TENTH, kept
    ),
    "tracks-map-worth": tracks_map_worth,
    "tracks-blocked": tracks_blocked,
    "tracks-recall": tracks_recall,
    "doors": doors,
    "published": published,
    **{f"expected-{track}": functools.partial(expected_on_track, track) for track in STANDING},
    "expected-local": lambda kept: by_distance(
        "agent",
        {text: (LOCAL, agent) for agent, text in _EXPECTED_LOCAL.items()},
        "success_rate",
        _PRINTED_DISTANCES,
        kept,
    ),
    "expected-hierarchical": expected_hierarchical,
    "tracks-memory": tracks_memory,
    "real-scans": functools.partial(real_on_time, origins=(SCAN,)),
    "real-all": functools.partial(real_on_time, origins=ORIGINS),
    "real-maps": real_maps,
    "real-buildings": real_buildings,
    "real-sources": real_sources,
    "real-left-out": real_left_out,
    "tracks-novel-kinds": lambda kept: by_track(
        {
            f"`{agent}`, {name} layouts": (agent, ON_TIME_125, kinds)
            for agent in ("navigator", "neural-planner")
            for name, kinds in (("known", KNOWN), ("held-out", NOVEL))
        },
        kept,
    ),
    "tracks-navigator": lambda kept: by_track(
        {metric.title: ("navigator", metric.name, _KINDS) for metric in (SUCCESS_RATE, *ON_TIMES, SPL)}, kept
    ),
    "map-policy": lambda kept: by_row("setting", _MAP_POLICY, ("success_rate", ON_TIME_125, ON_TIME_2), kept),
    TURTLEBOT3: lambda kept: by_row("setting", _TURTLEBOT3, ("success_rate", ON_TIME_125, ON_TIME_2, "spl"), kept),
    "mmn-search": lambda kept: by_distance("simulations", _SEARCHES, "success_rate", (6, 8, 10, 12), kept),
    LLM_DEV: plans_in_words,
    "tracks-navigator-kinds": lambda kept: by_track(
        {f"`{kind}`": ("navigator", ON_TIME_125, (kind,)) for kind in _KINDS},
        kept,
        f"track, {METRICS[ON_TIME_125].title}",
    ),
}


def _levels(kept: Kept, agent: str, metric: str, kinds: Sequence[str] = _KINDS) -> list[str]:
    """Returns a metric's means at the levels of each track, as "0.75 / 0.50 / 0.25"; "-" without evaluations."""
    texts: dict[str, list[str]] = {track: [] for track in STANDING}
    for track, _, own in kept.on_tracks(agent):
        texts[track].append(_number(own[own.kind.isin(kinds)][metric].mean()))
    return [" / ".join(levels) or "-" for levels in texts.values()]


def _compared(both: Sequence[pd.DataFrame]) -> list[str]:
    """Returns the on-time rates of two agents, and their difference."""
    return [_interval(ON_TIME_125, *agents) for agents in (both[:1], both[1:], both)]


def _interval(metric: str, *agents: pd.DataFrame) -> str:
    return format_interval(estimate(metric, *agents))


def format_interval(mean: Estimate) -> str:
    """Returns a mean with its interval, as "0.50 [0.25, 0.75]"."""
    return f"{_number(mean.value)} [{_number(mean.low)}, {_number(mean.high)}]"


def _number(value: float) -> str:
    value = round(value, 9)  # means that differ by the order of their sum give the same two digits
    return f"{value:.2f}".replace("-0.00", "0.00")


def format_table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Returns a table in Markdown."""
    return "".join(f"| {' | '.join(line)} |\n" for line in (header, ["---"] * len(header), *rows))
