"""The report as one Markdown file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import NamedTuple

from mazebench.report.results import ReportedResult
from mazebench.report.table import Table, escape_markdown, to_markdown
from mazebench.results.paper import citation, reference

DOCUMENT, PAGE, FIGURES = "report.md", "report.html", "figures"
PROVENANCE_HEAD = ("agent", "results", "episodes", "in", "checkpoint", "seed", "versions", "machine", "command")
_PACKAGES = ("mazebench-mujoco", "mujoco", "numpy", "torch")


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
        f"[{PAGE}]({PAGE}) has every episode.",
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


def benchmark_versions(results: Sequence[ReportedResult]) -> str:
    """Returns the versions of the benchmark that results are of, in words."""
    return " and ".join(sorted({result.summary.benchmark for result in results}))


def provenance_rows(results: Sequence[ReportedResult]) -> list[tuple[str, ...]]:
    """Returns rows of texts under `PROVENANCE_HEAD`; results that differ only in what was played share a row."""
    groups: dict[tuple[str, ...], list[ReportedResult]] = {}
    for result in results:
        groups.setdefault((result.label, *_origin(result)), []).append(result)
    return [
        (
            label,
            str(len(group)),
            f"{sum(len(result.episodes) for result in group):,}",
            _common_folder([str(result.folder) for result in group]),
            *origin,
        )
        for (label, *origin), group in groups.items()
    ]


def _provenance(results: Sequence[ReportedResult]) -> str:
    lines = [
        PROVENANCE_HEAD,
        ("---",) * len(PROVENANCE_HEAD),
        *(tuple(map(escape_markdown, row)) for row in provenance_rows(results)),
    ]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _common_folder(paths: Sequence[str]) -> str:
    try:
        return os.path.commonpath(paths) or "."
    except ValueError:  # some are absolute, some are not
        return os.path.commonpath([os.path.abspath(path) for path in paths])


def _origin(result: ReportedResult) -> tuple[str, ...]:
    """Returns checkpoint, seed, versions, machine and command; empty texts for what the result does not say."""
    provenance = result.summary.provenance
    said = provenance.model_extra or {}
    machine, command = said.get("machine"), said.get("command")
    versions = [f"{name} {provenance.packages[name]}" for name in _PACKAGES if provenance.packages.get(name)]
    return (
        result.checkpoint[:12] if result.checkpoint else "none",
        str(result.seed),
        ", ".join([*versions, *([f"Python {said['python']}"] if "python" in said else [])]),
        ", ".join(f"{key} {value}" for key, value in machine.items()) if isinstance(machine, dict) else "",
        " ".join(map(str, command)) if isinstance(command, list) else "",
    )
