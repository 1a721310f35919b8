"""The scoreboard of the tracks: a table of agents, made from entries that are kept.

`python -m mazebench.report.scoreboard RESULTS... docs/scoreboard.md` keeps an entry of each agent in RESULTS in the
folder docs/scoreboard, one file each, and writes the table of all entries into the page, between two comments. The
entries of a page are of one benchmark. With `--check`, it says whether RESULTS are complete entries.
"""

from __future__ import annotations

import argparse
import hashlib
import pathlib
import re
import sys
from collections.abc import Iterable, Sequence

import pydantic

from mazebench.constants import ON_TIME
from mazebench.errors import InputError, describe_fault
from mazebench.maps.benchmark import load_kind_mazes, manifest_hash
from mazebench.report.table import escape_markdown
from mazebench.results.intervals import mean_interval
from mazebench.results.metrics import is_on_time
from mazebench.results.oracle import frozen_oracle_steps
from mazebench.results.reading import SUITE, Result, find_parts, load_result, read_suite
from mazebench.results.records import Name, Share, column
from mazebench.storage.files import make_folder, open_whole, read_at_most
from mazebench.storage.json_files import write_json
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.tracks.base import LEVELS
from mazebench.tasks.trials import frozen_trials

BEGIN, END = "<!-- scoreboard begins -->\n", "<!-- scoreboard ends -->\n"
UNTRAINED = "\\*"  # behind the success rates of an agent that learned on maps of another scale

_MAX_ENTRY_BYTES = 2**16
_PARTS = [f"{track} {level}" for track in TRACKS for level in LEVELS]


class _Kept(pydantic.BaseModel):
    """Base of what an entry's file holds."""

    model_config = pydantic.ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Part(_Kept):
    """The success rate in the frozen episodes of one track and level, and the share that are on time by each factor."""

    success_rate: Share
    on_time: dict[str, Share] = {}  # empty in entries of earlier versions
    untrained_scale: bool = False


class Configuration(_Kept):
    """What played."""

    package: str | None  # name and version; None for an agent of a file
    code_sha256: str  # of the package or the file; its first letters in entries read off an earlier page
    checkpoint_sha256: str | None  # None also in entries read off an earlier page


class Entry(_Kept):
    """The results of one agent on some of the tracks."""

    agent: Name
    privileged: bool
    benchmark: Name
    parts: dict[str, Part]  # by track and level, as "rebuilt 1"
    mean: tuple[Share, Share, Share] | None  # of all episodes, with its 95 % interval; None if parts are missing
    configurations: tuple[Configuration, ...]

    @property
    def file_name(self) -> str:
        """A name that entries of the same agent, code and checkpoints share."""
        played = [each.model_dump_json() for each in self.configurations]
        identity = hashlib.sha256("\n".join([self.agent, *sorted(played)]).encode()).hexdigest()
        return f"{re.sub(r'[^A-Za-z0-9_]+', '-', self.agent)}-{identity[:8]}.json"

    @property
    def score(self) -> float | None:
        """The share of all episodes on time by the smaller factor, which ranks the entry; None if parts are missing."""
        return None if self.mean is None else self.on_time(f"{ON_TIME[0]:g}")

    @property
    def missing(self) -> list[str]:
        """The parts that were not played."""
        return [part for part in _PARTS if part not in self.parts]

    def on_time(self, factor: str) -> float:
        """Returns the share of the episodes of all parts that are on time by a factor."""
        return sum(part.on_time[factor] for part in self.parts.values()) / len(self.parts)


def read_entries(paths: Iterable[pathlib.Path]) -> list[Entry]:
    """Returns the entries that folders of results make.

    Args:
      paths: runs of the suite `v3`, agents' folders in them, or folders with evaluations of one agent.

    Raises:
      InputError: if a folder holds anything else than one agent's results of whole tracks, each once.
    """
    return [_make_entry(folder) for path in paths for folder in _agents_folders(path)]


def kept_entries(page: pathlib.Path) -> list[Entry]:
    """Returns the entries that are kept beside a page, the highest score first, those without one last.

    Raises:
      InputError: if a file is not an entry.
    """
    entries = []
    for path in page.with_suffix("").glob("*.json"):
        try:
            entries.append(Entry.model_validate_json(read_at_most(path, _MAX_ENTRY_BYTES, "file")))
        except pydantic.ValidationError as error:
            raise InputError(f"{path}: expected an entry of the scoreboard, found {describe_fault(error)}") from error
    return sorted(entries, key=_rank)


