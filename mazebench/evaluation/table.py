"""Summaries and comparisons as tables for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from mazebench.evaluation.comparison import Row
from mazebench.evaluation.paper import printed_mmn
from mazebench.evaluation.records import Figures, Summary


def print_summary(summary: Summary) -> None:
    """Prints success rate, SPL and SPL by grid distance with their 95 % intervals, by distance for local episodes.

    What the paper's MMN reached stands beside it where it can be compared.
    """
    agent = f"{summary.agent} (privileged)" if summary.privileged else summary.agent
    task = f"{summary.track} {summary.level}" if summary.track else summary.task
    title = f"{agent}: {task}, {summary.split} mazes {summary.size} x {summary.size}"
    perturbed = ", ".join(f"{name} {value}" for name, value in summary.perturbation.items() if value)
    table = _table(f"{title}{', ' + perturbed if perturbed else ''}")
    paper = printed_mmn(summary)
    columns = ["n", "success rate", *["paper"] * bool(paper), "SPL", "SPL by grid"]
    if summary.task == "local":
        _add_columns(table, ["distance", *columns])
        for distance, row in summary.by_distance.items():
            table.add_row(distance, *_with_paper(row, paper, int(distance)))
        table.add_section()
        for name, row in [*summary.by_fact.items(), ("all", summary.overall)]:
            table.add_row(name, *_with_paper(row, paper))
    else:
        _add_columns(table, columns)
        landmark_distance = summary.provenance.options.landmark_distance
        table.add_row(*_with_paper(summary.overall, paper, landmark_distance))
    console = Console(markup=False)
    console.print(table)
    if summary.overall.spl_relative is not None:
        console.print(f"SPL relative to the oracle's: {summary.overall.spl_relative:.2f}")
    if paper:
        console.print("paper: success rate of the paper's MMN, in DeepMind Lab")


def print_suite(summaries: Sequence[Summary]) -> None:
    """Prints the overall figures of a suite's parts, one table an agent."""
    for agent in dict.fromkeys(summary.agent for summary in summaries):
        table = _table(f"{agent}: suite {summaries[0].suite}", narrow=True)
        table.add_column("part", no_wrap=True)
        _add_columns(table, ("n", "success rate", "SPL", "SPL by grid", "relative"))
        for summary in summaries:
            if summary.agent == agent:
                overall = summary.overall
                relative = "" if overall.spl_relative is None else f"{overall.spl_relative:.2f}"
                table.add_row(str(summary.part), *_cells(overall)[:-1], f"{overall.spl_grid:.2f}", relative)
        Console(markup=False).print(table)
    print("relative: SPL divided by the oracle's on the same episodes")


def print_comparison(title: str, name: str, rows: Mapping[str, Row]) -> None:
    """Prints what A has more than B, with 95 % intervals; the keys of `rows` go in the column `name`."""
    table = _table(title, narrow=True)
    table.add_column(name, no_wrap=True)
    _add_columns(table, ("A", "B", "A - B, success rate", "A - B, SPL", "A wins"))
    for key, row in rows.items():
        table.add_row(key, *_comparison_cells(row))
    Console(markup=False).print(table)


def _table(title: str, narrow: bool = False) -> Table:
    """Returns an empty table; a `narrow` one has less space between columns, to fit 80 letters."""
    padding = (0, 0 if narrow else 1, 0, 0)
    return Table(
        title=title, title_justify="left", box=box.SIMPLE, pad_edge=False, padding=padding, show_edge=not narrow
    )


def _add_columns(table: Table, names: Sequence[str]) -> None:
    for name in names:
        table.add_column(name, justify="right", no_wrap=True)


def _comparison_cells(row: Row) -> list[str]:
    cells = [f"{row.metrics['success_rate'].a:.2f}", f"{row.metrics['success_rate'].b:.2f}"]
    for metric in ("success_rate", "spl"):
        difference = row.metrics[metric].difference
        cells.append(f"{difference.value:+.2f} [{difference.low:+.2f}, {difference.high:+.2f}]")
    return [*cells, f"{row.win_share.value:.2f}"]


def _with_paper(row: Figures, paper: Mapping[int, float], distance: int = 0) -> list[str]:
    """Cells of a row, with the paper's success rate behind ours if it printed any; no distance of its is 0."""
    count, success_rate, *others = _cells(row)
    printed = [f"{paper[distance]:.2f}" if distance in paper else ""] if paper else []
    return [count, success_rate, *printed, *others]


def _cells(row: Figures) -> list[str]:
    cells = [str(row.n)]
    for key in ("success_rate", "spl", "spl_grid"):
        low, high = getattr(row, f"{key}_ci95")
        cells.append(f"{getattr(row, key):.2f} [{low:.2f}, {high:.2f}]")
    return cells
