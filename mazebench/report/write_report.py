"""A report: the folder with tables, figures and the page."""

from __future__ import annotations

import contextlib
import os
import pathlib
from collections.abc import Iterator, Sequence

import pandas as pd

from mazebench.errors import held_remarks, remark
from mazebench.report.episodes import ReportedResult, join_episodes, read_results
from mazebench.report.figures import draw_distributions, draw_several_tables, draw_table, save
from mazebench.report.page import build_page
from mazebench.report.report_files import FIGURES, PAGE, TABLES, new_report, write_text
from mazebench.report.table import latex_name, to_csv, to_latex, to_markdown
from mazebench.report.tables import build_tables
from mazebench.report.trajectory_figures import draw_trajectories

_PACKAGES = ("mazebench-mujoco", "mujoco", "numpy", "torch")  # in provenance


def write_report(
    paths: Sequence[pathlib.Path], out: pathlib.Path, names: Sequence[tuple[str, str]] = ()
) -> list[ReportedResult]:
    """Writes the report of all results at or below `paths` to the folder `out`, and returns the results.

    It warns with a `Remark` of each thing that is skipped; the report lists these remarks too.

    Args:
      paths: evaluation folders, runs of suites, or folders above them.
      out: an empty or new folder, or one with an earlier report, which is replaced.
      names: what agents are called, as `read_results` takes it.

    Raises:
      InputError: if there is nothing to report, or `out` can't be used.
    """
    with _noting_remarks() as notes:
        results = read_results(paths, names)
    episodes = join_episodes(results)
    labels = list(episodes.label.cat.categories)
    tables = build_tables(episodes)
    figures = [draw_table(table, labels) for table in tables if table.x]
    figures += [*draw_several_tables(tables, labels), *draw_distributions(episodes)]
    benchmarks = " and ".join(sorted({result.summary.benchmark for result in results}))
    head = (
        f"Benchmark {benchmarks}; {', '.join(labels)}; {counted(len(episodes), 'episode')} in "
        f"{counted(len(results), 'result')}."
    )
    provenance = provenance_of(results)
    with new_report(out):
        for table in tables:
            text = "\n".join(to_markdown(table.wide(metric)) for metric in table.metrics)
            write_text(out / TABLES / f"{table.name}.md", text)
            write_text(out / TABLES / f"{table.name}.csv", to_csv(table))
            for metric in table.metrics:
                write_text(out / TABLES / f"{latex_name(table, metric)}.tex", to_latex(table, metric))
        for drawn in (*figures, *draw_trajectories(episodes)):
            save(drawn.figure, out / FIGURES / drawn.name)
        write_text(out / PAGE, build_page(results, head, tables, figures, provenance, notes))
    return results


def counted(count: int, noun: str) -> str:
    """Returns "1 result" or "2 results"."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def provenance_of(results: Sequence[ReportedResult]) -> pd.DataFrame:
    """Returns where results come from, as texts; results that differ only in what was evaluated share a row."""
    origins = pd.DataFrame(map(_origin, results))
    said = [name for name in origins if name not in ("results", "episodes", "in")]
    rows = origins.groupby(said, sort=False, as_index=False).agg(
        {"results": "sum", "episodes": "sum", "in": lambda folders: _common_folder(list(folders))}
    )
    return rows[list(origins)].astype(str)


def _origin(result: ReportedResult) -> dict[str, str | int]:
    """Returns a result's line of provenance, with empty texts for what it does not say."""
    provenance = result.summary.provenance
    versions = [f"{name} {provenance.packages[name]}" for name in _PACKAGES if provenance.packages.get(name)]
    return {
        "agent": result.label,
        "results": 1,
        "episodes": len(result.episodes),
        "in": str(result.folder),
        "checkpoint": result.checkpoint[:12] if result.checkpoint else "none",
        "seed": str(result.seed),
        "versions": ", ".join([*versions, f"Python {provenance.python}"]),
        "machine": ", ".join(f"{key} {value}" for key, value in provenance.machine.items()),
        "command": " ".join(provenance.command),
    }


def _common_folder(paths: Sequence[str]) -> str:
    try:
        return os.path.commonpath(paths) or "."
    except ValueError:  # some are absolute, some are not
        return os.path.commonpath([os.path.abspath(path) for path in paths])


@contextlib.contextmanager
def _noting_remarks() -> Iterator[list[str]]:
    """Gathers the remarks of the block in a list, and shows them when it has ended."""
    notes: list[str] = []
    try:
        with held_remarks() as notes:
            yield notes
    finally:
        for note in notes:
            remark(note)
