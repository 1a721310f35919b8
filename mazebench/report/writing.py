"""Writes a report: tables, figures, a document of both, and the page."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from types import ModuleType

from mazebench.agent import agent_names
from mazebench.errors import InputError
from mazebench.evaluation.paper import citation, reference
from mazebench.files import make_folder, open_whole, writing_to
from mazebench.maps.benchmark import VERSION, manifest_hash
from mazebench.records import FolderLock
from mazebench.report.distributions import Distribution, build_distributions
from mazebench.report.episodes import Gallery, build_galleries
from mazebench.report.finding import find_results
from mazebench.report.page import build_page
from mazebench.report.provenance import HEAD, provenance_rows
from mazebench.report.reading import read_result
from mazebench.report.results import Result, Warn, drop_repeats, label_results, require_one_benchmark
from mazebench.report.table import Table, escape_markdown, to_csv, to_latex, to_markdown
from mazebench.report.tables import build_tables

DOCUMENT, PAGE, TABLES, FIGURES = "report.md", "report.html", "tables", "figures"
_SUFFIXES = {TABLES: (".md", ".csv", ".tex"), FIGURES: (".png", ".pdf")}
# Where agents that one knows stand among others.
_AGENT_ORDER = ("mmn", "mah", "dqn", "planner-closed-loop", "planner", "random")


def write_report(paths: Sequence[pathlib.Path], out: pathlib.Path, warn: Warn) -> list[Result]:
    """Writes the report over all results at or below `paths` to the folder `out`, and returns them.

    Args:
      paths: evaluation folders, runs of suites, or folders above them.
      out: an empty or new folder, or an earlier report's, which is replaced.
      warn: told in a line of each thing that was skipped or mended; the report lists these too.

    Raises:
      InputError: if there is nothing to report, results are of another benchmark, or `out` can't be used.
    """
    warnings: list[str] = []

    def remark(line: str) -> None:
        warnings.append(line)
        warn(line)

    figures = _load_figures()
    results = read_results(paths, remark)
    labels = sorted({result.label for result in results}, key=_rank)
    results.sort(key=lambda result: (result.setting, labels.index(result.label)))
    tables, distributions = build_tables(results, labels), build_distributions(results, labels)
    galleries = build_galleries(results, labels)
    make_folder(out)
    with FolderLock(out), writing_to(out):
        _prepare(out)
        for table in tables:
            for suffix, form in ((".md", to_markdown), (".csv", to_csv), (".tex", to_latex)):
                _write(out / TABLES / (table.name + suffix), form(table))
        drawn = _draw(figures, tables, distributions, galleries, labels, out / FIGURES)
        _write(out / DOCUMENT, _document(results, labels, tables, drawn, warnings))
        _write(out / PAGE, build_page(results, labels, tables, distributions, warnings))
    return results


def read_results(paths: Sequence[pathlib.Path], warn: Warn) -> list[Result]:
    """All results at or below `paths`, one for each agent and setting; at least one.

    Raises:
      InputError: if there is none, or some are not of the installed benchmark.
    """
    results = []
    for folder in find_results(paths, warn):
        try:
            results.append(read_result(folder, warn))
        except InputError as error:
            warn(f"{error}; skipped")
    if not results:
        raise InputError(f"expected results of `mazebench eval` in {', '.join(map(str, paths))}, found none to report")
    require_one_benchmark(results, (VERSION, manifest_hash()))
    for agent in sorted({result.agent for result in results if ":" not in result.agent} - set(agent_names())):
        warn(f"agent {agent[:80]!r} is not installed here; reported by its name")
    return drop_repeats(label_results(results), warn)


def _rank(label: str) -> tuple[int, str]:
    name = label.partition(" ")[0]
    return (_AGENT_ORDER.index(name) if name in _AGENT_ORDER else len(_AGENT_ORDER), label)


def _prepare(out: pathlib.Path) -> None:
    """Makes `out` and removes an earlier report's tables and figures, those that a kill left half-written too."""
    ours = {DOCUMENT, PAGE, TABLES, FIGURES}
    strangers = sorted(path.name for path in out.iterdir() if path.name.removesuffix(".tmp") not in ours)
    if strangers:
        raise InputError(f"{out}: expected an empty folder or a report's, found {strangers[0]!r} in it")
    for folder, suffixes in _SUFFIXES.items():
        make_folder(out / folder, within=out)
        for path in (out / folder).iterdir():
            if path.name.removesuffix(".tmp").endswith(suffixes):
                path.unlink()


