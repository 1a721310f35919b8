"""Summaries and comparisons as tables for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from mazebench.evaluation.paper import printed_mmn


def print_summary(summary: dict[str, Any]) -> None:
    """Prints success rate, SPL and SPL by grid distance with their 95 % intervals, by distance for local episodes.

    What the paper's MMN reached stands beside it where it can be compared.
    """
    title = f"{summary['agent']}: {summary['task']}, {summary['split']} mazes {summary['size']} x {summary['size']}"
    perturbed = ", ".join(f"{name} {value}" for name, value in summary["perturbation"].items() if value)
    table = _table(f"{title}{', ' + perturbed if perturbed else ''}")
    paper = printed_mmn(summary)
    columns = ["n", "success rate", *["paper"] * bool(paper), "SPL", "SPL by grid"]
    if summary["task"] == "local":
        _add_columns(table, ["distance", *columns])
        for distance, row in summary["by_distance"].items():
            table.add_row(distance, *_with_paper(row, paper, int(distance)))
        table.add_section()
        table.add_row("all", *_with_paper(summary["overall"], paper))
    else:
        _add_columns(table, columns)
        landmark_distance = summary["provenance"]["options"]["landmark_distance"]
        table.add_row(*_with_paper(summary["overall"], paper, landmark_distance))
    console = Console(markup=False)
    console.print(table)
    if paper:
        console.print("paper: success rate of the paper's MMN, in DeepMind Lab")


def print_suite(summaries: Sequence[dict[str, Any]]) -> None:
    """Prints the overall figures of a suite's parts, one table an agent."""
    for agent in dict.fromkeys(summary["agent"] for summary in summaries):
        table = _table(f"{agent}: suite {summaries[0]['suite']}", narrow=True)
        table.add_column("part", no_wrap=True)
        _add_columns(table, ("n", "success rate", "SPL", "SPL by grid"))
        for summary in summaries:
            if summary["agent"] == agent:
                table.add_row(summary["part"], *_cells(summary["overall"]))
        Console(markup=False).print(table)


def print_comparison(title: str, name: str, rows: Mapping[str, dict[str, Any]]) -> None:
    """What A has more than B, with 95 % intervals: rows of a comparison by what the column `name` calls them."""
    table = _table(title, narrow=True)
    table.add_column(name, no_wrap=True)
    _add_columns(table, ("A", "B", "A - B, success rate", "A - B, SPL", "P(A > B)"))
    for key, row in rows.items():
        table.add_row(key, *_comparison_cells(row))
    Console(markup=False).print(table)


def _table(title: str, narrow: bool = False) -> Table:
    """`narrow` for one that would otherwise not fit 80 columns."""
    padding = (0, 0 if narrow else 1, 0, 0)
    return Table(
        title=title, title_justify="left", box=box.SIMPLE, pad_edge=False, padding=padding, show_edge=not narrow
    )


def _add_columns(table: Table, names: Sequence[str]) -> None:
    for name in names:
        table.add_column(name, justify="right", no_wrap=True)


def _comparison_cells(row: dict[str, Any]) -> list[str]:
    cells = [f"{row['success_rate_a']:.2f}", f"{row['success_rate_b']:.2f}"]
    for key in ("success_rate", "spl"):
        low, high = row[f"{key}_difference_ci95"]
        cells.append(f"{row[f'{key}_difference']:+.2f} [{low:+.2f}, {high:+.2f}]")
    return [*cells, f"{row['probability_of_improvement']:.2f}"]


def _with_paper(row: dict[str, Any], paper: Mapping[int, float], distance: int = 0) -> list[str]:
    """Cells of a row, with the paper's success rate behind ours if it printed any; no distance of its is 0."""
    count, success_rate, *others = _cells(row)
    printed = [f"{paper[distance]:.2f}" if distance in paper else ""] if paper else []
    return [count, success_rate, *printed, *others]


def _cells(row: dict[str, Any]) -> list[str]:
    cells = [str(row["n"])]
    for key in ("success_rate", "spl", "spl_grid"):
        low, high = row[f"{key}_ci95"]
        cells.append(f"{row[key]:.2f} [{low:.2f}, {high:.2f}]")
    return cells
