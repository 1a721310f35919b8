"""`mazebench play`."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from mazebench.commands.display import has_display
from mazebench.commands.options import refuse_ignored_by_task, takes_options
from mazebench.evaluation.options import TASK_CHOICES, EvalOptions

# The episode to play; sensors are for agents that were made for them.
_CHOICES = tuple(name for name in TASK_CHOICES if name not in ("episodes_per_distance", "sensors", "camera_size"))


@takes_options(EvalOptions, _CHOICES, distances=(10,))
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
    from mazebench.play.game import Game
    from mazebench.tasks.registry import make_spec

    game = Game(make_spec(**values), seed)
    if terminal or not has_display():
        from mazebench.play import terminal as screen
    else:
        from mazebench.play import viewer as screen  # type: ignore[no-redef]
    screen.play(game)
    print(game.outcome())
