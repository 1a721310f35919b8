"""The report as one Markdown file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from mazebench.report.provenance import HEAD, benchmark_versions, provenance_rows
from mazebench.report.results import ReportedResult
from mazebench.report.table import Table
from mazebench.report.table_forms import escape_markdown, to_markdown
from mazebench.results.paper import citation, reference

DOCUMENT, PAGE, FIGURES = "report.md", "report.html", "figures"


class Picture(NamedTuple):
    """A figure in the folder of figures, as NAME.png and NAME.pdf."""

    name: str
    title: str
    note: str


def build_document(
    results: Sequence[ReportedResult],
    labels: Sequence[str],
    tables: Sequence[Table],
    pictures: Sequence[Picture],
    warnings: Sequence[str],
) -> str:
    """Returns tables and figures below one another, what was skipped, and where the results came from."""
    count = sum(len(result.episodes) for result in results)
    lines = [
        "# mazebench report",
        f"Benchmark {benchmark_versions(results)}; {escape_markdown(', '.join(labels))}; "
        f"{counted(count, 'episode')} in {counted(len(results), 'result')}. "
        f"[{PAGE}]({PAGE}) has interactive charts and every episode.",
        "Means with 95 % intervals, which allow for the likeness of episodes in one maze. Columns marked (paper) are "
        f"the values printed in {escape_markdown(citation())}. {reference()['note']}",
        *(f"- {escape_markdown(warning)}" for warning in warnings),
    ]
    left = {picture.name: picture for picture in pictures}
    for table in tables:
        lines += [f"## {escape_markdown(table.title)}", escape_markdown(table.note), to_markdown(table)]
        if table.name in left:
            lines.append(show_picture(left.pop(table.name)))
    for picture in left.values():
        lines += [f"## {escape_markdown(picture.title)}", escape_markdown(picture.note), show_picture(picture)]
    lines += ["## Results and provenance", _provenance(results)]
    return "\n\n".join(line.rstrip("\n") for line in lines if line) + "\n"


def counted(count: int, noun: str) -> str:
    """Returns "1 result" or "2 results"."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def show_picture(picture: Picture) -> str:
    """Returns the Markdown that shows a figure."""
    return f"![{escape_markdown(picture.title)}]({FIGURES}/{picture.name}.png)"


def _provenance(results: Sequence[ReportedResult]) -> str:
    lines = [HEAD, ("---",) * len(HEAD), *(tuple(map(escape_markdown, row)) for row in provenance_rows(results))]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
