"""Draws a maze and its shown map at each level of the tracks: `python benchmarks/track_pictures.py`.

The picture is docs/images/tracks-v3.png. `oracle` is evaluated in train mazes.
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
from mazebench.results.reading import load_result
from mazebench.results.trajectories import TRAJECTORIES, Trajectory, load_trajectories
from mazebench.tasks.tracks.base import LEVELS

PATH = pathlib.Path(__file__).parent.parent / "docs" / "images" / "tracks-v3.png"
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
            maze, trajectory = play(track, level)
            _show(row[level], _shown_map(trajectory), f"{track} {level}")
            if track == "rebuilt":
                _mark_moved_doors(row[level], maze, trajectory)
        _show(row[0], _true_maze(maze, trajectory), "the maze, and a path")
    figure.savefig(PATH, dpi=110, metadata={"Software": None})
    print(PATH)


def play(track: str, level: int) -> tuple[Maze, Trajectory]:
    """Returns the train maze and what was recorded of an episode in it."""
    options = {"track": track, "level": level, "split": "train", "distances": DISTANCE}
    maze = load_kind_mazes("train")[HOUSE]
    with tempfile.TemporaryDirectory() as folder:
        mazebench.evaluate("oracle", folder, record=True, episodes_per_distance=1, **options)
        records = load_result(pathlib.Path(folder)).records
        recorded = load_trajectories(pathlib.Path(folder) / TRAJECTORIES, len(records))
        return maze, recorded[[record.maze for record in records].index(maze.name)]


def _true_maze(maze: Maze, trajectory: Trajectory) -> np.ndarray:
    goal = divmod(int(trajectory.landmarks[-1]), maze.size)
    x, y = trajectory.pose[0, :2].astype(float)
    return draw_grid(
        maze.walls, PANEL // maze.size, (int(maze.size - y), int(x)), goal, trajectory.pose[:, :2].astype(float)
    )


def _shown_map(trajectory: Trajectory) -> np.ndarray:
    pixels = trajectory.shown if trajectory.picture is None else trajectory.picture / 255
    assert trajectory.marks is not None
    start, goal = (_cell(mark, len(pixels)) for mark in trajectory.marks.tolist())
    return draw_grid(pixels, PANEL // len(pixels), start, goal)


def _cell(mark: int, size: int) -> Cell | None:
    return None if mark < 0 else divmod(mark, size)


def _mark_moved_doors(axes: Axes, maze: Maze, trajectory: Trajectory) -> None:
    """Frames the cells in which the map differs from the maze."""
    pixels = PANEL // maze.size
    for row, column in np.argwhere(trajectory.shown != maze.walls):
        corner = (column * pixels, row * pixels)
        axes.add_patch(Rectangle(corner, pixels, pixels, fill=False, edgecolor="#e8871e", linewidth=1.5))


def _show(axes: Axes, picture: np.ndarray, title: str) -> None:
    axes.imshow(picture, interpolation="antialiased")
    axes.set_title(title, fontsize=9)


if __name__ == "__main__":
    main()