def _rank(entry: Entry) -> tuple[float, float, bool, str, str]:
    """Returns what entries are sorted by; the success rate decides between equal scores."""
    score, success = (1.0, 0.0) if entry.score is None or entry.mean is None else (-entry.score, -entry.mean[0])
    return score, success, not entry.privileged, entry.agent, entry.file_name


def to_markdown(entries: Sequence[Entry]) -> str:
    """Returns the scoreboard as a table in Markdown."""
    lines = [["agent", "mean", "on time", *_PARTS, "configurations", "from"]]
    lines.append(["---"] * len(lines[0]))
    for entry in entries:
        name = escape_markdown(entry.agent) + (" (privileged)" if entry.privileged else "")
        rates = (_rate(entry, part) for part in _PARTS)
        lines.append([name, _mean(entry), _on_time(entry), *rates, str(len(entry.configurations)), _origin(entry)])
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def write_scoreboard(entries: Iterable[Entry], page: pathlib.Path) -> None:
    """Keeps `entries` beside `page`, and writes the table of all that are kept in the place of the one that is there.

    An entry replaces one of the same agent, code and checkpoints.

    Raises:
      InputError: if the page can't be read, or has no place for a scoreboard, an entry lacks parts of the one that it
        would replace, or the page would have entries of two benchmarks; no entry is kept then.
    """
    try:
        text = page.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{page}: can't read the page: {error}") from error
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise InputError(f"{page}: expected the lines {BEGIN.strip()} and {END.strip()}, found no such lines")
    kept = {entry.file_name: entry for entry in kept_entries(page)}
    for entry in (entries := list(entries)):
        if lost := [part for part in kept.get(entry.file_name, entry).parts if part not in entry.parts]:
            raise InputError(f"{entry.agent}: expected all parts of its entry in one folder, found none of {lost[0]}")
        kept[entry.file_name] = entry
    if len(benchmarks := {entry.benchmark for entry in kept.values()}) > 1:
        raise InputError(f"{page}: expected entries of one benchmark, found {' and '.join(sorted(benchmarks))}")
    make_folder(page.with_suffix(""))
    for entry in entries:
        write_json(page.with_suffix("") / entry.file_name, entry.model_dump(exclude_defaults=True))
    with open_whole(page) as file:
        file.write(f"{before}{begin}{to_markdown(kept_entries(page))}{end}{after}".encode())


def check(path: pathlib.Path) -> tuple[list[str], bool]:
    """Returns a line about each entry that a folder of results makes, and whether all are complete.

    Raises:
      InputError: if results are no entry.
    """
    lines, entries = [], []
    for folder in _agents_folders(path):
        entries.append(entry := _make_entry(folder))
        if entry.missing:
            found, missing = len(entry.parts), ", ".join(entry.missing)
            of = found + len(entry.missing)
            lines.append(f"{folder}: {found} of {of} parts of {entry.agent}, no mean; missing: {missing}")
        else:
            num_parts = len(entry.parts)
            lines.append(f"{folder}: a complete entry of {entry.agent}, all {num_parts} parts, mean {_mean(entry)}")
    return lines, not any(entry.missing for entry in entries)


def _agents_folders(path: pathlib.Path) -> list[pathlib.Path]:
    return [path / folder for folder in read_suite(path).folders.values()] if (path / SUITE).is_file() else [path]


def _make_entry(folder: pathlib.Path) -> Entry:
    results: dict[str, Result] = {}
    for result in map(load_result, find_parts(folder).values()):
        part = _part(result)
        if part in results:
            raise InputError(f"{folder}: expected one result of {part}, found two")
        results[part] = result
    summaries = [result.summary for result in results.values()]
    agents = sorted({summary.row for summary in summaries})
    if len(agents) > 1:
        raise InputError(f"{folder}: expected results of one agent, found those of {', '.join(agents)}")
    benchmarks = sorted({summary.benchmark for summary in summaries})
    if len(benchmarks) > 1:
        raise InputError(f"{folder}: expected results of one benchmark, found {' and '.join(benchmarks)}")
    mean = None
    if len(results) == len(_PARTS):  # each has as many episodes
        records = [record for result in results.values() for record in result.records]
        estimate = mean_interval(column(records, "success"), column(records, "maze"))
        mean = estimate.value, estimate.low, estimate.high
    return Entry(
        agent=agents[0],
        privileged=any(summary.privileged for summary in summaries),
        benchmark=benchmarks[0],
        parts={
            part: Part(
                success_rate=results[part].summary.overall.success_rate,
                on_time=_shares_on_time(results[part]),
                untrained_scale=results[part].summary.untrained_scale,
            )
            for part in _PARTS
            if part in results
        },
        mean=mean,
        configurations=tuple(dict.fromkeys(map(_configuration, results.values()))),
    )


