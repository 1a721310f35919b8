"""An evaluation's summary as a table for people."""

from __future__ import annotations

from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table


def print_summary(summary: dict[str, Any]) -> None:
    """Prints success rate, SPL and SPL by grid distance with their 95 % intervals, by distance for local episodes."""
    title = f"{summary['agent']}: {summary['task']}, {summary['split']} mazes {summary['size']} x {summary['size']}"
    perturbed = ", ".join(f"{name} {value}" for name, value in summary["perturbation"].items() if value)
    table = Table(
        title=f"{title}{', ' + perturbed if perturbed else ''}",
        title_justify="left",
        box=box.SIMPLE,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    columns = ("episodes", "success rate", "SPL", "SPL by grid")
    for name in ("distance", *columns) if summary["task"] == "local" else columns:
        table.add_column(name, justify="right", no_wrap=True)
    if summary["task"] == "local":
        for distance, row in summary["by_distance"].items():
            table.add_row(distance, *_cells(row))
        table.add_section()
        table.add_row("all", *_cells(summary["overall"]))
    else:
        table.add_row(*_cells(summary["overall"]))
    Console(markup=False).print(table)


def _cells(row: dict[str, Any]) -> list[str]:
    cells = [str(row["n"])]
    for key in ("success_rate", "spl", "spl_grid"):
        low, high = row[f"{key}_ci95"]
        cells.append(f"{row[key]:.2f} [{low:.2f}, {high:.2f}]")
    return cells
