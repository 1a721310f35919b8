"""Draws a maze and its shown map at each level of the tracks: `python benchmarks/track_pictures.py`.

The picture is docs/images/tracks.png. `oracle` is evaluated in train mazes.
"""

from __future__ import annotations

import pathlib
import tempfile

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import mazebench
from mazebench.maps.benchmark import load_kind_mazes
from mazebench.maps.maze import Cell, Maze
from mazebench.maps.pictures import draw_grid
from mazebench.results.played import Shown, shown_of
from mazebench.results.reading import load_result
from mazebench.results.trajectories import TRAJECTORIES, load_trajectories
from mazebench.tasks.episode import Episode
from mazebench.tasks.tracks.track import LEVELS

PATH = pathlib.Path(__file__).parent.parent / "docs" / "images" / "tracks.png"
PANEL = 520  # pixels a side, about
HOUSE = 17  # index of the train maze
DISTANCE = 40  # cells from start to goal
ROWS = ("building", "rebuilt", "rough")  # `adrift` shows the maps of `rebuilt`


def main() -> None:
    """Draws the picture."""
    figure = Figure(figsize=(9.6, 7.8), layout="constrained")
    for row, track in zip(figure.subplots(len(ROWS), 1 + len(LEVELS)), ROWS, strict=True):
        for axes in row:
            axes.set_axis_off()
        for level in LEVELS:
            maze, goal, pose, shown = play(track, level)
            _show(row[level], _shown_map(shown), f"{track} {level}")
            if track == "rebuilt":
                _mark_moved_doors(row[level], maze, shown)
        x, y = pose[0, :2]
        start = int(maze.size - y), int(x)
        _show(row[0], draw_grid(maze.walls, PANEL // maze.size, start, goal, pose[:, :2]), "the maze, and a path")
    figure.savefig(PATH, dpi=110, metadata={"Software": None})
    print(PATH)


def play(track: str, level: int) -> tuple[Maze, Cell, np.ndarray, Shown]:
    """Returns the train maze, and the goal, the poses and the shown map of an episode in it."""
    options = {"track": track, "level": level, "split": "train", "distances": DISTANCE}
    maze = load_kind_mazes("train")[HOUSE]
    with tempfile.TemporaryDirectory() as folder:
        mazebench.evaluate("oracle", out=folder, record=True, episodes_per_distance=1, **options)
        result = load_result(pathlib.Path(folder))
        [number] = [record.episode for record in result.records if record.maze == maze.name]
        record = result.records[number]
        shown = shown_of(result.summary.task, Episode(HOUSE, record.start, record.goal, 0.0, record.seed))
        pose = load_trajectories(pathlib.Path(folder) / TRAJECTORIES)[number].pose.astype(float)
        return maze, record.goal, pose, shown


def _shown_map(shown: Shown) -> np.ndarray:
    pixels = shown.walls if shown.are_cells else shown.walls / 255
    start, goal = (None if mark < 0 else divmod(mark, len(pixels)) for mark in (shown.start, shown.goal))
    return draw_grid(pixels, PANEL // len(pixels), start, goal)


def _mark_moved_doors(axes: Axes, maze: Maze, shown: Shown) -> None:
    """Frames the cells in which the map differs from the maze."""
    pixels = PANEL // maze.size
    for row, column in np.argwhere(shown.walls != maze.walls):
        corner = (column * pixels, row * pixels)
        axes.add_patch(Rectangle(corner, pixels, pixels, fill=False, edgecolor="#e8871e", linewidth=1.5))


def _show(axes: Axes, picture: np.ndarray, title: str) -> None:
    axes.imshow(picture, interpolation="antialiased")
    axes.set_title(title, fontsize=9)


if __name__ == "__main__":
    main()
