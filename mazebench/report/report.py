"""A report: the folder with tables, figures, a document of both, and the page."""

from __future__ import annotations

import contextlib
import pathlib
from collections.abc import Iterator, Sequence

from mazebench.errors import InputError
from mazebench.report.distributions import build_distributions
from mazebench.report.document import DOCUMENT, FIGURES, PAGE, build_document
from mazebench.report.figures import draw_figures
from mazebench.report.folders import Warn
from mazebench.report.galleries import build_galleries
from mazebench.report.page import build_page
from mazebench.report.results import ReportedResult, read_results
from mazebench.report.table_forms import latex_name, to_csv, to_latex, to_markdown
from mazebench.report.tables import build_tables
from mazebench.storage.files import make_folder, open_whole, writing_to
from mazebench.storage.locks import FolderLock

TABLES = "tables"
_FORMS = {".md": to_markdown, ".csv": to_csv}
_SUFFIXES = {TABLES: (*_FORMS, ".tex"), FIGURES: (".png", ".pdf")}
# Where well-known agents stand among others.
_AGENT_ORDER = (
    "oracle",
    "navigator",
    "belief-planner",
    "mmn",
    "mah",
    "mah-paper",
    "dqn",
    "planner-closed-loop",
    "planner",
    "random",
)


def write_report(
    paths: Sequence[pathlib.Path], out: pathlib.Path, warn: Warn, names: Sequence[tuple[str, str]] = ()
) -> list[ReportedResult]:
    """Writes the report of all results at or below `paths` to the folder `out`, and returns the results.

    Args:
      paths: evaluation folders, runs of suites, or folders above them.
      out: an empty or new folder, or one with an earlier report, which is replaced.
      warn: called with one line about each thing that is skipped; the report lists these lines too.
      names: what agents are called, as `read_results` takes it.

    Raises:
      InputError: if there is nothing to report, results are of another benchmark, or `out` can't be used.
    """
    warnings: list[str] = []

    def note(line: str) -> None:
        warnings.append(line)
        warn(line)

    results = read_results(paths, note, names)
    labels = sorted({result.label for result in results}, key=_rank)
    results.sort(key=lambda result: (result.setting, labels.index(result.label)))
    tables, distributions = build_tables(results, labels), build_distributions(results, labels)
    galleries = build_galleries(results, labels)
    with new_report(out):
        for table in tables:
            for suffix, form in _FORMS.items():
                write_text(out / TABLES / (table.name + suffix), form(table))
            for metric in table.metrics:
                write_text(out / TABLES / f"{latex_name(table, metric)}.tex", to_latex(table, metric))
        pictures = list(draw_figures(tables, distributions, galleries, labels, out / FIGURES))
        write_text(out / DOCUMENT, build_document(results, labels, tables, pictures, warnings))
        write_text(out / PAGE, build_page(results, labels, tables, distributions, warnings))
    return results


def _rank(label: str) -> tuple[int, str]:
    name = label.partition(" ")[0]
    return (_AGENT_ORDER.index(name) if name in _AGENT_ORDER else len(_AGENT_ORDER), label)


@contextlib.contextmanager
def new_report(out: pathlib.Path) -> Iterator[None]:
    """Makes the folder of a report, which this process alone writes to in the block, without an earlier report's files.

    Raises:
      InputError: if it holds something else, can't be written, or another process uses it.
    """
    make_folder(out)
    with FolderLock(out), writing_to(out):
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
