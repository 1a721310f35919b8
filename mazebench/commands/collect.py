"""`mazebench collect`."""

from __future__ import annotations

import pathlib
from typing import Annotated, Any

import typer

from mazebench import stopping
from mazebench.commands import progress
from mazebench.commands.display import load_mujoco
from mazebench.commands.option_parameters import takes_options
from mazebench.evaluation.eval_options import EPISODES, EvalOptions, RunOptions
from mazebench.options import options_in
from mazebench.tasks.task_options import TaskOptions

_WITHOUT = (
    *("resume", "record"),  # all or nothing is kept
    *(*EPISODES, "num_goals", "context_size", "reward"),  # as in evaluations, which agents play
)


@takes_options(RunOptions, TaskOptions, EvalOptions, without=_WITHOUT)
def collect(
    agent: Annotated[str, typer.Option(help="An installed agent (see `mazebench list`), or module:Class.")],
    out: Annotated[pathlib.Path, typer.Option(help="Folder for the data set, a new or an empty one.")],
    values: dict[str, Any],
    episodes: Annotated[int, typer.Option(min=1, help="How many episodes.")] = 100,
    context_per_step: Annotated[
        bool, typer.Option(help="Write the context of each step into its observation, as in the environment.")
    ] = False,
) -> None:
    """Collect demonstrations of an agent on training mazes, as a Minari data set."""
    load_mujoco(renders=False)
    from mazebench.evaluation.collect import collect_demonstrations
    from mazebench.results.naming import title_of

    task, run = TaskOptions(**options_in(values, TaskOptions)), RunOptions(**options_in(values, RunOptions))
    options = EvalOptions(agent=agent, task=task, **options_in(values, EvalOptions))
    with (
        stopping.stoppable(lambda: ("nothing is kept; run it again",)),
        progress.evaluating(f"{agent}, {title_of(task)}", progress.Kept()) as show,
    ):
        collect_demonstrations(options, episodes, out, run=run, context_per_step=context_per_step, progress=show)
    print(f"{episodes:,} episodes in {out}")
