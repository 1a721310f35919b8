"""`mazebench report`."""

from __future__ import annotations

import pathlib
from typing import Annotated

import typer

from mazebench import stopping
from mazebench.errors import remark


def report(
    results: Annotated[
        list[pathlib.Path], typer.Argument(help="Evaluation folders, runs of suites, or folders above them.")
    ],
    out: Annotated[pathlib.Path, typer.Option(help="Folder for the report; an earlier report in it is replaced.")],
) -> None:
    """Make tables, figures and a page to explore every episode from results of `mazebench eval`."""
    from mazebench.report.document import DOCUMENT, PAGE
    from mazebench.report.report import write_report

    with stopping.stoppable(lambda: (f"the report in {out} is not whole; make it again",)):
        reported = write_report(results, out, warn=remark)
    agents = sorted({result.label for result in reported})
    print(f"{len(reported)} results of {', '.join(agents)}: {out / PAGE}, {out / DOCUMENT}")
