"""`mazebench eval`."""

from __future__ import annotations

import functools
import pathlib
import traceback
from typing import Annotated, Any

import typer

from mazebench import stopping
from mazebench.commands import progress
from mazebench.commands.display import load_mujoco
from mazebench.commands.option_parameters import NoCache, takes_options
from mazebench.errors import InputError, RunError
from mazebench.evaluation.eval_options import EPISODES, WHOLE, EvalOptions, RunOptions
from mazebench.options import fields_of, options_in
from mazebench.tasks.task import NOT_IN_EVALUATIONS
from mazebench.tasks.task_options import TaskOptions


@takes_options(RunOptions, TaskOptions, EvalOptions, without=NOT_IN_EVALUATIONS)
def evaluate(
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
            help="Evaluations by name instead: paper, the paper's protocol; quick, minutes of it; tracks, every track "
            "at all levels; tracks-dev, in the mazes to choose agents by; tracks-no-map, with the map hidden; "
            "tracks-no-goal, with map and goal hidden; tracks-true-pose, with the true pose where it is lost; "
            "tracks-camera and tracks-camera-dev, by camera alone; tracks-goals and tracks-goals-dev, three goals in "
            "a row where doors have moved; real and real-dev, real buildings with right, changed, old and no maps; "
            "real-camera, by camera alone; llm and llm-dev, a few episodes, for agents whose answers cost; people-dev, "
            "twelve episodes, for people."
        ),
    ] = None,
    out: Annotated[
        pathlib.Path | None, typer.Option(help="Folder for the results; a new one in results/ if not given.")
    ] = None,
    shard: Annotated[
        str | None,
        typer.Option(
            help="Run one of N shares into OUT/shards, as 3/16, or as slurm for that of this task of an array of "
            "Slurm's; `mazebench merge OUT` makes one run of them."
        ),
    ] = None,
    show_traceback: Annotated[
        bool, typer.Option("--traceback", help="If the agent raises, show where; not with --workers.")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say how many episodes there are and what they may cost; run nothing.")
    ] = False,
    no_cache: NoCache = False,  # its callback does it
) -> None:
    """Evaluate agents on unseen mazes: success rate and SPL with 95 % intervals."""
    from mazebench.evaluation.checked_agent import AgentError

    if suite is None and len(agents) > 1:
        raise InputError(f"expected one --agent without --suite, found {len(agents)}")
    if suite is not None:
        own = {*fields_of(TaskOptions), *EPISODES} - {"body"}
        if named := [name for name in values if name in own]:
            raise InputError(f"the suite {suite!r} has evaluations of its own; found --{named[0].replace('_', '-')}")
    run = RunOptions(**options_in(values, RunOptions))
    if (run.resume or shard) and out is None:
        raise InputError(f"{'--resume' if run.resume else '--shard'} needs --out, the folder of the run")
    load_mujoco(renders=False)

    from mazebench.commands.summary_table import print_summaries
    from mazebench.evaluation.evaluate import run_evaluation
    from mazebench.evaluation.shards import end_shard, read_shard, shard_folder
    from mazebench.evaluation.suites import run_suite

    task = TaskOptions(**options_in(values, TaskOptions))
    options = EvalOptions(agent=agents[0], task=task, **options_in(values, EvalOptions))
    is_of_paper = suite is None and task.track is None and task.mazes is None and not task.is_drawn
    if is_of_paper and task.split in (None, "eval"):
        print("evaluating in the eval mazes of the paper's protocol, which has no dev split; tracks have one (--track)")
    title = f"{agents[0]}, {task.task}" if suite is None else f"{suite}, {', '.join(agents)}"
    name = suite or f"{agents[0].replace(':', '-')}-{task.task}"
    folder = out or progress.new_folder(name)
    share = WHOLE
    if shard is not None:
        share = read_shard(shard)
        folder = shard_folder(folder, share)
    if run.resume:
        begun = folder.is_dir() and any(folder.iterdir())
        print(f"resuming {folder}" if begun else f"nothing to resume in {folder}; starting a new run")
    kept = progress.Kept()
    try:
        with stopping.stoppable(lambda: kept.how_to_go_on(folder, out is not None), waits=True):
            with progress.evaluating(title, kept) as show:
                summing = functools.partial(show, sums_up=True)
                how: dict[str, Any] = {"shard": share, "is_dry": dry_run}
                if suite is None:
                    summary = run_evaluation(options, folder, run, show, summing=summing, **how)
                    summaries = [summary] if summary else []
                else:
                    chosen = {name: getattr(options, name) for name in ("checkpoint", "seed", "overrides")}
                    summaries = run_suite(suite, agents, folder, run, show, summing, body=task.body, **how, **chosen)
            if dry_run:
                return
            if shard is not None:
                end_shard(folder, share)
            else:
                print_summaries(summaries, folder)
    except AgentError as error:
        if show_traceback and error.__cause__ is not None:
            traceback.print_exception(error.__cause__)
        raise RunError(f"{error}; {kept} in {folder}" if kept.ended else str(error)) from error
    print(f"results in {folder}" + (f"; when all shards have ended: mazebench merge {out}" if shard else ""))
