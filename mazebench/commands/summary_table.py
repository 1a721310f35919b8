"""Summaries and comparisons as tables for people."""

from __future__ import annotations

import dataclasses
import pathlib
from collections import Counter
from collections.abc import Mapping, Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from mazebench.constants import ON_TIME
from mazebench.errors import one_line
from mazebench.maps.real_buildings import SCAN
from mazebench.results.comparison import Row
from mazebench.results.metrics import HEADLINE, METRICS, Metric
from mazebench.results.naming import noise_in_words, title_of
from mazebench.results.paper import printed_mmn
from mazebench.results.reading import Result, load_result, read_suite
from mazebench.results.records import Figures, Summary
from mazebench.results.suite_groups import compare_maps, summarize_groups

_ANY_WIDTH = 10_000  # characters
_MOST_DISTANCES = 20  # of a table; --distances may name hundreds
_RECALL_NOTE = "pose: share of steps whose reported pose is within it, then that of episodes at their end"
_NOTE = f"on time: within {' and '.join(f'{k:g}' for k in ON_TIME)} times the oracle's steps"

Columns = Sequence[Sequence[Metric]]  # of a table; metrics of one column share its cells


def print_summaries(summaries: Sequence[Summary], folder: pathlib.Path) -> None:
    """Prints the summary of an evaluation, or those of a suite, that was run into a folder."""
    if summaries[0].suite is None:
        print_summary(summaries[0])
    else:
        folders = [folder / read_suite(folder).folders[each.agent] / str(each.part) for each in summaries]
        print_suite([load_result(each) for each in folders])


def print_summary(summary: Summary) -> None:
    """Prints success rate and SPL with their 95 % intervals, on time and SPL by grid, by distance for local episodes.

    What the paper's MMN reached stands beside it where it can be compared.
    """
    task = summary.task
    scale = "" if task.cell_size in (None, 1) else f" cells of {task.cell_size:g} m"
    title = f"{summary.who}: {title_of(task)}, {task.split_in_results} mazes {task.size} x {task.size}{scale}"
    perturbations = [f"{name} {value}" for name, value in task.perturbations.items() if value]
    perturbed = ", ".join([*perturbations, *noise_in_words(task)])
    paper = printed_mmn(summary)
    columns, totals = _columns(summary), []
    head = ["n", *_heads(columns)]
    if paper:
        head.insert(2, "paper")
    if not task.is_hierarchical:
        by_distance = summary.by_distance if len(summary.by_distance) <= _MOST_DISTANCES else {}
        head = ["distance" if by_distance else "episodes", *head]
        rows = [[distance, *_cells(row, columns, paper, int(distance))] for distance, row in by_distance.items()]
        totals = [
            [name, *_cells(row, columns, paper)] for name, row in [*summary.by_fact.items(), ("all", summary.overall)]
        ]
    else:
        rows = [_cells(summary.overall, columns, paper, task.landmark_distance)]
    print_table(f"{title}{', ' + perturbed if perturbed else ''}", head, rows, totals)
    _print_notes(summary)
    if paper:
        print("paper: success rate of the paper's MMN, in DeepMind Lab")


def print_suite(results: Sequence[Result]) -> None:
    """Prints the overall figures of a suite's parts or groups of them, one table an agent, and the worth of maps."""
    for agent in dict.fromkeys(result.summary.agent for result in results):
        own = [result for result in results if result.summary.agent == agent]
        summaries = summarize_groups(own)
        columns = _columns(*summaries)
        rows = [
            [name, *_cells(figures, columns)]
            for summary in summaries
            for name, figures in [(str(summary.part), summary.overall), *_scans(summary)]
        ]
        title = f"{summaries[0].who}: suite {summaries[0].suite}"
        print_table(title, ["part", "n", *_heads(columns)], rows)
        if worth := compare_maps(own):
            print_comparison(f"{title}, A - B in the same episodes", "A - B", worth)
    _print_notes(*(result.summary for result in results))


def _scans(summary: Summary) -> list[tuple[str, Figures]]:
    """Returns the row of the buildings that robots scanned, where a group of parts has others, too."""
    figures = summary.by_fact.get(SCAN)
    return [(f"{summary.part}, scans", figures)] if figures and figures.n < summary.overall.n else []


def print_comparison(title: str, name: str, rows: Mapping[str, Row]) -> None:
    """Prints what A has more than B, with 95 % intervals; the keys of `rows` go in the column `name`."""
    head = (name, "A", "B", *(f"A - B, {metric.title}" for metric in HEADLINE), "A wins")
    cells = []
    for key, row in rows.items():
        rates, *_ = paired = [row.metrics[metric.name] for metric in HEADLINE]
        intervals = ["{:+.2f} [{:+.2f}, {:+.2f}]".format(*dataclasses.astuple(each.difference)) for each in paired]
        cells.append([key, f"{rates.a:.2f}", f"{rates.b:.2f}", *intervals, f"{row.win_share.value:.2f}"])
    print_table(title, head, cells)


def print_table(
    title: str, head: Sequence[str], rows: Sequence[Sequence[str]], totals: Sequence[Sequence[str]] = ()
) -> None:
    """Prints a table whose first column names the rows; `totals` are the rows below a line.

    On a terminal that is too narrow, cells are wrapped; elsewhere, lines are as long as they need to be.
    """
    console = Console(markup=False, emoji=False)
    if not console.is_terminal:
        console = Console(markup=False, emoji=False, width=_ANY_WIDTH)
    console.print(one_line(title), style="italic", highlight=False)  # folders may have any names
    table = Table(box=box.SIMPLE, pad_edge=False, padding=0, show_edge=False)
    for name in head:
        table.add_column(name, justify="right", overflow="fold")
    table.columns[0].justify = "right" if all(row[0].isdigit() for row in rows) else "left"
    for number, row in enumerate([*rows, *totals], 1):
        table.add_row(*map(one_line, row), end_section=number == len(rows))
    console.print(table)


def _columns(*summaries: Summary) -> Columns:
    """Returns the columns of which one of the summaries has values."""
    heads = dict.fromkeys(metric.head for metric in METRICS.values())
    columns = [[metric for metric in METRICS.values() if metric.head == head] for head in heads]
    return [each for each in columns if any(_cell(summary.overall, each) for summary in summaries)]


def _heads(columns: Columns) -> list[str]:
    return [metrics[0].head for metrics in columns]


def _cells(row: Figures, columns: Columns, paper: Mapping[int, float] | None = None, distance: int = 0) -> list[str]:
    """Cells of a row, with the paper's success rate behind ours if it printed any; no distance of its is 0."""
    cells = [str(row.n), *(_cell(row, metrics) for metrics in columns)]
    if paper:
        cells.insert(2, f"{paper[distance]:.2f}" if distance in paper else "")
    return cells


def _cell(row: Figures, metrics: Sequence[Metric]) -> str:
    estimates = [(metric, estimate) for metric in metrics if (estimate := metric.estimate(row))]
    return ", ".join(
        f"{each.value:.2f}" + (f" [{each.low:.2f}, {each.high:.2f}]" if metric.shows_interval else "")
        for metric, each in estimates
    )


def _print_notes(*summaries: Summary) -> None:
    print(_NOTE)
    if any(summary.overall.recall for summary in summaries):
        print(_RECALL_NOTE)
    for agent in dict.fromkeys(summary.who for summary in summaries):
        counts = sum((Counter(each.counts) for each in summaries if each.who == agent), Counter())
        if counts:
            named = ", ".join(f"{name.replace('_', ' ')} {count:,}" for name, count in counts.items())
            print(f"{agent}, in all episodes: {named}")
