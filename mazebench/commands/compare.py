"""`mazebench compare`."""

from __future__ import annotations

import json
import pathlib
from typing import Annotated

import typer

from mazebench.errors import remark


def compare(
    a: Annotated[pathlib.Path, typer.Argument(metavar="A", help="The folder of an evaluation, or of a suite's agent.")],
    b: Annotated[
        pathlib.Path,
        typer.Argument(
            metavar="B", help="The evaluation of another agent, or of the agent at another level, on the same episodes."
        ),
    ],
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON, with all intervals, instead of a table.")
    ] = False,
) -> None:
    """Compare two evaluations on the same episodes: what A has more than B, with 95 % intervals over mazes.

    They are of two agents, or of one agent at two levels of a track.
    """
    from mazebench.commands import summary_table
    from mazebench.results import comparison

    found = comparison.compare_folders(a, b)
    for line in found.notes:
        remark(line)
    if as_json:
        print(json.dumps(comparison.to_json(found), indent=1))
        return
    if "" in found.parts:
        part = found.parts[""]
        bins = part.by_bin if found.has_distances else {}
        summary_table.print_comparison(found.title, "episodes", {"all": part.overall, **part.by_fact, **bins})
    else:
        summary_table.print_comparison(found.title, "part", {name: part.overall for name, part in found.parts.items()})
    if found.worth:
        print(found.worth)
