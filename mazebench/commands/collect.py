"""`mazebench collect`."""

from __future__ import annotations

import pathlib
from typing import Annotated, Any

import typer

from mazebench import stopping
from mazebench.commands import progress
from mazebench.commands.display import has_camera, load_mujoco
from mazebench.commands.option_parameters import takes_options
from mazebench.evaluation.collect_options import CollectOptions
from mazebench.evaluation.eval_options import EvalOptions, RunOptions
from mazebench.options import options_in
from mazebench.tasks.task_options import TaskOptions

_WITHOUT = (
    *("record", "workers", "ray", "ray_address"),  # one process collects
    *("episodes_per_distance", "num_goals", "context_size", "reward"),  # as in evaluations, which agents play
)


@takes_options(CollectOptions, RunOptions, TaskOptions, EvalOptions, without=_WITHOUT)
def collect(
    agent: Annotated[str, typer.Option(help="An installed agent (see `mazebench list`), or module:Class.")],
    out: Annotated[pathlib.Path, typer.Option(help="Folder for the episodes, a new or an empty one.")],
    values: dict[str, Any],
) -> None:
    """Collect demonstrations of an agent on training mazes, as a Minari data set or as arrays."""
    load_mujoco(renders=has_camera(values.get("sensors", ())))
    from mazebench.evaluation.collect import collect_demonstrations, num_kept

    task = TaskOptions(**options_in(values, TaskOptions))
    options = EvalOptions(agent=agent, task=task, **options_in(values, EvalOptions))
    wanted, run = CollectOptions(**options_in(values, CollectOptions)), RunOptions(**options_in(values, RunOptions))

    def how_to_go_on() -> tuple[str, ...]:
        return (
            f"{num_kept(out, wanted.episodes):,} of {wanted.episodes:,} episodes are kept in {out}; go on",
            "--resume",
        )

    with (
        stopping.stoppable(how_to_go_on, waits=True),
        progress.evaluating(f"{agent}, {task.title}", progress.Kept()) as show,
    ):
        collect_demonstrations(options, wanted, out, resume=run.resume, num_envs=run.num_envs, progress=show)
    print(f"{wanted.episodes:,} episodes in {out}")
