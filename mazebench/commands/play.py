"""`mazebench play`."""

from __future__ import annotations

import dataclasses
import functools
import pathlib
from typing import Annotated, Any, Literal

import typer

from mazebench import stopping
from mazebench.commands import progress
from mazebench.commands.display import load_mujoco
from mazebench.commands.option_parameters import takes_options
from mazebench.errors import InputError
from mazebench.evaluation.eval_options import EPISODES, EvalOptions, RunOptions
from mazebench.options import fields_of, options_in
from mazebench.play.person import read_name
from mazebench.tasks.sensors import LIDAR
from mazebench.tasks.sensors.cameras import CameraOptions
from mazebench.tasks.task import NOT_IN_EVALUATIONS, resolve_for_evaluation
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.trials import counting_option

_AGENT = "person"
_WITHOUT = (
    *NOT_IN_EVALUATIONS,
    *("sensors", "num_goals", "landmark_distance", "checkpoint", "overrides"),  # --view and --name choose the rest
    *fields_of(RunOptions).keys() - {"resume"},  # a person drives one robot at a time
)
_SENSES: dict[str, dict[str, Any]] = {
    "camera": {"sensors": ("egocentric",), "camera_size": 320, "camera_fov": 110.0},
    "lidar": {"sensors": (LIDAR,)},
}


@takes_options(RunOptions, TaskOptions, EvalOptions, without=_WITHOUT)
def play(
    values: dict[str, Any],
    suite: Annotated[
        str | None, typer.Option(help="Evaluations by name instead, as people-dev: twelve episodes in three settings.")
    ] = None,
    name: Annotated[str, typer.Option(help="Who drives, by which results tell people apart.")] = "",
    view: Annotated[
        Literal["camera", "lidar"], typer.Option(help="What is shown of the building: a picture, or ranges.")
    ] = "camera",
    real_time: Annotated[
        bool, typer.Option("--real-time", help="Time runs on while no key is down; the actions are velocities.")
    ] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page on 127.0.0.1; 0 for a free one.")] = 0,
    out: Annotated[
        pathlib.Path | None, typer.Option(help="Folder for the results; a new one in results/ if not given.")
    ] = None,
) -> None:
    """Drive the episodes of an evaluation yourself, on a page in a browser on this machine."""
    name = read_name(name)
    if values.get("resume") and out is None:
        raise InputError("--resume needs --out, the folder of the run")
    chosen = {*CameraOptions.__annotations__, "body", "actions"}  # also of a suite
    if suite and (named := [each for each in values if each in {*fields_of(TaskOptions), *EPISODES} - chosen]):
        raise InputError(f"the suite {suite!r} has evaluations of its own; found --{named[0].replace('_', '-')}")
    load_mujoco(renders=False)
    try:
        from mazebench.play.page import Page
        from mazebench.play.session import Session
    except ImportError as error:
        raise InputError(f"mazebench play needs {error.name}, which the extra [play] brings (docs/play.md)") from error
    from mazebench.commands.summary_table import print_summaries
    from mazebench.evaluation.evaluate import run_evaluation
    from mazebench.evaluation.suites import parts_of, run_suite

    # What is driven.
    task = TaskOptions(**_SENSES[view] | options_in(values, TaskOptions))
    if task.is_hierarchical:
        raise InputError(f"expected --task local or a track, found {task.task}")
    if real_time:
        velocities = "velocity" if task.driven_body.strafes else "diff"
        if task.actions not in (None, velocities):
            raise InputError(f"expected --actions {velocities} in real time, found {task.actions}")
        task = task.replace(actions=velocities)
    counting = counting_option(resolve_for_evaluation(task).options)
    number = {} if counting is None else {counting: 1}  # of episodes, for which people have the time
    asked = {"agent": _AGENT, "overrides": {"name": name}, **options_in(values, EvalOptions)}
    options = EvalOptions(task=task, **number | asked)
    run = RunOptions(record=True, resume=values.get("resume", False))
    folder, kept = out or progress.new_folder(suite or f"{_AGENT}-{task.task}"), progress.Kept()
    with (
        stopping.stoppable(lambda: kept.how_to_go_on(folder, out is not None), waits=True),
        Page(port) as page,
        Session(page, name, real_time) as session,
    ):
        print(f"open {page.address} in a browser on this machine; Ctrl-C ends, and --resume goes on", flush=True)
        with progress.evaluating(f"{name or _AGENT}, {suite or task.task}", kept) as show:

            def advance(ended: int, of: int) -> None:
                session.num_ended, session.num_episodes = ended, of
                show(ended, of)

            summing = functools.partial(show, sums_up=True)
            if suite is None:
                summary = run_evaluation(options, folder, run, advance, summing=summing, pool=session)
                summaries = [summary] if summary else []
            else:
                seen = {each: getattr(task, each) for each in (*_SENSES[view], *(chosen & values.keys()), "actions")}
                parts = [dataclasses.replace(each, task=each.task.replace(**seen)) for each in parts_of(suite)]
                overrides = {"name": name}
                summaries = run_suite(
                    suite, [_AGENT], folder, run, advance, summing, overrides=overrides, own_parts=parts, pool=session
                )
        page.show({"phase": "over", "words": f"All {kept.of} episodes have ended. The results are in {folder}."})
    print_summaries(summaries, folder)
    print(f"results in {folder}")
