"""`mazebench play`."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from mazebench.commands.display import load_mujoco
from mazebench.commands.option_parameters import takes_options, watched_task
from mazebench.errors import InputError
from mazebench.tasks.sensors import LIDAR
from mazebench.tasks.sensors.sensor import CAMERA_OPTIONS
from mazebench.tasks.task import NOT_IN_EVALUATIONS
from mazebench.tasks.task_options import TaskOptions
from mazebench.world.backend import has_display


@takes_options(TaskOptions, without=[*NOT_IN_EVALUATIONS, "num_goals", "actions", *CAMERA_OPTIONS])
def play(
    values: dict[str, Any],
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first episode and those after it.")] = 0,
) -> None:
    """Drive yourself, with the keyboard, in a window."""
    task = watched_task(values)
    load_mujoco(renders=has_display())
    from mazebench.play import viewer
    from mazebench.play.game import Game

    for sensor in task.sensors:
        if sensor != LIDAR:
            raise InputError(f"expected sensors {LIDAR} or none, found {sensor}, which is not shown while you drive")
    game = Game(task, seed)
    viewer.play(game)
    print(game.outcome())
