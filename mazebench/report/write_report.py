"""A report: the folder with tables, figures and the page."""

from __future__ import annotations

import contextlib
import os
import pathlib
from collections.abc import Iterator, Sequence

import pandas as pd

from mazebench.errors import InputError, one_line, remark, remarks_to
from mazebench.report.episodes import ReportedResult, join_episodes, read_results
from mazebench.report.figures import draw_table, save
from mazebench.report.page import build_page
from mazebench.report.paper_figures import Drawn, draw_paths, draw_violins
from mazebench.report.tables import build_tables
from mazebench.storage.files import make_folder, writing_to

PAGE, TABLES, FIGURES = "report.html", "tables", "figures"
_PACKAGES = ("mazebench-mujoco", "mujoco", "numpy", "torch")  # in provenance


def write_report(paths: Sequence[pathlib.Path], out: pathlib.Path) -> list[ReportedResult]:
    """Writes the report of all results at or below `paths` to the folder `out`, and returns the results.

    It warns with a `Remark` of each thing that is skipped; the report lists these remarks too.

    Args:
      paths: evaluation folders, runs of suites, or folders above them.
      out: an empty or new folder, or one with an earlier report, which is replaced.

    Raises:
      InputError: if there is nothing to report, or `out` can't be used.
    """
    notes: list[str] = []
    try:
        with remarks_to(notes.append):
            results = read_results(paths)
    finally:
        for note in notes:
            remark(note)
    episodes = join_episodes(results)
    labels = list(episodes.label.cat.categories)
    tables = build_tables(episodes)
    drawn = [(each, draw_table(each, labels)) for each in tables if each.x]
    curves = [Drawn(each.name, each.title, each.note, figure, each.values) for each, figure in drawn]
    of_paper = [*draw_violins(episodes), *draw_paths(episodes)]
    benchmarks = " and ".join(sorted({result.summary.benchmark for result in results}))
    head = (
        f"Benchmark {benchmarks}; {', '.join(labels)}; {counted(len(episodes), 'episode')} in "
        f"{counted(len(results), 'result')}."
    )
    with _new_report(out):
        for table in tables:
            for suffix, text in table.to_files().items():
                (out / TABLES / f"{table.name}{suffix}").write_bytes(text.encode(errors="replace"))
        for each in (*curves, *of_paper):
            save(each.figure, out / FIGURES / each.name)
        for each in of_paper:
            each.values.to_csv(out / TABLES / f"{each.name}.csv", index=False)
        page = build_page(results, head, tables[-1], (*curves, *of_paper), provenance_of(results), notes)
        (out / PAGE).write_bytes(page.encode(errors="replace"))  # names of folders need not be legal Unicode
    return results


@contextlib.contextmanager
def _new_report(out: pathlib.Path) -> Iterator[None]:
    """Makes the folder of a report, without an earlier report's files.

    Raises:
      InputError: if it holds something else, or can't be written in the block.
    """
    make_folder(out)
    with writing_to(out):
        others = sorted({path.name for path in out.iterdir()} - {PAGE, TABLES, FIGURES})
        if others:
            raise InputError(f"{out}: expected an empty folder or a report's, found {others[0]!r} in it")
        (out / PAGE).unlink(missing_ok=True)
        for folder in (out / TABLES, out / FIGURES):
            folder.mkdir(exist_ok=True)
            for path in folder.iterdir():
                if path.suffix in (".md", ".csv", ".tex", ".png", ".pdf"):
                    path.unlink()
        yield


def counted(count: int, noun: str) -> str:
    """Returns "1 result" or "2 results"."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def provenance_of(results: Sequence[ReportedResult]) -> pd.DataFrame:
    """Returns where results come from; results that differ only in what was evaluated share a row."""
    origins = []
    for result in results:
        provenance = result.summary.provenance
        versions = [f"{name} {provenance.packages[name]}" for name in _PACKAGES if provenance.packages.get(name)]
        origin = {
            "agent": result.label,
            "checkpoint": (provenance.checkpoint_sha256 or "none")[:12],
            "seed": provenance.seed,
            "versions": ", ".join([*versions, f"Python {provenance.python}"]),
            "machine": ", ".join(f"{key} {value}" for key, value in provenance.machine.items()),
            "command": " ".join(provenance.command),
        }
        origins.append(
            origin | {"results": 1, "episodes": len(result.episodes), "in": one_line(os.path.relpath(result.folder))}
        )
    rows = pd.DataFrame(origins)
    return rows.groupby(list(rows)[:-3], sort=False, as_index=False).agg(
        {"results": "sum", "episodes": "sum", "in": lambda folders: os.path.commonpath(list(folders))}
    )
