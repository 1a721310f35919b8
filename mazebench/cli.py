"""The command line: parses and calls. What a command does stands in the module that it imports when it runs."""

from __future__ import annotations

import datetime
import enum
import io
import json
import os
import pathlib
import sys
from contextlib import ExitStack
from traceback import print_exception
from typing import Annotated, Any, NoReturn

import typer

from mazebench import __version__, progress, stopping
from mazebench.errors import InputError, RunError, one_line

# The parser's own error, which typer exports by its children only.
_UsageError: type[Exception] = typer.BadParameter.__mro__[2]

app = typer.Typer(
    help="Zero-shot navigation in unseen 3-D mazes from abstract top-down maps, on MuJoCo.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
)


class TaskName(enum.StrEnum):
    """Tasks, for the parser's choice."""

    local = "local"
    hierarchical = "hierarchical"


class Split(enum.StrEnum):
    """Splits, for the parser's choice."""

    train = "train"
    eval = "eval"


def main() -> None:
    """Runs a command: exit status 0 done, 1 a run failed, 2 bad input, which gets one line and no traceback.

    An interrupt ends it with 130 and SIGTERM with 143, and one line that says how to go on.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names of files need not be legal Unicode
    try:
        with stopping.listening(), stopping.stoppable(lambda: ("run it again",)):
            try:
                status = app(sys.argv[1:] or ["--help"], standalone_mode=False) or 0
            except typer.Abort:
                status = 130
            if status == 130:  # typer's, of an interrupt
                raise KeyboardInterrupt
            sys.exit(status)
    except _UsageError as error:
        _fail(error.format_message(), 2)  # type: ignore[attr-defined]
    except InputError as error:
        _fail(str(error), 2)
    except OSError as error:
        if error.filename is None:  # as of what it is printed to
            _fail(f"can't write: {error.strerror or error}", 1)
        _fail(f"{error.filename}: {error.strerror or error}", 2)
    except RunError as error:
        _fail(str(error), 1)


def _fail(message: str, status: int) -> NoReturn:
    _remark(" ".join(message.split()))
    sys.exit(status)


def _remark(line: str) -> None:
    print(f"mazebench: {one_line(line)}", file=sys.stderr)


def _version(asked: bool) -> None:
    if asked:
        print(__version__)
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@app.command()
def generate(
    context: typer.Context,
    size: Annotated[
        int | None,
        typer.Option(help="Cells a side, 5 to 255; 13 if not given. With --from-image, what the picture shows."),
    ] = None,
    count: Annotated[int, typer.Option(min=1, help="How many mazes.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same mazes.")] = 0,
    style: Annotated[str, typer.Option(help="dfs, rooms or obstacles.")] = "dfs",
    out: Annotated[pathlib.Path, typer.Option(help="Folder to fill with NAME.txt, NAME.xml, ...")] = pathlib.Path(
        "mazes"
    ),
    formats: Annotated[
        str, typer.Option("--format", help="Files to write: any of mjcf, txt, png, glb, obj, stl, separated by commas.")
    ] = "txt,mjcf,png,glb",
    from_image: Annotated[
        pathlib.Path | None, typer.Option(help="Read the maze off a picture of a floor plan, or a text map, instead.")
    ] = None,
) -> None:
    """Make mazes: MJCF for MuJoCo, text, picture, mesh."""
    from mazebench import making
    from mazebench.files import make_folder
    from mazebench.records import FolderLock

    _refuse_ignored(context, (from_image is not None, "the picture shows one maze", ("count", "seed", "style")))
    mazes = making.make_mazes(size, count, seed, style, from_image)
    chosen = making.parse_formats(formats)
    with ExitStack() as opened:
        for index, maze in enumerate(mazes):
            if index == 0:  # nothing is made for bad input
                make_folder(out)
                opened.enter_context(FolderLock(out))
            for path in making.write_maze(maze, out, chosen, from_image):
                print(path)
            if index == 0:
                _preview(maze)


def _preview(maze: Any) -> None:
    """Draws a maze that fits the terminal; where nobody looks, in the text form of maps."""
    from rich.console import Console
    from rich.text import Text

    from mazebench.maps.text import format_maze

    console = Console()
    if console.width < 2 * maze.size:
        return
    if not console.is_terminal:
        print(format_maze(maze), end="")
        return
    for row in maze.walls:
        line = Text()
        for wall in row:
            line.append("  ", style="on grey27" if wall else "on grey93")
        console.print(line)


# Options that several commands have.
_MapFlip = Annotated[float, typer.Option(help="Probability of each cell of the shown map to be flipped.")]
_MapWarp = Annotated[float, typer.Option(help="Largest shift of the shown map's corners, in shares of its side.")]
_PositionNoise = Annotated[float, typer.Option(help="Standard deviation of the noise on x and y, in metres.")]
_LandmarkDistance = Annotated[int, typer.Option(min=1, help="Cells between landmarks (hierarchical task).")]

# Options that another one leaves without effect, and why.
_LOCAL = ("distances", "episodes_per_distance")
_EVALUATION = ("task", "size", "split", "maps", *_LOCAL, "landmark_distance", "map_flip", "map_warp", "position_noise")
_HIERARCHICAL = ("the hierarchical task leads from corner to corner", _LOCAL)
_NO_LANDMARKS = ("the local task has no landmarks", ("landmark_distance",))
_OWN_MAPS = ("with --maps the mazes are your own", ("split",))


@app.command("eval", short_help="Evaluate agents on unseen mazes.")
def evaluate(
    context: typer.Context,
    agents: Annotated[
        list[str],
        typer.Option(
            "--agent", help="An installed agent (see `mazebench list`), or module:Class; several with --suite."
        ),
    ],
    suite: Annotated[
        str | None,
        typer.Option(help="Evaluations by name instead: paper, the whole protocol, or quick, minutes of it."),
    ] = None,
    task: Annotated[TaskName, typer.Option(help="Kind of navigation.")] = TaskName.local,
    size: Annotated[
        int | None, typer.Option(help="Size of the benchmark's mazes: 13 (if not given), 15, 17, 19 or 21.")
    ] = None,
    split: Annotated[Split, typer.Option(help="The benchmark's unseen mazes, or its training mazes.")] = Split.eval,
    maps: Annotated[
        pathlib.Path | None, typer.Option(help="Mazes of your own: a text or image file, or a folder of them.")
    ] = None,
    distances: Annotated[str, typer.Option(help="From start to goal in cells, as 1-5,8,10 (local task).")] = "1-15",
    episodes_per_distance: Annotated[int, typer.Option(min=1, help="For each maze and distance (local task).")] = 5,
    landmark_distance: _LandmarkDistance = 5,
    map_flip: _MapFlip = 0.0,
    map_warp: _MapWarp = 0.0,
    position_noise: _PositionNoise = 0.0,
    checkpoint: Annotated[
        pathlib.Path | None,
        typer.Option(help="A learned agent's checkpoint or run folder; the shipped one if not given."),
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of what the agent draws, and of episodes that are not frozen.")
    ] = 0,
    out: Annotated[
        pathlib.Path | None, typer.Option(help="Folder for the results; a new one in results/ if not given.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in --out.")] = False,
    record: Annotated[
        bool | None,
        typer.Option("--record/--no-record", help="Write trajectories too; a suite does if nothing is said."),
    ] = None,
    traceback: Annotated[
        bool, typer.Option("--traceback", help="If the agent raises, show where; not with --workers or --ray.")
    ] = False,
    num_envs: Annotated[int, typer.Option(min=1, help="Environments side by side in each process.")] = 256,
    workers: Annotated[
        int, typer.Option(min=0, help="Processes; 0 runs in this one, and with --ray on all its CPUs.")
    ] = 0,
    ray: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Address of a Ray cluster for the workers; auto, or local for a new one."),
    ] = None,
) -> None:
    """Evaluate agents on unseen mazes: success rate and SPL with 95 % intervals."""
    from mazebench.evaluation.contract import AgentError
    from mazebench.evaluation.options import EvalOptions

    if suite is None and len(agents) > 1:
        raise InputError(f"expected one --agent without --suite, found {len(agents)}")
    _refuse_ignored(
        context,
        (suite is not None, f"the suite {suite!r} has evaluations of its own", _EVALUATION),
        (task == TaskName.hierarchical, *_HIERARCHICAL),
        (task == TaskName.local, *_NO_LANDMARKS),
        (maps is not None, *_OWN_MAPS),
        (bool(workers) or ray is not None, "the agent acts in other processes", ("traceback",)),
    )
    if resume and out is None:
        raise InputError("--resume needs --out, the folder of the run to go on with")
    options = EvalOptions(
        agent=agents[0],
        task=task.value,
        size=size,
        split=split.value,
        maps=None if maps is None else str(maps),
        distances=parse_distances(distances),
        episodes_per_distance=episodes_per_distance,
        landmark_distance=landmark_distance,
        map_flip=map_flip,
        map_warp=map_warp,
        position_noise=position_noise,
        checkpoint=None if checkpoint is None else str(checkpoint),
        seed=seed,
    )
    folder = out or _new_folder(f"{agents[0].replace(':', '-')}-{task.value}" if suite is None else suite)
    running = {"num_envs": num_envs, "workers": workers, "ray_address": ray}
    kept = progress.Kept()

    def say() -> tuple[str, ...]:
        if kept.of is None and not folder.exists():
            return ("nothing was begun; run it again",)
        return (f"{kept} in {folder}; go on", *(() if out else ("--out", str(folder))), "--resume")

    try:
        with stopping.stoppable(say):
            if suite is None:
                _evaluate_one(options, folder, resume, bool(record), running, kept)
            else:
                _evaluate_suite(suite, agents, options, folder, resume, record is not False, running, kept)
    except AgentError as error:
        if traceback and error.__cause__ is not None:
            print_exception(error.__cause__)
        raise RunError(f"{error}; {kept} in {folder}" if kept.done else str(error)) from error
    print(f"results in {folder}")


def _evaluate_one(
    options: Any, folder: pathlib.Path, resume: bool, record: bool, running: dict[str, Any], kept: progress.Kept
) -> None:
    from mazebench.evaluation import harness, results, table

    if resume and harness.is_finished(folder, record):
        harness.check_same_run(options, folder)
        summary = results.load_result(folder).summary
        print(f"{folder}: the run is finished")
        table.print_summary(summary)
        return
    _say_whether_resuming(folder, resume)
    with progress.evaluating(f"{options.agent}, {options.task}", kept) as advance:
        summary = harness.evaluate(options, folder, resume=resume, record=record, progress=advance, **running)
    table.print_summary(summary)


def _evaluate_suite(
    suite: str,
    agents: list[str],
    options: Any,
    folder: pathlib.Path,
    resume: bool,
    record: bool,
    running: dict[str, Any],
    kept: progress.Kept,
) -> None:
    from mazebench.evaluation import suites, table

    run = suites.SuiteRun(suite, agents, folder, checkpoint=options.checkpoint, seed=options.seed, record=record)
    if resume and run.is_finished:
        print(f"{folder}: the run is finished")
    else:
        _say_whether_resuming(folder, resume)
    with progress.evaluating(f"{suite}, {', '.join(agents)}", kept) as advance:
        run.run(resume=resume, progress=advance, **running)
    table.print_suite(run.summaries())


def _say_whether_resuming(folder: pathlib.Path, resume: bool) -> None:
    if resume:
        begun = folder.is_dir() and any(folder.iterdir())
        print(f"resuming {folder}" if begun else f"nothing to resume in {folder}; starting anew")


def _refuse_ignored(context: typer.Context, *rules: tuple[bool, str, tuple[str, ...]]) -> None:
    """Refuses options that were given and would make no difference: (whether so, why, the options) of each rule."""
    for is_so, reason, names in rules:
        for name in names if is_so else ():
            source = context.get_parameter_source(name)
            if source is not None and source.name != "DEFAULT":
                raise InputError(f"{reason}; found --{name.replace('_', '-')}, which would be ignored")


def _new_folder(name: str) -> pathlib.Path:
    """A folder in results/ that no run has."""
    # With the process, for runs that start in the same second.
    name = f"{name}-{datetime.datetime.now():%Y%m%d-%H%M%S}-{os.getpid()}"
    for number in range(1000):
        folder = pathlib.Path("results") / (f"{name}-{number}" if number else name)
        if not folder.exists():
            return folder
    raise InputError(f"results/{name}: exists a thousand times over; give --out")


@app.command(short_help="Compare two agents on the same episodes.")
def compare(
    a: Annotated[pathlib.Path, typer.Argument(metavar="A", help="The folder of an evaluation, or of a suite's agent.")],
    b: Annotated[
        pathlib.Path, typer.Argument(metavar="B", help="The evaluation of another agent on the same episodes.")
    ],
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON, with all intervals, instead of a table.")
    ] = False,
) -> None:
    """Compare two agents on the same episodes: what A has more than B, with 95 % intervals over mazes."""
    from mazebench.evaluation import comparison, table

    found = comparison.compare_folders(a, b)
    for line in found.notes:
        _remark(line)
    if as_json:
        print(json.dumps(found.parts.get("", found.parts), indent=1))
        return
    if "" in found.parts:
        rows = found.parts[""]["by_distance"] if found.has_distances else {}
        table.print_comparison(found.title, "distance", {**rows, "all": found.parts[""]["overall"]})
    else:
        table.print_comparison(found.title, "part", {name: part["overall"] for name, part in found.parts.items()})


@app.command(short_help="Train an agent on the training mazes.")
def train(
    context: typer.Context,
    agent: Annotated[str, typer.Option(help="A learning agent: mah or dqn, or module:Class.")],
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

    _refuse_ignored(context, (not workers, "without --workers this process collects by itself", ("ray",)))
    options = loop.TrainOptions(
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

    def say() -> tuple[str, ...]:
        last = next(reversed(run_folder.checkpoints(folder)), None)
        kept = "no checkpoint is kept" if last is None else f"the checkpoint at {int(last.name):,} steps is kept"
        return (f"{kept} in {folder}; go on", "--resume")

    with stopping.stoppable(say), progress.training() as report:
        loop.train(options, folder, resume, report)
    print(f"run in {folder}; evaluate it by: mazebench eval --agent {agent} --checkpoint {folder}")


def _parse_override(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals or not key:
        raise InputError(f"expected --set KEY=VALUE, found {text!r}")
    return key.strip(), value.strip()


@app.command(short_help="Make tables, figures and a page of results.")
def report(
    results: Annotated[
        list[pathlib.Path], typer.Argument(help="Evaluation folders, runs of suites, or folders above them.")
    ],
    out: Annotated[pathlib.Path, typer.Option(help="Folder for the report; an earlier report in it is replaced.")],
) -> None:
    """Make tables, figures and a page to explore every episode from results of `mazebench eval`."""
    from mazebench.report import writing

    with stopping.stoppable(lambda: (f"the report in {out} is not whole; make it anew",)):
        reported = writing.write_report(results, out, warn=_remark)
    agents = sorted({result.label for result in reported})
    print(f"{len(reported)} results of {', '.join(agents)}: {out / writing.PAGE}, {out / writing.DOCUMENT}")


@app.command(short_help="Film or picture an episode.")
def render(
    context: typer.Context,
    out: Annotated[pathlib.Path, typer.Option(help="FILE.mp4 or .gif of an episode, FILE.png of its last moment.")],
    agent: Annotated[str, typer.Option(help="Who drives.")] = "planner-closed-loop",
    task: Annotated[TaskName, typer.Option(help="Kind of navigation.")] = TaskName.local,
    size: Annotated[int | None, typer.Option(help="Size of the benchmark's mazes; 13 if not given.")] = None,
    split: Annotated[Split, typer.Option(help="The benchmark's unseen or training mazes.")] = Split.eval,
    maps: Annotated[pathlib.Path | None, typer.Option(help="Mazes of your own.")] = None,
    distances: Annotated[str, typer.Option(help="From start to goal in cells (local task).")] = "10",
    view: Annotated[
        str, typer.Option(help="top, egocentric, chase, map (shown map and driven path), or all four side by side.")
    ] = "all",
    landmark_distance: _LandmarkDistance = 5,
    map_flip: _MapFlip = 0.0,
    map_warp: _MapWarp = 0.0,
    position_noise: _PositionNoise = 0.0,
    checkpoint: Annotated[pathlib.Path | None, typer.Option(help="A learned agent's checkpoint.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the episode.")] = 0,
    pixels: Annotated[int, typer.Option(min=64, max=1280, help="Side of a view.")] = 360,
) -> None:
    """Film an episode, or picture it: from above, through the agent's eyes, on its map."""
    _refuse_ignored(
        context,
        (task == TaskName.hierarchical, *_HIERARCHICAL),
        (task == TaskName.local, *_NO_LANDMARKS),
        (maps is not None, *_OWN_MAPS),
    )
    _choose_rendering_backend()
    from mazebench.evaluation import film
    from mazebench.evaluation.options import EvalOptions

    options = EvalOptions(
        agent=agent,
        task=task.value,
        size=size,
        split=split.value,
        maps=None if maps is None else str(maps),
        distances=parse_distances(distances),
        landmark_distance=landmark_distance,
        map_flip=map_flip,
        map_warp=map_warp,
        position_noise=position_noise,
        checkpoint=None if checkpoint is None else str(checkpoint),
        seed=seed,
    )
    outcome = film.film_episode(options, out, view, pixels)
    print(f"{out}: {outcome}")


