"""A report: the folder with tables, figures, a document of both, and the page."""

from __future__ import annotations

import contextlib
import pathlib
from collections.abc import Iterator, Sequence

from mazebench.errors import InputError, held_remarks, remark
from mazebench.report.document import DOCUMENT, FIGURES, PAGE, Picture, build_document
from mazebench.report.figures.describe import describe_distributions, describe_several_tables, describe_table
from mazebench.report.figures.draw import draw_figure
from mazebench.report.figures.galleries import build_galleries
from mazebench.report.figures.trajectories import draw_gallery
from mazebench.report.frame import join_episodes
from mazebench.report.looks import all_looks
from mazebench.report.page import build_page
from mazebench.report.results import ReportedResult, read_results
from mazebench.report.table import latex_name, to_csv, to_latex, to_markdown
from mazebench.report.tables import build_tables
from mazebench.storage.files import make_folder, open_whole, writing_to

TABLES = "tables"
_FORMS = {".md": to_markdown, ".csv": to_csv}
_SUFFIXES = {TABLES: (*_FORMS, ".tex"), FIGURES: (".png", ".pdf")}
# Where well-known agents stand among others.
_AGENT_ORDER = (
    "oracle",
    "navigator",
    "mmn",
    "mah",
    "mah-paper",
    "dqn",
    "planner-closed-loop",
    "planner",
    "random",
)


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
      InputError: if there is nothing to report, results are of another benchmark, or `out` can't be used.
    """
    with _noting_remarks() as notes:
        results, labels = read_in_order(paths, names)
    episodes, looks = join_episodes(results, labels), all_looks(labels)
    tables = build_tables(episodes)
    figures = [describe_table(table, looks) for table in tables if table.x]
    figures += [*describe_several_tables(tables, looks), *describe_distributions(episodes, looks)]
    galleries = build_galleries(episodes)
    pictures = [Picture(each.name, each.title, each.note) for each in figures]
    pictures += [Picture(each.name, each.title, each.note) for each in galleries]
    with new_report(out):
        for table in tables:
            for suffix, form in _FORMS.items():
                write_text(out / TABLES / (table.name + suffix), form(table))
            for metric in table.metrics:
                write_text(out / TABLES / f"{latex_name(table, metric)}.tex", to_latex(table, metric))
        drawn = {
            Picture(figure.name, figure.title, figure.note): draw_figure(figure, out / FIGURES / figure.name)
            for figure in figures
        }
        for gallery in galleries:
            draw_gallery(gallery, looks, out / FIGURES / gallery.name)
        write_text(out / DOCUMENT, build_document(results, labels, tables, pictures, notes))
        write_text(out / PAGE, build_page(results, labels, tables, drawn, notes))
    return results


def read_in_order(
    paths: Sequence[pathlib.Path], names: Sequence[tuple[str, str]] = ()
) -> tuple[list[ReportedResult], list[str]]:
    """Returns the results as `read_results` does, in a report's order, and the agents' labels in theirs."""
    results = read_results(paths, names)
    labels = sorted({result.label for result in results}, key=_rank)
    results.sort(key=lambda result: (result.setting, labels.index(result.label)))
    return results, labels


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


def _rank(label: str) -> tuple[int, str]:
    name = label.partition(" ")[0]
    return (_AGENT_ORDER.index(name) if name in _AGENT_ORDER else len(_AGENT_ORDER), label)


@contextlib.contextmanager
def new_report(out: pathlib.Path) -> Iterator[None]:
    """Makes the folder of a report, without an earlier report's files.

    Raises:
      InputError: if it holds something else, or can't be written in the block.
    """
    make_folder(out)
    with writing_to(out):
        _prepare(out)
        yield


def _prepare(out: pathlib.Path) -> None:
    """Removes the page, tables and figures of an earlier report, also those that a killed process left half-written."""
    ours = {DOCUMENT, PAGE, TABLES, FIGURES}
    others = sorted(path.name for path in out.iterdir() if path.name.removesuffix(".tmp") not in ours)
    if others:
        raise InputError(f"{out}: expected an empty folder or a report's, found {others[0]!r} in it")
    (out / PAGE).unlink(missing_ok=True)
    for folder, suffixes in _SUFFIXES.items():
        make_folder(out / folder)
        for path in (out / folder).iterdir():
            if path.name.removesuffix(".tmp").endswith(suffixes):
                path.unlink()


def write_text(path: pathlib.Path, text: str) -> None:
    """Writes a file of a report. Names of folders and words of commands need not be legal Unicode."""
    with open_whole(path) as file:
        file.write(text.encode("utf-8", errors="replace"))
