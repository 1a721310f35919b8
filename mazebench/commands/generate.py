"""`mazebench generate`."""

from __future__ import annotations

import pathlib
import shutil
from typing import Annotated, Any

import typer

from mazebench.commands.display import load_mujoco
from mazebench.commands.option_parameters import takes_options
from mazebench.maps.maze_options import ReadOptions


@takes_options(ReadOptions)
def generate(
    values: dict[str, Any],
    size: Annotated[
        int | None,
        typer.Option(help="Cells a side, 5 to 1024; 13 if not given. With --mazes, the size that the file shows."),
    ] = None,
    count: Annotated[int, typer.Option(min=1, help="How many mazes.")] = 1,
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
) -> None:
    """Make mazes: MJCF for MuJoCo, text, picture, ROS map, mesh."""
    load_mujoco(renders=False)
    from mazebench.maps.text import format_maze
    from mazebench.world.formats import make_mazes, parse_formats, write_maze

    mazes = make_mazes(size, count, seed, kind, mazes_file, ReadOptions(**values))
    chosen = parse_formats(formats)
    for index, placed in enumerate(mazes):
        for path in write_maze(placed, out, chosen, mazes_file):
            print(path)
        if index == 0 and 2 * placed.maze.size <= shutil.get_terminal_size().columns:  # the first is shown
            print(format_maze(placed.maze), end="")
