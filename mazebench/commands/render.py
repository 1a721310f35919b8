"""`mazebench render`."""

from __future__ import annotations

import pathlib
from typing import Annotated, Any

import typer

from mazebench.commands.display import load_mujoco
from mazebench.commands.option_parameters import takes_options, watched_task
from mazebench.errors import InputError
from mazebench.evaluation.eval_options import EPISODES, EvalOptions
from mazebench.options import options_in
from mazebench.tasks.task import NOT_IN_EVALUATIONS
from mazebench.tasks.task_options import TaskOptions

_AGENT = "planner-closed-loop"
_DRAWN = ("map", "lidar", "depth", "labels")  # views that need no rendering, and those of the sensors


@takes_options(TaskOptions, EvalOptions, without=[*NOT_IN_EVALUATIONS, "num_goals", *EPISODES])
def render(
    out: Annotated[pathlib.Path, typer.Option(help="FILE.mp4 or .gif of an episode, FILE.png of its last moment.")],
    values: dict[str, Any],
    agent: Annotated[
        str | None, typer.Option(help=f"Who drives; {_AGENT} if not given. With --results, a module:Class of theirs.")
    ] = None,
    results: Annotated[
        pathlib.Path | None, typer.Option(help="A finished evaluation: its agent runs --episode of it again.")
    ] = None,
    episode: Annotated[int | None, typer.Option(min=0, help="Number of an episode in --results.")] = None,
    view: Annotated[
        str,
        typer.Option(
            help="top, egocentric, chase, map (shown map and driven path), one of the --sensors (lidar: true maze and "
            "rays; egocentric, depth and labels: what the agent saw), or all of them side by side."
        ),
    ] = "all",
    pixels: Annotated[int, typer.Option(min=64, max=1280, help="Side of a view.")] = 360,
) -> None:
    """Film an episode, or picture it: from above, through the agent's eyes, on its map."""
    if (results is None) != (episode is None):
        raise InputError("expected --results and --episode together, found one of them")
    if results and (chosen := [*values.keys() - {"checkpoint", "overrides"}]):
        raise InputError(f"--results has an agent and options of its own; found --{min(chosen).replace('_', '-')}")
    from mazebench.results.reading import load_result  # imported late: it takes long

    result = load_result(results) if results else None
    task = result.summary.task if result else watched_task(values).options
    load_mujoco(renders=view not in (*_DRAWN, *task.sensors))
    from mazebench import film

    if result and episode is not None:
        outcome = film.film_result(result, episode, out, view, pixels, agent, **values)
    else:
        options = EvalOptions(agent=agent or _AGENT, task=task, **options_in(values, EvalOptions))
        outcome = film.film_episode(options, out, view, pixels)
    print(f"{out}: {outcome}")