@app.command(short_help="Drive yourself, with the keyboard.")
def play(
    context: typer.Context,
    task: Annotated[TaskName, typer.Option(help="Kind of navigation.")] = TaskName.local,
    size: Annotated[int | None, typer.Option(help="Size of the benchmark's mazes; 13 if not given.")] = None,
    split: Annotated[Split, typer.Option(help="The benchmark's unseen or training mazes.")] = Split.eval,
    maps: Annotated[pathlib.Path | None, typer.Option(help="Mazes of your own.")] = None,
    distances: Annotated[str, typer.Option(help="From start to goal in cells (local task).")] = "10",
    landmark_distance: _LandmarkDistance = 5,
    map_flip: _MapFlip = 0.0,
    map_warp: _MapWarp = 0.0,
    position_noise: _PositionNoise = 0.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the first episode and those after it.")] = 0,
    terminal: Annotated[
        bool, typer.Option("--terminal", help="In this terminal, where there is a display too.")
    ] = False,
) -> None:
    """Drive yourself, with the keyboard: in MuJoCo's viewer, or without a display in the terminal."""
    _refuse_ignored(
        context,
        (task == TaskName.hierarchical, *_HIERARCHICAL),
        (task == TaskName.local, *_NO_LANDMARKS),
        (maps is not None, *_OWN_MAPS),
    )
    from mazebench.play.game import Game
    from mazebench.tasks.registry import make_spec

    spec = make_spec(
        task.value,
        size,
        split.value,
        maps=maps,
        distances=parse_distances(distances),
        landmark_distance=landmark_distance,
        map_flip=map_flip,
        map_warp=map_warp,
        position_noise=position_noise,
    )
    game = Game(spec, seed)
    if terminal or not _has_display():
        from mazebench.play import terminal as screen
    else:
        from mazebench.play import viewer as screen  # type: ignore[no-redef]
    screen.play(game)
    print(game.outcome())


