"""`mazebench play`."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from mazebench.commands.display import load_mujoco
from mazebench.commands.option_parameters import chosen, takes_options, watched
from mazebench.errors import InputError
from mazebench.evaluation.eval_options import EvalOptions
from mazebench.maps.maze_options import MazeOptions
from mazebench.tasks.task_options import TaskOptions
from mazebench.world.backend import has_display


@takes_options(EvalOptions, without=["episodes_per_distance", "fresh", "camera_size", "textures", "checkpoint", "seed"])
def play(
    values: dict[str, Any],
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first episode and those after it.")] = 0,
) -> None:
    """Drive yourself, with the keyboard, in a window."""
    mazes = chosen(MazeOptions, values)
    task = watched(chosen(TaskOptions, values), mazes)
    load_mujoco(renders=has_display())
    from mazebench.play import viewer
    from mazebench.play.game import LIDAR, Game
    from mazebench.tasks.build import build_task

    for sensor in task.sensors:
        if sensor != LIDAR:
            raise InputError(f"expected sensors {LIDAR} or none, found {sensor}, which is not shown while you drive")
    game = Game(build_task(task, mazes), seed)
    viewer.play(game)
    print(game.outcome())