def _write(path: pathlib.Path, text: str) -> None:
    # Names of folders and words of commands need not be legal Unicode.
    with open_whole(path) as file:
        file.write(text.encode("utf-8", errors="replace"))


def _load_figures() -> ModuleType:
    """The module that draws, once it is known to be of use."""
    try:
        from mazebench.report import figures
    except ImportError as error:
        raise InputError(
            f"the report's figures need {error.name}, which the extra [report] brings (docs/start.md)"
        ) from error
    return figures


def _draw(
    figures: ModuleType,
    tables: Sequence[Table],
    distributions: Sequence[Distribution],
    galleries: Sequence[Gallery],
    labels: Sequence[str],
    folder: pathlib.Path,
) -> list[tuple[str, str, str]]:
    """Draws all figures; returns (name, title, note) of each."""
    drawn = []
    curves = [table for table in tables if table.x]
    for table in curves:
        figures.draw_table(table, labels, folder / table.name)
        drawn.append((table.name, table.title, table.note))
    by_size = [table for table in curves if table.name.startswith("local-")]
    if len(by_size) > 1:
        title = "Local navigation by distance, in mazes of several sizes"
        figures.draw_table_panels(by_size, title, labels, folder / "local-sizes")
        drawn.append(("local-sizes", title, "Success rate."))
    for distribution in distributions:
        figures.draw_distribution(distribution, labels, folder / distribution.name)
        drawn.append((distribution.name, distribution.title, distribution.note))
    for gallery in galleries:
        figures.draw_gallery(gallery, folder / gallery.name)
        drawn.append((gallery.name, gallery.title, gallery.note))
    return drawn


def _document(
    results: Sequence[Result],
    labels: Sequence[str],
    tables: Sequence[Table],
    drawn: Sequence[tuple[str, str, str]],
    warnings: Sequence[str],
) -> str:
    """Tables and figures in one Markdown file."""
    count = sum(len(result.episodes) for result in results)
    lines = [
        "# mazebench report",
        f"Benchmark {results[0].benchmark[0]}; {escape_markdown(', '.join(labels))}; "
        f"{count:,} episodes in {len(results)} results. [{PAGE}]({PAGE}) has the figures to explore and every episode.",
        "Means with 95 % intervals by a bootstrap over mazes. Columns marked (paper) are the figures printed in "
        f"{escape_markdown(citation())}. {reference()['note']}",
        *(f"- {escape_markdown(warning)}" for warning in warnings),
    ]
    figures = {name: (title, note) for name, title, note in drawn}
    for table in tables:
        lines += [f"## {escape_markdown(table.title)}", escape_markdown(table.note), to_markdown(table)]
        if table.name in figures:
            lines.append(_picture(table.name, figures.pop(table.name)[0]))
    for name, (title, note) in figures.items():
        lines += [f"## {escape_markdown(title)}", escape_markdown(note), _picture(name, title)]
    lines += ["## Results and provenance", _provenance(results)]
    return "\n\n".join(line.rstrip("\n") for line in lines if line) + "\n"


def _picture(name: str, title: str) -> str:
    return f"![{escape_markdown(title)}]({FIGURES}/{name}.png)"


def _provenance(results: Sequence[Result]) -> str:
    lines = [HEAD, ("---",) * len(HEAD), *(tuple(map(escape_markdown, row)) for row in provenance_rows(results))]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
