"""`mazebench play`."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from mazebench.commands.display import load_mujoco
from mazebench.commands.options import refuse_ignored_by_task, takes_options, watched_distances
from mazebench.errors import InputError
from mazebench.evaluation.options import TASK_CHOICES, EvalOptions
from mazebench.world.backend import has_display

_CHOICES = tuple(name for name in TASK_CHOICES if name not in ("episodes_per_distance", "camera_size", "textures"))


@takes_options(EvalOptions, _CHOICES)
def play(
    context: typer.Context,
    values: dict[str, Any],
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first episode and those after it.")] = 0,
    terminal: Annotated[
        bool, typer.Option("--terminal", help="In this terminal, where there is a display too.")
    ] = False,
) -> None:
    """Drive yourself, with the keyboard: in MuJoCo's viewer, or without a display in the terminal."""
    refuse_ignored_by_task(context, values)
    values["distances"] = watched_distances(values)
    in_window = has_display() and not terminal
    load_mujoco(renders=in_window)
    from mazebench.play.game import LIDAR, Game
    from mazebench.tasks.registry import make_spec

    for sensor in values["sensors"]:
        if sensor != LIDAR:
            raise InputError(f"expected sensors {LIDAR} or none, found {sensor}, which is not shown while you drive")
    game = Game(make_spec(**values), seed)
    if in_window:
        from mazebench.play import viewer as screen
    else:
        from mazebench.play import terminal as screen  # type: ignore[no-redef]
    screen.play(game)
    print(game.outcome())
