"""The leaderboard of the tracks: tables of agents, made from an entry per agent.

`python -m mazebench.report.leaderboard --author NAME --paper PAPER --link LINK RESULTS... docs/leaderboard.md` writes
an entry of each agent in RESULTS into the folder docs/leaderboard, one JSON file each, and the tables of all entries
there into the page, between two comments. A division holds the agents that observe the sensors of one suite, and no
others.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import pathlib
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
import pydantic

from mazebench.constants import STEP_TIME
from mazebench.errors import InputError
from mazebench.evaluation.suites import SUITES
from mazebench.maps.benchmark import KINDS_SIZE, load_kind_mazes, manifest_hash
from mazebench.report.table import escape_markdown, to_markdown
from mazebench.results.intervals import mean_interval
from mazebench.results.metrics import ON_TIMES
from mazebench.results.naming import noise_in_words, sensors_in_words, title_of
from mazebench.results.reading import SUITE, SUMMARY, Result, find_parts, load_result, read_model, read_suite
from mazebench.results.records import Name, Share, column
from mazebench.storage.files import make_folder, open_file
from mazebench.storage.json_files import write_json
from mazebench.tasks.tracks import LEVELS, STANDING
from mazebench.tasks.trials import frozen_trials
from mazebench.world.bodies import SLIDER
from mazebench.world.looks import LOOKS_VERSION, VARIED

BEGIN, END = "<!-- leaderboard begins -->\n", "<!-- leaderboard ends -->\n"
PARTS = [f"{track} {level}" for track in STANDING for level in LEVELS]
LIDAR, CAMERA = "lidar", "camera"
SUITE_OF = {LIDAR: "tracks", CAMERA: "tracks-camera"}  # by division
DIVISIONS = {sensors_in_words(SUITES[suite][0].task): division for division, suite in SUITE_OF.items()}  # by sensors
FOLDED = 0.05  # rows with a lower on-time rate are folded
NO_PAPER = "none"  # in the place of a paper


_ADDRESS = re.compile(r"https?://[^\s()]+")


class Credit(NamedTuple):
    """Whose agent it is."""

    author: str
    paper: str  # that the agent follows, as "Schulman et al. 2017, https://...", or `NO_PAPER`
    link: str  # the agent's page or code: an address, or a file next to the leaderboard's page


class Entry(pydantic.BaseModel):
    """The results of one agent on all parts of the tracks."""

    agent: Name
    author: Name
    paper: Name
    link: Name
    division: str = LIDAR
    privileged: bool
    code: tuple[Name, ...]  # package and version, or "file", and the SHA-256 of the code or "without hash"
    checkpoints: tuple[str, ...]  # SHA-256
    on_time: tuple[Share, Share, Share]  # of all episodes, with its 95 % interval
    success: Share  # of all episodes
    date: datetime.date  # of the evaluation: that of its newest summary
    parts: dict[str, tuple[Share, Share]]  # on time, and success, by track and level, as "rebuilt 1"


def read_entries(paths: Iterable[pathlib.Path], credit: Credit) -> list[Entry]:
    """Returns the entries of runs of a division's suite, of agents' folders in them, or of folders with its parts.

    All of them get the same `credit`.

    Raises:
      InputError: if an agent's folder holds anything else than its results of all parts, each once.
    """
    entries = []
    for path in paths:
        names = read_suite(path).folders.values() if (path / SUITE).is_file() else [""]
        entries += [_make_entry(path / name, credit) for name in names]
    return entries


def kept_entries(page: pathlib.Path) -> list[Entry]:
    """Returns the entries that are kept next to a page, the highest on-time rate first; of equals, by success.

    Raises:
      InputError: if a file there is no entry, such as one without author, paper and link.
    """
    entries = [read_model(path, Entry, "an entry") for path in sorted(page.with_suffix("").glob("*.json"))]
    return sorted(entries, key=lambda entry: (-entry.on_time[0], -entry.success, entry.agent))


def make_tables(entries: Sequence[Entry]) -> str:
    """Returns the leaderboard in Markdown: the tables of each division that has entries."""
    of_divisions = {name: [entry for entry in entries if entry.division == name] for name in DIVISIONS.values()}
    return "\n".join(f"## Division {name}\n\n{_tables_of(own)}" for name, own in of_divisions.items() if own)


def _tables_of(entries: Sequence[Entry]) -> str:
    """Returns the tables of a division; rows below `FOLDED` are in tables of their own, which readers unfold."""
    # Agents with the same on-time rate in two digits share a rank.
    rates = pd.Series([round(entry.on_time[0], 2) for entry in entries], dtype=float)
    ranks = rates.rank(method="min", ascending=False).astype(int).tolist()
    # Gains are over the navigator without the map.
    floor = next((entry.on_time[0] for entry in entries if entry.agent == "navigator without map"), np.nan)
    num_open = int((rates >= FOLDED).sum())
    text = _tables_of_rows(entries[:num_open], ranks[:num_open], floor) if num_open else ""
    if folded := entries[num_open:]:
        summary = f"On-time rate below {FOLDED}: {len(folded)} agent{'s' * (len(folded) > 1)}"
        tables = _tables_of_rows(folded, ranks[num_open:], floor)
        space = "\n" * (num_open > 0)
        text += f'{space}<details markdown="1">\n<summary>{summary}</summary>\n\n{tables}\n</details>\n'
    return text


def _tables_of_rows(entries: Sequence[Entry], ranks: Sequence[int], floor: float) -> str:
    """Returns a table of all episodes, and two of the parts, on time and success."""
    names = [escape_markdown(entry.agent) + " (privileged)" * entry.privileged for entry in entries]
    overall = {
        "agent": names,
        "on-time rate": ["{:.2f} [{:.2f}, {:.2f}]".format(*entry.on_time) for entry in entries],
        "gain": [f"{entry.on_time[0] - floor:+.2f}".replace("+nan", "") for entry in entries],
        "success": [f"{entry.success:.2f}" for entry in entries],
        "author": [escape_markdown(entry.author) for entry in entries],
        "paper": ["" if entry.paper == NO_PAPER else _linked(entry.paper) for entry in entries],
        "link": [f"[page]({entry.link})" for entry in entries],
        "code": [escape_markdown(", ".join(re.sub(r"\w{56}$", "", each) for each in entry.code)) for entry in entries],
        "date": [entry.date.isoformat() for entry in entries],
    }
    on_time, success = (
        {"agent": names} | {part: [f"{entry.parts[part][index]:.2f}" for entry in entries] for part in PARTS}
        for index in (0, 1)
    )
    index = pd.Index(ranks)
    tables = (
        to_markdown(pd.DataFrame(table, index=index).rename_axis(columns="rank"))
        for table in (overall, on_time, success)
    )
    return "{}\nOn-time rate by track and level:\n\n{}\nSuccess rate by track and level:\n\n{}".format(*tables)


def _linked(paper: str) -> str:
    """Returns a paper in Markdown: its name leads to the address behind it."""
    name, _, address = paper.rpartition(", ")
    if not _ADDRESS.fullmatch(address):
        return escape_markdown(paper)
    return f"[{escape_markdown(name) or 'paper'}]({address})"


def write_leaderboard(entries: Iterable[Entry], page: pathlib.Path) -> None:
    """Keeps `entries` next to `page`, and replaces the tables in it by those of all that are kept.

    Raises:
      InputError: if the page can't be read, or has no place for the tables; no entry is kept then.
    """
    with open_file(page, "page") as file:
        text = file.read().decode()
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise InputError(f"{page}: expected the lines {BEGIN.strip()} and {END.strip()}, found no such lines")
    make_folder(page.with_suffix(""))
    for entry in entries:
        # Entries of the same agent, code, checkpoints and division share a name.
        key = [entry.agent, *entry.code, *entry.checkpoints, *([] if entry.division == LIDAR else [entry.division])]
        identity = hashlib.sha256("\n".join(key).encode()).hexdigest()
        name = f"{re.sub(r'[^A-Za-z0-9_]+', '-', entry.agent)}-{identity[:8]}.json"
        write_json(page.with_suffix("") / name, entry.model_dump(mode="json"))
    page.write_text(f"{before}{begin}{make_tables(kept_entries(page))}{end}{after}", encoding="utf-8")


def _make_entry(folder: pathlib.Path, credit: Credit) -> Entry:
    results = [load_result(part) for part in find_parts(folder).values()]
    summaries = [result.summary for result in results]
    if len(agents := sorted({summary.row for summary in summaries})) > 1:
        raise InputError(f"{folder}: expected results of one agent, found those of {', '.join(agents)}")
    episodes = pd.concat(map(_read_episodes, results))
    if sorted(title_of(summary.task) for summary in summaries) != sorted(PARTS):
        found = ", ".join(title_of(summary.task) for summary in summaries)
        raise InputError(f"{folder}: expected one result of each of {', '.join(PARTS)}, found {found}")

    sensors = sensors_in_words(summaries[0].task)
    if sensors not in DIVISIONS:
        divisions = " or ".join(f"{each} (division {name})" for each, name in DIVISIONS.items())
        raise InputError(f"{folder}: expected the sensors {divisions}, found {sensors}")

    mean = mean_interval(episodes.on_time.to_numpy(float), episodes.maze.to_numpy())
    parts = episodes.groupby("part")[["on_time", "success"]].mean()
    origins = [summary.provenance for summary in summaries]
    return Entry(
        agent=agents[0].replace(f" with {sensors}", ""),
        **credit._asdict(),
        division=DIVISIONS[sensors],
        privileged=any(summary.privileged for summary in summaries),
        code=tuple(
            sorted(
                {f"{origin.agent_package or 'file'} {origin.agent_code_sha256 or 'without hash'}" for origin in origins}
            )
        ),
        checkpoints=tuple(sorted({origin.checkpoint_sha256 for origin in origins if origin.checkpoint_sha256})),
        on_time=(mean.value, mean.low, mean.high),
        success=episodes.success.mean(),
        date=max(datetime.date.fromtimestamp((each.folder / SUMMARY).stat().st_mtime) for each in results),
        parts={part: tuple(parts.loc[part]) for part in PARTS},
    )


def _read_episodes(result: Result) -> pd.DataFrame:
    """Returns the `part`, `maze`, `success` and `on_time` of all frozen episodes of a part; refuses other episodes."""
    summary, records = result.summary, result.records
    task, provenance = summary.task, summary.provenance
    if title_of(task) not in PARTS or task.split_in_results != "eval" or noise_in_words(task):
        found = " ".join([task.split_in_results, title_of(task), *noise_in_words(task)])
        raise InputError(f"{result.folder}: expected eval episodes of a track, with its senses, found {found}")
    if provenance.benchmark_manifest_sha256 != manifest_hash(summary.benchmark):
        raise InputError(f"{result.folder}: expected results of the installed benchmark, found those of another one")
    if task.look == VARIED and provenance.looks_version != LOOKS_VERSION:
        found = f"version {provenance.looks_version or 1}"
        raise InputError(f"{result.folder}: expected pictures in version {LOOKS_VERSION} of the looks, found {found}")
    mazes, trials = load_kind_mazes("eval"), frozen_trials("local", KINDS_SIZE, task.benchmark, "eval")
    episodes = [(trial.episode, trial.oracle_steps) for trial in trials]
    frozen = [(mazes[each.maze].name, each.start, each.goal, each.seed, steps) for each, steps in episodes]
    if [(each.maze, each.start, each.goal, each.seed, each.oracle_steps) for each in records] != frozen:
        raise InputError(f"{result.folder}: expected the {len(frozen)} frozen episodes, found others")

    # What is faster than the physics lets a body be was moved by something else. A metre is left for the goal's size.
    success, seconds = column(records, "success"), STEP_TIME * column(records, "steps")
    driven = np.maximum(column(records, "path_length"), success * (column(records, "shortest_path") - 1))
    if (too_fast := driven > SLIDER.fastest * seconds).any():
        number = int(too_fast.argmax())
        found = f"{driven[number]:.1f} m in {seconds[number]:.1f} s in episode {number}"
        raise InputError(f"{result.folder}: expected bodies of at most {SLIDER.fastest:.1f} m/s, found {found}")

    on_time = ON_TIMES[0].of(records)
    return pd.DataFrame(
        {"part": title_of(task), "maze": column(records, "maze"), "success": success, "on_time": on_time}
    )


def check_credit(given: Mapping[str, str], page: pathlib.Path) -> Credit:
    """Returns author, paper and link of an agent.

    Raises:
      InputError: if one is missing, or the link is neither an address nor a file next to `page`.
    """
    if missing := [f"--{name}" for name in Credit._fields if not given.get(name, "").strip()]:
        expected = "--author NAME, --paper 'AUTHORS YEAR, ADDRESS' (or none) and --link ADDRESS"
        raise InputError(f"expected {expected}, found no {' and no '.join(missing)}")
    credit = Credit(**{name: given[name].strip() for name in Credit._fields})
    if not _ADDRESS.fullmatch(credit.link) and not (page.parent / credit.link.partition("#")[0]).is_file():
        raise InputError(
            f"--link: expected an address as https://... or a page in {page.parent}, found {credit.link[:80]!r}"
        )
    return credit


def main(*arguments: str) -> None:
    """Runs the command; bad input ends it with one line and status 2."""
    parser = argparse.ArgumentParser(prog="python -m mazebench.report.leaderboard", allow_abbrev=False)
    parser.add_argument("--author", default="", help="whose agent it is")
    parser.add_argument("--paper", default="", help="the paper that it follows, as 'AUTHORS YEAR, ADDRESS', or none")
    parser.add_argument("--link", default="", help="the address of its page or code, or a page of the documentation")
    parser.add_argument("results", nargs="+", type=pathlib.Path, help="folders of results")
    parser.add_argument("page", type=pathlib.Path, metavar="PAGE.md", help="with the tables")
    given = parser.parse_args(arguments)
    try:
        entries = read_entries(given.results, check_credit(vars(given), given.page))
        write_leaderboard(entries, given.page)
    except InputError as error:
        print(f"mazebench: {error}", file=sys.stderr)
        sys.exit(2)
    for entry in entries:
        print(f"{entry.agent}: on-time rate {entry.on_time[0]:.2f}, success {entry.success:.2f}; in {given.page}")


if __name__ == "__main__":
    main(*sys.argv[1:])
