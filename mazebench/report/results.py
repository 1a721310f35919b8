"""Results as the report uses them: the records in columns, the setting, and a label for each agent.

`E` is the number of episodes of a result.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Iterable, Sequence

import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.maps.benchmark import TRACKS_VERSION, VERSION, manifest_hash
from mazebench.report.folders import Warn, find_folders
from mazebench.report.settings import Setting, make_setting
from mazebench.results.metrics import by_fact
from mazebench.results.reading import load_result
from mazebench.results.records import Record, Summary, column
from mazebench.results.trajectories import TRAJECTORIES, Trajectories, load_trajectories

# Of each episode.
METRICS = {"success_rate": "success rate", "spl": "SPL", "spl_grid": "SPL by grid distance"}


@dataclasses.dataclass(frozen=True)
class Episodes:
    """The records of a result, in columns."""

    maze: np.ndarray  # [E] int, index among `mazes`
    mazes: tuple[str, ...]  # names, in the order in which they come up
    start: np.ndarray  # [E, 2] int, cells
    goal: np.ndarray  # [E, 2] int
    distance: np.ndarray  # [E] int, cells
    success: np.ndarray  # [E] bool
    steps: np.ndarray  # [E] int
    path_length: np.ndarray  # [E] m
    shortest_path: np.ndarray  # [E] m
    spl: np.ndarray  # [E]
    spl_grid: np.ndarray  # [E]
    seed: np.ndarray  # [E] int
    facts: dict[str, np.ndarray]  # [E] bool by what holds in these episodes of a track, as "blocked" and "not blocked"

    def __len__(self) -> int:
        return len(self.success)

    def values(self, metric: str) -> np.ndarray:
        """Returns `[E]` float: the values of which a metric is the mean."""
        return self.success.astype(np.float64) if metric == "success_rate" else getattr(self, metric)


@dataclasses.dataclass(frozen=True)
class ReportedResult:
    """A finished evaluation that a report is made from."""

    folder: pathlib.Path
    summary: Summary
    label: str  # the agent's name in the report, with more where the name alone is ambiguous
    setting: Setting
    episodes: Episodes
    trajectories: Trajectories | None  # None if none were recorded

    @property
    def name(self) -> str:
        """The agent's name, marked if the agent is privileged."""
        return self.summary.agent + (" (privileged)" if self.summary.privileged else "")

    @property
    def checkpoint(self) -> str | None:
        """The SHA-256 of the checkpoint."""
        return self.summary.provenance.checkpoint_sha256

    @property
    def seed(self) -> int:
        """The seed of the run."""
        return self.summary.provenance.options.seed

    @property
    def benchmark(self) -> tuple[str, str]:
        """The benchmark's version and the SHA-256 of its manifest."""
        return self.summary.benchmark, self.summary.provenance.benchmark_manifest_sha256 or ""


def read_results(
    paths: Iterable[pathlib.Path], warn: Warn, names: Sequence[tuple[str, str]] = ()
) -> list[ReportedResult]:
    """Returns all results at or below `paths`, one for each agent and setting, with labels; at least one.

    Args:
      paths: evaluation folders, or folders above them.
      warn: called with one line about each thing that is skipped.
      names: what agents are called in the report: pairs of a name and an agent, or the folder of an agent's results.

    Raises:
      InputError: if there is no result, some are not of the installed benchmark, or a name fits no agent.
    """
    results = []
    for folder in find_folders(paths, warn):
        try:
            results.append(_read_result(folder, warn))
        except InputError as error:
            warn(f"{error}; skipped")
    if not results:
        where = ", ".join(map(str, paths))
        raise InputError(f"expected results of `mazebench eval` or `mazebench train` in {where}, found none to report")
    _require_installed_benchmark(results)
    return _drop_repeats(_label(_rename(results, names)), warn)


def _read_result(folder: pathlib.Path, warn: Warn) -> ReportedResult:
    result = load_result(folder)
    try:
        setting = make_setting(result.summary, result.records)
    except InputError as error:
        raise InputError(f"{folder}: {error}") from error
    episodes = _to_columns(result.records)
    trajectories = _read_trajectories(folder, episodes, setting, warn)
    return ReportedResult(folder, result.summary, result.summary.agent, setting, episodes, trajectories)


