"""`mazebench report`."""

from __future__ import annotations

import logging
import pathlib
from typing import Annotated

import typer

from mazebench import stopping
from mazebench.errors import InputError, one_line


def report(
    results: Annotated[
        list[pathlib.Path], typer.Argument(help="Evaluation folders, runs of suites, or folders above them.")
    ],
    out: Annotated[pathlib.Path, typer.Option(help="Folder for the report; an earlier report in it is replaced.")],
) -> None:
    """Make tables, figures and a page to explore every episode from results of `mazebench eval`."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it warns where it finds no folder or letter of its own
    try:
        from mazebench.report.write_report import PAGE, counted, write_report
    except ImportError as error:
        raise InputError(f"the report needs {error.name}, which the extra [report] installs (docs/start.md)") from error
    with stopping.stoppable(lambda: (f"the report in {out} is not whole; make it again",)):
        reported = write_report(results, out)
    agents = sorted({result.label for result in reported})
    print(one_line(f"{counted(len(reported), 'result')} of {', '.join(agents)}: {out / PAGE}"))
