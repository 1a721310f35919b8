"""`mazebench generate`."""

from __future__ import annotations

import pathlib
import shutil
from collections.abc import Iterator
from typing import Annotated, Any

import typer

from mazebench.commands.display import load_mujoco
from mazebench.commands.option_parameters import NoCache, takes_options
from mazebench.maps.maze_options import ReadOptions


@takes_options(ReadOptions)
def generate(
    values: dict[str, Any],
    size: Annotated[
        int | None,
        typer.Option(help="Cells a side, 5 to 1024; 13 if not given. With --mazes, the size that the file shows."),
    ] = None,
    count: Annotated[int, typer.Option(min=1, help="How many mazes; with --changed, changed buildings.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same mazes.")] = 0,
    kind: Annotated[str, typer.Option(help="Of the layout: dfs, house, rooms ... (see `mazebench list`).")] = "dfs",
    out: Annotated[pathlib.Path, typer.Option(help="Folder to fill with NAME.txt, NAME.xml, ...")] = pathlib.Path(
        "mazes"
    ),
    formats: Annotated[
        str,
        typer.Option(
            "--format",
            help="Any of mjcf, mjcf-textured, mjcf-robot, txt, png, ros, glb, obj, stl, separated by commas.",
        ),
    ] = "txt,mjcf,png,glb",
    mazes_file: Annotated[
        pathlib.Path | None,
        typer.Option("--mazes", help="A maze of your own: a picture, text, array (.npy) or ROS map (.yaml)."),
    ] = None,
    strength: Annotated[
        int | None,
        typer.Option(
            "--changed",
            min=1,
            max=3,
            help="Write buildings in which things have changed since the maze was drawn, its old map: passages closed "
            "and opened, furniture moved; so many that a robot that believes the old map is late in .15, .3 or .4 of "
            "episodes at 1, 2 and 3.",
        ),
    ] = None,
    no_cache: NoCache = False,  # its callback does it
) -> None:
    """Make mazes: MJCF for MuJoCo, text, picture, ROS map, mesh."""
    load_mujoco(renders=False)
    from mazebench.maps.changes import Change, changes
    from mazebench.maps.readers.occupancy_grid import LocatedMaze
    from mazebench.maps.text import format_maze
    from mazebench.world.formats import make_mazes, parse_formats, write_maze

    num_drawn = count if strength is None else 1
    mazes = make_mazes(size, num_drawn, seed, kind, mazes_file, ReadOptions(**values))
    made: Iterator[tuple[LocatedMaze, Change | None]] = ((placed, None) for placed in mazes)
    if strength is not None:
        plan = next(mazes)
        made = ((plan._replace(maze=maze), change) for maze, change in changes(plan.maze, strength, count, seed))
    chosen = parse_formats(formats)
    for index, (placed, change) in enumerate(made):
        for path in write_maze(placed, out, chosen, mazes_file):
            print(path)
        if change:
            print(f"{placed.maze.name}: {change}")
        if index == 0 and 2 * placed.maze.size <= shutil.get_terminal_size().columns:  # the first is shown
            print(format_maze(placed.maze), end="")