def _to_columns(records: tuple[Record, ...]) -> Episodes:
    names = [field.name for field in dataclasses.fields(Episodes) if field.name not in ("maze", "mazes", "facts")]
    mazes = tuple(dict.fromkeys(record.maze for record in records))
    index = {name: number for number, name in enumerate(mazes)}
    columns = {name: column(records, name) for name in names}
    maze = np.array([index[record.maze] for record in records])
    return Episodes(maze=maze, mazes=mazes, facts=by_fact(records), **columns)


def _read_trajectories(folder: pathlib.Path, episodes: Episodes, setting: Setting, warn: Warn) -> Trajectories | None:
    """Returns the trajectories if the folder has some that fit the records."""
    path = folder / TRAJECTORIES
    if not path.exists():
        return None
    try:
        trajectories = load_trajectories(path, len(episodes))
    except InputError as error:
        warn(f"{error}; reported without paths")
        return None
    if trajectories.size != setting.size or not np.array_equal(trajectories.length, episodes.steps + 1):
        warn(f"{path}: expected a pose for the start and for each step, found others; reported without paths")
        return None
    return trajectories


def _rename(results: list[ReportedResult], names: Sequence[tuple[str, str]]) -> list[ReportedResult]:
    agents = [result.summary.agent for result in results]
    renamed = list(agents)
    for name, what in names:
        folder = pathlib.Path(what).resolve()
        chosen = [place for place, agent in enumerate(agents) if agent == what] or [
            place for place, result in enumerate(results) if result.folder.resolve().is_relative_to(folder)
        ]
        if not chosen:
            raise unknown("agent or folder", what, set(agents))
        for place in chosen:
            renamed[place] = name
    for name, _ in names:
        called = sorted({agent for agent, now in zip(agents, renamed, strict=True) if now == name})
        if len(called) > 1:
            raise InputError(f"expected one agent called {name!r}, found {', '.join(called)}")
    return [
        dataclasses.replace(result, summary=result.summary.model_copy(update={"agent": name}))
        for result, name in zip(results, renamed, strict=True)
    ]


def _label(results: list[ReportedResult]) -> list[ReportedResult]:
    """Returns the results with labels that tell all agents apart: by checkpoint and seed where names are equal."""
    labelled = []
    for result in results:
        namesakes = [other for other in results if other.name == result.name]
        label = result.name
        if len({other.checkpoint for other in namesakes}) > 1:
            label += f" {result.checkpoint[:6]}" if result.checkpoint else " without checkpoint"
        if len({other.seed for other in namesakes}) > 1:
            label += f" seed {result.seed}"
        labelled.append(dataclasses.replace(result, label=label))
    return labelled


def _drop_repeats(results: list[ReportedResult], warn: Warn) -> list[ReportedResult]:
    """Returns one result for each agent and setting: the one with the most episodes, the first of equals."""
    kept: dict[tuple[str, Setting], ReportedResult] = {}
    for result in results:
        other = kept.setdefault((result.label, result.setting), result)
        if other is result:
            continue
        more, less = (result, other) if len(result.episodes) > len(other.episodes) else (other, result)
        warn(f"{less.folder}: {less.label}, {less.setting} again, as in {more.folder}; skipped")
        kept[result.label, result.setting] = more
    return list(kept.values())


def _require_installed_benchmark(results: list[ReportedResult]) -> None:
    installed = [(version, manifest_hash(version)) for version in (VERSION, TRACKS_VERSION)]
    folders: dict[tuple[str, str], list[str]] = {}
    for result in results:
        folders.setdefault(result.benchmark, []).append(str(result.folder))
    if set(folders) <= set(installed):
        return
    which = "; ".join(f"{_name(benchmark)} in {_some(folders[benchmark])}" for benchmark in sorted(folders))
    raise InputError(f"expected results of benchmark {' or '.join(map(_name, installed))}, found {which}")


def _name(benchmark: tuple[str, str]) -> str:
    return f"{benchmark[0][:40]!r} (manifest {benchmark[1][:8] or 'unknown'})"


def _some(names: list[str], most: int = 5) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