def _has_display() -> bool:
    """Whether windows can be expected to open here."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _choose_rendering_backend() -> None:
    """Lets this process render without a display, unless the user chose a backend; before MuJoCo is imported."""
    if not _has_display():
        os.environ.setdefault("MUJOCO_GL", "egl")


@app.command(short_help="Measure speed on this machine.")
def bench(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Shorter runs, noisier figures.")] = False,
) -> None:
    """Measure speed on this machine, as ratios to the bare simulation taken in the same run."""
    _choose_rendering_backend()
    from mazebench import bench as benchmark

    results = benchmark.run(quick=quick, say=lambda line: print(line, file=sys.stderr))
    if as_json:
        print(json.dumps(results, indent=1))
    else:
        benchmark.print_tables(results)


@app.command("list", short_help="List tasks, agents, sizes and styles.")
def list_() -> None:
    """List tasks, agents, sizes, maze styles and Gymnasium ids."""
    from mazebench.agent import agent_names
    from mazebench.maps.benchmark import MAZES_PER_SPLIT, SIZES, SPLITS, VERSION
    from mazebench.maps.generators import STYLES
    from mazebench.tasks import TASK_VERSION

    print("agents:     ", ", ".join(agent_names()))
    print("tasks:      ", ", ".join(task.value for task in TaskName), f"(version {TASK_VERSION})")
    print(
        "sizes:      ",
        ", ".join(map(str, SIZES)),
        f"(benchmark {VERSION}, {MAZES_PER_SPLIT} mazes in each of {', '.join(SPLITS)})",
    )
    print("styles:     ", ", ".join(sorted(STYLES)))
    print(
        "Gymnasium:  ",
        ", ".join(f"mazebench/{kind}-{SIZES[0]}-v{TASK_VERSION}" for kind in ("Local", "Hierarchical", "LocalGoal")),
        "and the other sizes",
    )


def parse_distances(text: str) -> tuple[int, ...]:
    """Sorted distances from ranges and commas: "1-5,8,10".

    Raises:
      InputError: if `text` is anything else.
    """
    distances: set[int] = set()
    for part in text.split(","):
        low, dash, high = part.strip().partition("-")
        if not low.isdecimal() or (dash and not high.isdecimal()) or len(low) > 5 or len(high) > 5:
            raise InputError(f"expected distances like 1-5,8,10, found {text!r}")
        if int(low) > int(high or low):
            raise InputError(f"expected distances from low to high, found {part.strip()!r}")
        distances.update(range(int(low), int(high or low) + 1))
    if not distances or min(distances) < 1:
        raise InputError(f"expected distances of 1 cell or more, found {text!r}")
    return tuple(sorted(distances))
