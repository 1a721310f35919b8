"""`mazebench generate`."""

from __future__ import annotations

import pathlib
import shutil
from typing import Annotated, Any

import typer

from mazebench.commands.display import load_mujoco
from mazebench.commands.options import takes_options
from mazebench.maps.options import MapOptions


@takes_options(MapOptions)
def generate(
    values: dict[str, Any],
    size: Annotated[
        int | None,
        typer.Option(help="Cells a side, 5 to 255; 13 if not given. With --from-image, what the map shows."),
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
            help="Files to write: any of mjcf, mjcf-textured, txt, png, ros, glb, obj, stl, separated by commas.",
        ),
    ] = "txt,mjcf,png,glb",
    from_image: Annotated[
        pathlib.Path | None,
        typer.Option(help="Read the maze off a map instead: picture of a floor plan, text, array (.npy), ROS (.yaml)."),
    ] = None,
) -> None:
    """Make mazes: MJCF for MuJoCo, text, picture, ROS map, mesh."""
    load_mujoco(renders=False)
    from mazebench.maps.text import format_maze
    from mazebench.storage.files import make_folder
    from mazebench.world.formats import make_mazes, parse_formats, write_maze

    mazes = make_mazes(size, count, seed, kind, from_image, MapOptions(**values))
    chosen = parse_formats(formats)
    for index, placed in enumerate(mazes):
        if index == 0:  # nothing is made for bad input
            make_folder(out)
        for path in write_maze(placed, out, chosen, from_image):
            print(path)
        if index == 0 and 2 * placed.maze.size <= shutil.get_terminal_size().columns:  # the first is shown
            print(format_maze(placed.maze), end="")
