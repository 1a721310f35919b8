"""`mazebench check-map`."""

from __future__ import annotations

import functools
import pathlib
from typing import Annotated, Any

import typer

from mazebench import stopping
from mazebench.commands import progress
from mazebench.commands.display import load_mujoco
from mazebench.commands.option_parameters import NoCache, takes_options
from mazebench.errors import InputError, RunError
from mazebench.evaluation.eval_options import EPISODES, EvalOptions, RunOptions
from mazebench.maps.maze_options import ReadOptions
from mazebench.options import fields_of, options_in
from mazebench.tasks.task_options import TaskOptions

_TAKEN = {"mazes", "shown", "align", "body", "distances", *fields_of(ReadOptions)}
_LEFT_OUT = (*(fields_of(TaskOptions).keys() - _TAKEN), *EPISODES, "record", "workers")


@takes_options(RunOptions, TaskOptions, EvalOptions, without=_LEFT_OUT)
def check_map(
    out: Annotated[pathlib.Path, typer.Option(help="Folder for the page, its figures and the results.")],
    values: dict[str, Any],
    agents: Annotated[
        list[str] | None,
        typer.Option(
            "--agent", help="Who drives: an installed agent or module:Class; navigator if not given. Repeatable."
        ),
    ] = None,
    strength: Annotated[
        int | None,
        typer.Option(
            "--changed",
            min=1,
            max=3,
            help="Instead of --shown: --mazes is the old map of four buildings with made changes of this strength.",
        ),
    ] = None,
    num_trips: Annotated[int, typer.Option("--trips", min=2, help="Trips, in all buildings together.")] = 48,
    workers: Annotated[int | None, typer.Option(min=0, help="Processes; as many as cores if not given.")] = None,
    no_cache: NoCache = False,  # its callback does it
) -> None:
    """Tell what an old map costs a robot per trip, and where: the same trips are driven with each map and without."""
    load_mujoco(renders=False)
    try:
        from mazebench.report.check_page import INDEX, read_checks, write_check
    except ImportError as error:
        raise InputError(f"the page needs {error.name}, which the extra [report] installs (docs/start.md)") from error
    from mazebench.evaluation.checked_agent import AgentError
    from mazebench.evaluation.map_check import plan_check
    from mazebench.kernels import num_cores

    names = agents or ["navigator"]
    asked, chosen = TaskOptions(**options_in(values, TaskOptions)), options_in(values, EvalOptions)
    check = plan_check(asked, strength, num_trips, chosen.get("seed", 0))
    workers = num_cores() if workers is None else workers
    run = RunOptions(**options_in(values, RunOptions), record=True, workers=workers)
    if not check.is_finished(names, out):
        seconds = check.seconds(names, workers, **chosen)
        print(f"{num_trips} trips with {len(check.tasks)} maps: about {max(1, round(seconds / 60))} min", flush=True)
    kept = progress.Kept()
    try:
        with stopping.stoppable(lambda: (f"{kept} in {out}; go on", "--resume"), waits=True):
            with progress.evaluating(f"check-map, {', '.join(names)}", kept) as show:
                check.run(names, out, run, show, functools.partial(show, sums_up=True), **chosen)
            checks = read_checks(out, check.older, check.top_speed)
            write_check(out, checks, check.older)
    except AgentError as error:
        raise RunError(f"{error}; {kept} in {out}" if kept.ended else str(error)) from error
    for each in checks:
        print(f"{each.agent}: {each.answer.sentence}\nVerdict: {each.answer.verdict}.")
        for spot in each.worst:
            print(f"  {each.describe(spot)}")
    print(f"page in {out / INDEX}")