def _shares_on_time(result: Result) -> dict[str, float]:
    """Returns the share of the frozen episodes that are on time, by factor; whatever the folder tells of the oracle."""
    size, benchmark, split = result.summary.size, result.summary.benchmark, result.summary.split
    trials = frozen_trials("local", size, benchmark, split)
    steps = frozen_oracle_steps(benchmark, "local", size, split, trials)
    assert steps is not None, "the oracle's steps are frozen with the episodes"
    return {f"{factor:g}": float(is_on_time(result.records, steps, factor).mean()) for factor in ON_TIME}


def _part(result: Result) -> str:
    """Returns track and level of a result; raises `InputError` if it is not of all their frozen episodes."""
    summary = result.summary
    part = f"{summary.track or summary.task} {summary.level or ''}".strip()
    benchmark = summary.benchmark
    if summary.track not in TRACKS or part not in _PARTS or summary.split != "eval":
        raise InputError(f"{result.folder}: expected eval episodes of a track, found {summary.split} {part}")
    if summary.senses:
        raise InputError(f"{result.folder}: expected the senses of the track, found {', '.join(summary.senses)}")
    if summary.provenance.benchmark_manifest_sha256 != manifest_hash(benchmark):
        raise InputError(f"{result.folder}: expected results of the installed benchmark, found those of another one")
    trials = frozen_trials("local", summary.size, benchmark, "eval")
    if summary.episodes != len(trials):
        raise InputError(f"{result.folder}: expected {len(trials)} episodes, found {summary.episodes}")
    mazes = load_kind_mazes("eval")
    for record, trial in zip(result.records, trials, strict=True):
        episode = trial.episode
        frozen = mazes[episode.maze].name, episode.start, episode.goal, episode.seed
        if (record.maze, record.start, record.goal, record.seed) != frozen:
            raise InputError(f"{result.folder}: expected the frozen episode {record.episode}, found another one")
    return part


def _configuration(result: Result) -> Configuration:
    origin = result.summary.provenance
    if origin.agent_code_sha256 is None:
        raise InputError(f"{result.folder}: expected the hash of the agent's code, found none; evaluate it again")
    return Configuration(
        package=origin.agent_package, code_sha256=origin.agent_code_sha256, checkpoint_sha256=origin.checkpoint_sha256
    )


def _rate(entry: Entry, name: str) -> str:
    """Returns the success rate and the share on time of a part; nothing for a part that was not played."""
    part = entry.parts.get(name)
    if part is None:
        return ""
    return f"{part.success_rate:.2f}, {part.on_time[f'{ON_TIME[0]:g}']:.2f}{UNTRAINED if part.untrained_scale else ''}"


def _mean(entry: Entry) -> str:
    if entry.mean is None:
        return ""
    value, low, high = entry.mean
    return f"{value:.2f} [{low:.2f}, {high:.2f}]"


def _on_time(entry: Entry) -> str:
    """Returns the shares of all episodes that are on time; nothing if parts are missing or don't tell."""
    parts = entry.parts.values()
    if entry.mean is None or not all(part.on_time for part in parts):
        return ""
    factors = next(iter(parts)).on_time
    return ", ".join(f"{entry.on_time(factor):.2f}" for factor in factors)


def _origin(entry: Entry) -> str:
    """Returns where the agent comes from: its package and version, or its file, and the hash of its code."""
    names = {f"{each.package or 'file'} {each.code_sha256[:8]}" for each in entry.configurations}
    return escape_markdown(", ".join(sorted(names)))


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command; bad input ends it with one line and status 2."""
    parser = argparse.ArgumentParser(
        prog="python -m mazebench.report.scoreboard",
        description="Adds results to the scoreboard in PAGE, or checks them.",
        usage="%(prog)s [RESULTS...] PAGE.md\n       %(prog)s --check RESULTS...",
    )
    parser.add_argument("--check", action="store_true", help="say whether RESULTS are complete entries; write nothing")
    about = "runs of the suite `v3`"
    parser.add_argument("paths", nargs="+", type=pathlib.Path, metavar="RESULTS", help=about)
    options = parser.parse_args(arguments)
    try:
        if options.check:
            checked = [check(path) for path in options.paths]
            print(*(line for lines, _ in checked for line in lines), sep="\n")
            sys.exit(0 if all(are_complete for _, are_complete in checked) else 1)
        else:
            *folders, page = options.paths
            write_scoreboard(read_entries(folders), page)
    except InputError as error:
        print(f"mazebench: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
