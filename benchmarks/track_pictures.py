"""Draws a maze and the map that the agent is shown of it at each level of a track.

`python benchmarks/track_pictures.py [stale lost sketch far v3]`. The tracks of v2 have a picture each,
docs/images/track-*.png, and those of v3 share docs/images/tracks-v3.png. `oracle` plays the episodes in train mazes.
"""

from __future__ import annotations

import pathlib
import sys
import tempfile

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

import mazebench
from mazebench.maps import colors
from mazebench.maps.benchmark import KINDS_VERSION as V3
from mazebench.maps.benchmark import TRACKS_VERSION
from mazebench.maps.maze import Cell, Maze
from mazebench.maps.pictures import draw_grid
from mazebench.results.reading import load_result
from mazebench.results.trajectories import TRAJECTORIES, Trajectory, load_trajectories
from mazebench.tasks.tracks import TRACKS, tracks_of
from mazebench.tasks.tracks.base import LEVELS

IMAGES = pathlib.Path(__file__).parent.parent / "docs" / "images"
PANEL = 520  # pixels a side, about
MAZE = 3  # index of the train maze
HOUSE = 17  # the same on the tracks of v3
DISTANCES = {13: 18, 31: 40, 51: 60}  # cells from start to goal, by the maze's size
ROWS = ("building", "rebuilt", "rough")  # of v3; `adrift` shows the maps of `rebuilt`


def main(names: list[str]) -> None:
    """Draws the pictures of some tracks of v2, or the one of v3."""
    for name in names:
        path = IMAGES / (f"tracks-{V3}.png" if name == V3 else f"track-{name}.png")
        figure = draw_v3() if name == V3 else draw_track(name)
        figure.savefig(path, dpi=110, metadata={"Software": None})
        print(path)


def draw_v3() -> Figure:
    """Returns a figure with a row for each track of v3: the maze, and the shown map at levels 1 to 3."""
    figure = Figure(figsize=(9.6, 7.8), layout="constrained")
    for row, track in zip(figure.subplots(len(ROWS), 1 + len(LEVELS)), ROWS, strict=True):
        for axes in row:
            axes.set_axis_off()
        for level in LEVELS:
            maze, trajectory = play(track, level, HOUSE)
            _show(row[level], _shown_map(trajectory), f"{track} {level}")
            if track == "rebuilt":
                _mark_moved_doors(row[level], maze, trajectory)
        _show(row[0], _true_maze(maze, trajectory), "the maze, and a path")
    return figure


def draw_track(track: str) -> Figure:
    """Returns a figure of the maze, and of the shown map at levels 1 to 3; for `lost`, also of the observed path."""
    has_odometry = track == "lost"
    figure = Figure(figsize=(11, 6.2 if has_odometry else 3.0), layout="constrained")
    rows = figure.subplots(2 if has_odometry else 1, 1 + len(LEVELS), squeeze=False)
    for axes in rows.ravel():
        axes.set_axis_off()
    for level in LEVELS:
        maze, trajectory = play(track, level)
        _show(rows[0, level], _shown_map(trajectory), f"level {level}: the map as shown")
        if track == "stale":
            _mark_moved_doors(rows[0, level], maze, trajectory)
        if has_odometry:
            _draw_odometry(rows[1, level], trajectory, f"level {level}: the path as observed")
    size = "" if len(set(TRACKS[track].sizes)) == 1 else f" of levels 2 and {level}"
    _show(rows[0, 0], _true_maze(maze, trajectory), f"the maze{size}, and a path")
    return figure


def play(track: str, level: int, index: int = MAZE) -> tuple[Maze, Trajectory]:
    """Returns the train maze of an index and what was recorded of an episode in it."""
    mazes = TRACKS[track].mazes((level,), "train")
    options = {"track": track, "level": level, "split": "train", "distances": DISTANCES[mazes[0].size]}
    with tempfile.TemporaryDirectory() as folder:
        mazebench.evaluate("oracle", folder, record=True, episodes_per_distance=1, **options)
        records = load_result(pathlib.Path(folder)).records
        recorded = load_trajectories(pathlib.Path(folder) / TRAJECTORIES, len(records))
        return mazes[index], recorded[[record.maze for record in records].index(mazes[index].name)]


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


def _draw_odometry(axes: Axes, trajectory: Trajectory, title: str) -> None:
    """Draws the observed path, and dashed the true one, from x = y = 0 with the first heading to the right."""
    assert trajectory.observed is not None
    x, y = trajectory.observed[:, :2].astype(float).T
    true = trajectory.pose.astype(float)
    moved, turn = true[:, :2] - true[0, :2], np.exp(-1j * true[0, 2])
    rotated = (moved[:, 0] + 1j * moved[:, 1]) * turn
    axes.set_axis_on()
    axes.plot(rotated.real, rotated.imag, "--", color="#e8871e")
    axes.plot(x, y, color="#4458c8")
    axes.plot(x[0], y[0], "o", color=colors.START)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x / m")
    axes.set_ylabel("y / m")
    axes.set_title(title, fontsize=9)


def _show(axes: Axes, picture: np.ndarray, title: str) -> None:
    axes.imshow(picture, interpolation="antialiased")
    axes.set_title(title, fontsize=9)


if __name__ == "__main__":
    main(sys.argv[1:] or [*tracks_of(TRACKS_VERSION), V3])
