"""`mazebench render`."""

from __future__ import annotations

import pathlib
from typing import Annotated, Any

import typer

from mazebench.commands.display import load_mujoco
from mazebench.commands.option_parameters import takes_options, watched_task
from mazebench.evaluation.eval_options import EPISODES, EvalOptions
from mazebench.options import options_in
from mazebench.tasks.task import NOT_IN_EVALUATIONS
from mazebench.tasks.task_options import TaskOptions

_DRAWN = ("map", "lidar", "depth", "labels")  # views that need no rendering, and those of the sensors


@takes_options(TaskOptions, EvalOptions, without=[*NOT_IN_EVALUATIONS, "num_goals", *EPISODES])
def render(
    out: Annotated[pathlib.Path, typer.Option(help="FILE.mp4 or .gif of an episode, FILE.png of its last moment.")],
    values: dict[str, Any],
    agent: Annotated[str, typer.Option(help="Who drives.")] = "planner-closed-loop",
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
    options = EvalOptions(agent=agent, task=watched_task(values).options, **options_in(values, EvalOptions))
    load_mujoco(renders=view not in (*_DRAWN, *values.get("sensors", ())))
    from mazebench.play import film

    outcome = film.film_episode(options, out, view, pixels)
    print(f"{out}: {outcome}")
