"""`mazebench train`."""

from __future__ import annotations

import contextlib
import itertools
import pathlib
import shlex
from collections.abc import Iterator
from typing import Annotated, Any

import typer

from mazebench import stopping
from mazebench.commands import progress
from mazebench.commands.display import load_mujoco
from mazebench.commands.option_parameters import parse_numbers, takes_options, words_of
from mazebench.errors import InputError
from mazebench.evaluation.eval_options import read_cluster
from mazebench.maps.benchmark import DEV, KINDS_SIZE, SIZES
from mazebench.maps.kinds import KNOWN
from mazebench.options import options_in
from mazebench.tasks.task import NOT_IN_EVALUATIONS
from mazebench.tasks.task_options import DRAWN_KINDS, LOCAL, TaskOptions
from mazebench.tasks.tracks import LEVELS
from mazebench.training.train_options import FIXED, TrainOptions


@takes_options(TrainOptions, TaskOptions, without=FIXED)
def train(
    agent: Annotated[
        str,
        typer.Option(help="A learning agent: dqn, mah, mah-paper, mmn, neural-planner or another, or module:Class."),
    ],
    values: dict[str, Any],
    out: Annotated[
        pathlib.Path | None,
        typer.Option(help="The run folder; runs/AGENT-[KINDS-]SIZE-SEED or runs/AGENT-TRACK-LEVEL-SEED if not given."),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the last checkpoint in --out.")] = False,
    seeds: Annotated[
        str | None, typer.Option(help="Train once for each of some seeds, as 0-4, into OUT/SEED; with --env-steps.")
    ] = None,
    cluster: Annotated[
        str | None,
        typer.Option(help="Train --seeds on the Ray cluster of this machine, ray, or on that at ray://HOST:PORT."),
    ] = None,
) -> None:
    """Train an agent, on the benchmark's training mazes or others; evaluated on held-out mazes of the same kinds."""
    load_mujoco(renders=False)
    from mazebench.evaluation.ray_cluster import RayExecutor
    from mazebench.training import loop, run_folder
    from mazebench.training.seeds import train_seeds

    options = TrainOptions(agent=agent, **options_in(values, TrainOptions))
    folder = out or pathlib.Path("runs") / _folder_name(options, values)
    if read_cluster(cluster) and seeds is None:
        raise InputError(f"expected --seeds with --cluster {cluster}, found none")
    if seeds is not None and "seed" in values:
        raise InputError("expected --seed or --seeds, found both")
    numbers = () if seeds is None else parse_numbers("seeds", seeds, least=0)
    folders = {
        seed: out / str(seed) if out else pathlib.Path("runs") / _folder_name(options.replace(seed=seed), values)
        for seed in numbers
    }

    def how_to_go_on() -> tuple[str, ...]:
        if seeds is not None:
            return (f"checkpoints are kept in {next(iter(folders.values())).parent}; go on", "--resume")
        last = next(reversed(run_folder.checkpoints(folder)), None)
        if last is None:
            return ("nothing is kept; run it again",)
        again = "" if options.minutes is None else f" for another {options.minutes:g} minutes"
        return (f"the checkpoint at {int(last.name):,} steps is kept in {folder}; go on{again}", "--resume")

    with stopping.stoppable(how_to_go_on, waits=True), progress.training() as show:
        task_options = {name: value for name, value in options_in(values, TaskOptions).items() if name != "task"}
        asked = TaskOptions(task=options.task[0], **task_options)
        if seeds is None:
            loop.run_training(options, asked, folder, resume, show)
        else:
            with RayExecutor(cluster) if cluster else contextlib.nullcontext() as executor:
                train_seeds(options, asked, folders, resume, executor, show)
    for each in folders.values() or [folder]:
        print(f"run in {each}; evaluate it by:")
        for words in _evaluations(options, task_options):
            print(shlex.join(["mazebench", "eval", "--agent", agent, "--checkpoint", str(each), *words]))


def _evaluations(options: TrainOptions, chosen: dict[str, Any]) -> Iterator[list[str]]:
    """Yields the words of `mazebench eval` for each track and level that was trained on, in frozen mazes if it can."""
    is_on_track = options.task != (LOCAL,)
    if "mazes" not in chosen and (is_on_track or {"num_mazes", "fresh"} & chosen.keys()):
        chosen = {"kinds": KNOWN if is_on_track else DRAWN_KINDS[:1], **chosen}  # those that are trained in
    is_frozen = is_on_track and "mazes" not in chosen and chosen.get("size", KINDS_SIZE) == KINDS_SIZE
    is_frozen = is_frozen and set(chosen["kinds"]) <= set(KNOWN)
    left_out = {"level", "num_mazes", *NOT_IN_EVALUATIONS, *(("kinds", "distances") if is_frozen else ())}
    words = words_of({name: value for name, value in chosen.items() if name not in left_out})
    for track, level in itertools.product(options.task, chosen.get("level", LEVELS[:1])):
        of_track = [] if track == LOCAL else ["--track", track, "--level", str(level)]
        yield [*of_track, *(["--split", DEV] if is_frozen else []), *words]


def _folder_name(options: TrainOptions, values: dict[str, Any]) -> str:
    parts = [options.agent.replace(":", "-"), *values.get("kinds", ()), *(["fresh"] if values.get("fresh") else [])]
    if "mazes" in values:
        parts.append(pathlib.Path(values["mazes"]).stem)
    levels = map(str, values.get("level", (1,)))
    parts += [str(values.get("size", SIZES[0]))] if options.task == (LOCAL,) else [*options.task, *levels]
    return "-".join([*parts, str(options.seed)])
