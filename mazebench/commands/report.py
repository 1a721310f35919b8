"""`mazebench report`."""

from __future__ import annotations

import pathlib
from typing import Annotated

import typer

from mazebench import stopping
from mazebench.errors import InputError, remark


def report(
    results: Annotated[
        list[pathlib.Path],
        typer.Argument(help="Evaluation folders, runs of suites, training runs, or folders above them."),
    ],
    out: Annotated[pathlib.Path, typer.Option(help="Folder for the report; an earlier report in it is replaced.")],
) -> None:
    """Make tables, figures and a page to explore every episode from results of `mazebench eval`.

    Of training runs, make figures of what they learned over their steps.
    """
    try:
        from mazebench.report.curves import find_runs, write_learning_curves
        from mazebench.report.episodes import find_evaluations
        from mazebench.report.write_report import DOCUMENT, PAGE, counted, write_report
    except ImportError as error:
        raise InputError(f"the report needs {error.name}, which the extra [report] installs (docs/start.md)") from error
    runs = find_runs(results)
    with stopping.stoppable(lambda: (f"the report in {out} is not whole; make it again",)):
        if runs and not find_evaluations(results):
            print(f"{counted(write_learning_curves(runs, out), 'training run')}: {out / DOCUMENT}")
            return
        if runs:
            remark(f"{counted(len(runs), 'training run')} left out beside results; report them by themselves")
        reported = write_report(results, out)
    agents = sorted({result.label for result in reported})
    print(f"{counted(len(reported), 'result')} of {', '.join(agents)}: {out / PAGE}")
