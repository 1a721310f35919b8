"""`mazebench eval`."""

from __future__ import annotations

import datetime
import os
import pathlib
import traceback
from typing import Annotated, Any

import typer

from mazebench import stopping
from mazebench.commands import progress
from mazebench.commands.display import has_camera, load_mujoco
from mazebench.commands.options import NO_CAMERA, refuse_ignored, refuse_ignored_by_task, takes_options
from mazebench.errors import InputError, RunError, remark
from mazebench.evaluation.options import NUM_ENVS, TASK_CHOICES, EvalOptions


@takes_options(EvalOptions, (*TASK_CHOICES, "checkpoint", "seed"))
def evaluate(
    context: typer.Context,
    agents: Annotated[
        list[str],
        typer.Option(
            "--agent", help="An installed agent (see `mazebench list`), or module:Class; several with --suite."
        ),
    ],
    values: dict[str, Any],
    suite: Annotated[
        str | None,
        typer.Option(
            help="Evaluations by name instead: paper, the whole protocol; quick, minutes of it; or tracks, every track "
            "at all levels."
        ),
    ] = None,
    out: Annotated[
        pathlib.Path | None, typer.Option(help="Folder for the results; a new one in results/ if not given.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in --out.")] = False,
    record: Annotated[
        bool | None,
        typer.Option("--record/--no-record", help="Write trajectories too; a suite does by default."),
    ] = None,
    show_traceback: Annotated[
        bool, typer.Option("--traceback", help="If the agent raises, show where; not with --workers or --ray.")
    ] = False,
    num_envs: Annotated[
        int, typer.Option(min=1, help="Environments side by side in each process, at most.")
    ] = NUM_ENVS,
    workers: Annotated[
        int, typer.Option(min=0, help="Processes; 0 runs in this one, and with --ray on all its CPUs.")
    ] = 0,
    ray: Annotated[
        bool, typer.Option("--ray", help="Run the workers on Ray; without an address, on this machine.")
    ] = False,
    ray_address: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Of a Ray cluster for the workers; auto finds one that runs here."),
    ] = None,
) -> None:
    """Evaluate agents on unseen mazes: success rate and SPL with 95 % intervals."""
    from mazebench.evaluation.checked_agent import AgentError

    if suite is None and len(agents) > 1:
        raise InputError(f"expected one --agent without --suite, found {len(agents)}")
    refuse_ignored(
        context,
        (suite is not None, f"the suite {suite!r} has evaluations of its own", TASK_CHOICES),
        (bool(workers or ray or ray_address), "the agent acts in other processes", ("show_traceback",)),
    )
    refuse_ignored_by_task(context, values)
    if resume and out is None:
        raise InputError("--resume needs --out, the folder of the run to go on with")
    refuse_ignored(context, (not has_camera(values["sensors"]), *NO_CAMERA))
    load_mujoco(renders=has_camera(values["sensors"]))
    folder = out or _new_folder(suite or f"{agents[0].replace(':', '-')}-{values['track'] or values['task']}")
    if resume:
        begun = folder.is_dir() and any(folder.iterdir())
        print(f"resuming {folder}" if begun else f"nothing to resume in {folder}; starting a new run")
    kept = progress.Kept()
    running: dict[str, Any] = {"resume": resume, "num_envs": num_envs, "workers": workers}
    running["ray_address"] = ray_address or ("local" if ray else None)

    def how_to_go_on() -> tuple[str, ...]:
        if kept.of is None and not folder.exists():
            return ("nothing was begun; run it again",)
        return (f"{kept} in {folder}; go on", *(() if out else ("--out", str(folder))), "--resume")

    try:
        with stopping.stoppable(how_to_go_on):
            if suite is None:
                _evaluate_one(agents[0], values, folder, bool(record), kept, running)
            else:
                _evaluate_suite(suite, agents, values, folder, record, kept, running)
    except AgentError as error:
        if show_traceback and error.__cause__ is not None:
            traceback.print_exception(error.__cause__)
        raise RunError(f"{error}; {kept} in {folder}" if kept.ended else str(error)) from error
    print(f"results in {folder}")


def _evaluate_one(
    agent: str,
    values: dict[str, Any],
    folder: pathlib.Path,
    record: bool,
    kept: progress.Kept,
    running: dict[str, Any],
) -> None:
    from mazebench.commands import table
    from mazebench.evaluation import evaluate

    with progress.evaluating(f"{agent}, {values['track'] or values['task']}", kept) as show:
        summary = evaluate.evaluate(agent, folder, record=record, progress=show, warn=remark, **running, **values)
    table.print_summary(summary)


def _evaluate_suite(
    suite: str,
    agents: list[str],
    values: dict[str, Any],
    folder: pathlib.Path,
    record: bool | None,
    kept: progress.Kept,
    running: dict[str, Any],
) -> None:
    from mazebench.commands import table
    from mazebench.evaluation import suites

    chosen = {name: values[name] for name in ("checkpoint", "seed")}
    with progress.evaluating(f"{suite}, {', '.join(agents)}", kept) as show:
        summaries = suites.run_suite(
            suite, agents, folder, record=record, progress=show, warn=remark, **chosen, **running
        )
    table.print_suite(summaries)


def _new_folder(name: str) -> pathlib.Path:
    """Returns a folder in results/ that no run has."""
    # The process tells runs apart that start at the same time.
    return pathlib.Path("results") / f"{name}-{datetime.datetime.now():%Y%m%d-%H%M%S-%f}-{os.getpid()}"
