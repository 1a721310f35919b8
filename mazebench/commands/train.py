"""`mazebench train`."""

from __future__ import annotations

import pathlib
from typing import Annotated

import typer

from mazebench import stopping
from mazebench.commands import progress
from mazebench.commands.options import refuse_ignored
from mazebench.errors import InputError


def train(
    context: typer.Context,
    agent: Annotated[str, typer.Option(help="A learning agent: mmn, mah or dqn, or module:Class.")],
    size: Annotated[int, typer.Option(help="Size of the benchmark's training mazes: 13, 15, 17, 19 or 21.")] = 13,
    pairs: Annotated[str, typer.Option(help="random, or fixed: one start-goal pair a maze.")] = "random",
    minutes: Annotated[float | None, typer.Option(min=0, help="How long this sitting lasts.")] = None,
    env_steps: Annotated[int | None, typer.Option(min=1, help="Agent steps of the run, all sittings together.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything that is drawn.")] = 0,
    out: Annotated[pathlib.Path | None, typer.Option(help="The run folder; runs/AGENT-SIZE-SEED if not given.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the last checkpoint in --out.")] = False,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="A value of the agent's config; repeatable."),
    ] = None,
    checkpoint_steps: Annotated[
        int, typer.Option(min=1, help="Agent steps between checkpoints, each with an evaluation.")
    ] = 200_000,
    eval_mazes: Annotated[int, typer.Option(min=1, help="Held-out mazes of an evaluation, 10 episodes in each.")] = 20,
    workers: Annotated[int, typer.Option(min=0, help="Ray actors that collect; 0 collects in this process.")] = 0,
    ray: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Address of a Ray cluster for the workers; local if not given."),
    ] = None,
) -> None:
    """Train an agent on the benchmark's training mazes; evaluated now and then on held-out mazes of the same kind."""
    from mazebench.training import loop, run_folder
    from mazebench.training.options import TrainOptions

    refuse_ignored(context, (not workers, "without --workers this process collects by itself", ("ray",)))
    options = TrainOptions(
        agent=agent,
        size=size,
        pairs=pairs,
        seed=seed,
        overrides=tuple(_parse_override(text) for text in overrides or []),
        minutes=minutes,
        env_steps=env_steps,
        checkpoint_steps=checkpoint_steps,
        eval_mazes=eval_mazes,
        workers=workers,
        ray_address=ray,
    )
    folder = out or pathlib.Path("runs") / f"{agent.replace(':', '-')}-{size}-{seed}"

    def how_to_go_on() -> tuple[str, ...]:
        last = next(reversed(run_folder.checkpoints(folder)), None)
        if last is None:
            return ("nothing is kept; run it again",)
        return (f"the checkpoint at {int(last.name):,} steps is kept in {folder}; go on", "--resume")

    with stopping.stoppable(how_to_go_on), progress.training() as report:
        loop.train(options, folder, resume, report)
    print(f"run in {folder}; evaluate it by: mazebench eval --agent {agent} --checkpoint {folder}")


def _parse_override(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals or not key:
        raise InputError(f"expected --set KEY=VALUE, found {text!r}")
    return key.strip(), value.strip()
