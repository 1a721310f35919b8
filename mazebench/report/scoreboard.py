"""The scoreboard of the tracks: one table of agents, made from the folders of their results.

`python -m mazebench.report.scoreboard RESULTS... docs/scoreboard.md` writes it into a page, between two comments.
"""

from __future__ import annotations

import dataclasses
import pathlib
import sys
from collections.abc import Iterable, Sequence

from mazebench.errors import InputError, remark
from mazebench.evaluation.intervals import Estimate, mean_interval
from mazebench.evaluation.records import Summary, column
from mazebench.evaluation.results import SUITE, Result, find_parts, load_result, read_suite
from mazebench.evaluation.trials import frozen_trials
from mazebench.maps.benchmark import TRACKS_VERSION, manifest_hash
from mazebench.report.table_forms import escape_markdown
from mazebench.storage.files import open_whole
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.tracks.base import LEVELS

BEGIN, END = "<!-- scoreboard begins -->\n", "<!-- scoreboard ends -->\n"
UNTRAINED = "\\*"  # behind the success rates of an agent that learned on maps of another scale

_PARTS = tuple((track, level) for track in TRACKS for level in LEVELS)


@dataclasses.dataclass(frozen=True)
class Entry:
    """The results of one agent on some of the tracks, by track and level."""

    agent: str
    results: dict[tuple[str, int], Result]

    @property
    def mean(self) -> Estimate | None:
        """The success rate in all episodes of all tracks and levels, each with as many; None if some are missing."""
        if len(self.results) < len(_PARTS):
            return None
        records = [record for result in self.results.values() for record in result.records]
        return mean_interval(column(records, "success"), column(records, "maze"))

    @property
    def summaries(self) -> list[Summary]:
        """The summaries of all results."""
        return [result.summary for result in self.results.values()]


def read_entries(paths: Iterable[pathlib.Path]) -> list[Entry]:
    """Returns the entries in some folders, the highest mean first, those without one last.

    Args:
      paths: runs of the suite `tracks`, agents' folders in them, or folders with evaluations of one agent.

    Raises:
      InputError: if a folder holds anything else than one agent's results of whole tracks, each once.
    """
    entries = [_read_entry(folder) for path in paths for folder in _agents_folders(path)]
    return sorted(entries, key=lambda entry: (-entry.mean.value if entry.mean else 1.0, entry.agent))


def to_markdown(entries: Sequence[Entry]) -> str:
    """Returns the scoreboard as a table in Markdown."""
    names = (f"{track} {level}" for track, level in _PARTS)
    lines = [["agent", "mean", *names, "configurations", "from"]]
    lines.append(["---"] * len(lines[0]))
    for entry in entries:
        rates = (_rate(entry.results.get(part)) for part in _PARTS)
        lines.append([_name(entry), _mean(entry.mean), *rates, str(len(_configurations(entry))), _origin(entry)])
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def write_scoreboard(entries: Sequence[Entry], page: pathlib.Path) -> None:
    """Writes the scoreboard into `page`, in the place of the one that is there.

    Raises:
      InputError: if the page can't be read, or has no place for a scoreboard.
    """
    try:
        text = page.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{page}: can't read the page: {error}") from error
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise InputError(f"{page}: expected the lines {BEGIN.strip()} and {END.strip()}, found no such lines")
    with open_whole(page) as file:
        file.write(f"{before}{begin}{to_markdown(entries)}{end}{after}".encode())


def _agents_folders(path: pathlib.Path) -> list[pathlib.Path]:
    return [path / folder for folder in read_suite(path).folders.values()] if (path / SUITE).is_file() else [path]


def _read_entry(folder: pathlib.Path) -> Entry:
    results: dict[tuple[str, int], Result] = {}
    for result in map(load_result, find_parts(folder).values()):
        part = _part(result)
        if part in results:
            raise InputError(f"{folder}: expected one result of {part[0]} {part[1]}, found two")
        results[part] = result
    agents = sorted({result.summary.agent for result in results.values()})
    if len(agents) > 1:
        raise InputError(f"{folder}: expected results of one agent, found those of {', '.join(agents)}")
    return Entry(agents[0], results)


def _part(result: Result) -> tuple[str, int]:
    """Returns track and level of a result; raises `InputError` if it is not of all their frozen episodes."""
    summary = result.summary
    part = (summary.track or summary.task, summary.level or 0)
    if part not in _PARTS or summary.split != "eval":
        raise InputError(f"{result.folder}: expected eval episodes of a track, found {summary.split} {part[0]}")
    if summary.provenance.benchmark_manifest_sha256 != manifest_hash(TRACKS_VERSION):
        raise InputError(f"{result.folder}: expected results of the installed benchmark, found those of another one")
    expected = len(frozen_trials("local", summary.size, TRACKS_VERSION))
    if summary.episodes != expected:
        raise InputError(f"{result.folder}: expected {expected} episodes, found {summary.episodes}")
    return part


def _name(entry: Entry) -> str:
    privileged = any(summary.privileged for summary in entry.summaries)
    return escape_markdown(entry.agent) + (" (privileged)" if privileged else "")


def _rate(result: Result | None) -> str:
    if result is None:
        return ""
    return f"{result.summary.overall.success_rate:.2f}{UNTRAINED if result.summary.untrained_scale else ''}"


def _mean(mean: Estimate | None) -> str:
    return "" if mean is None else f"{mean.value:.2f} [{mean.low:.2f}, {mean.high:.2f}]"


def _configurations(entry: Entry) -> set[tuple[str | None, str | None]]:
    """Returns what played: the hashes of checkpoints, and of the files of agents that are not installed."""
    origins = [summary.provenance for summary in entry.summaries]
    is_file = ":" in entry.agent
    return {(origin.checkpoint_sha256, origin.agent_code_sha256 if is_file else None) for origin in origins}


def _origin(entry: Entry) -> str:
    """Returns where the agent comes from: its package and version, or its file, and the hash of its code."""
    origins = [summary.provenance for summary in entry.summaries]
    parts = [(each.agent_package or "file", (each.agent_code_sha256 or "")[:8]) for each in origins]
    names = {" ".join(filter(None, each)) for each in parts}
    return escape_markdown(", ".join(sorted(names)))


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit("usage: python -m mazebench.report.scoreboard RESULTS... PAGE.md")
    *folders, target = map(pathlib.Path, sys.argv[1:])
    try:
        write_scoreboard(read_entries(folders), target)
    except InputError as error:
        remark(str(error))
        sys.exit(2)
