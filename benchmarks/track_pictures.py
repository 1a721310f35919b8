"""Draws the tracks, and a maze of each kind: `python -m benchmarks.track_pictures`.

The pictures are docs/images/tracks.png and kinds.png. `oracle` is evaluated in train mazes.
"""

from __future__ import annotations

import pathlib
import tempfile

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import mazebench
from mazebench.maps.benchmark import load_kind_mazes
from mazebench.maps.kinds import CHECK, KNOWN, NOVEL
from mazebench.maps.maze import Cell, Maze
from mazebench.maps.pictures import draw_grid
from mazebench.results.played import Shown, shown_of
from mazebench.results.reading import load_result
from mazebench.results.trajectories import TRAJECTORIES, load_trajectories
from mazebench.tasks.episode import Episode
from mazebench.tasks.tracks import LEVELS, TRACKS

FOLDER = pathlib.Path(__file__).parent.parent / "docs" / "images"
PANEL = 520  # pixels a side, about
HOUSE = 17  # index of the train maze
SIZE = 31  # cells a side
DISTANCE = 40  # cells from start to goal
GROUPS = {"train and test": KNOWN, "test only": NOVEL, "check only": CHECK}
SEED = 3  # of the mazes of each kind


def main() -> None:
    """Draws the pictures."""
    draw_tracks()
    draw_kinds()


def draw_tracks() -> None:
    """Draws a row for each track: the maze with a path, and the map that is shown at each level."""
    figure = Figure(figsize=(9.6, 10.2), layout="constrained")
    for row, track in zip(figure.subplots(len(TRACKS), 1 + len(LEVELS)), TRACKS, strict=True):
        for axes in row:
            axes.set_axis_off()
        for level in LEVELS:
            maze, goal, pose, observed, shown = play(track, level)
            _show(row[level], _shown_map(shown), f"{track} {level}")
            if track == "rebuilt":
                _mark_moved_doors(row[level], maze, shown)
            if track == "adrift":
                _draw_odometry(row[level], maze, pose, observed)
        x, y = pose[0, :2]
        start = int(maze.size - y), int(x)
        _show(row[0], draw_grid(maze.walls, PANEL // maze.size, start, goal, pose[:, :2]), "the maze, and a path")
    _save(figure, "tracks.png")


def draw_kinds() -> None:
    """Draws a maze of each kind, with the oracle's path to a far goal."""
    names = [(name, group) for group, kinds in GROUPS.items() for name in kinds]
    figure = Figure(figsize=(9.6, 10.2), layout="constrained")
    for axes, (name, group) in zip(figure.subplots(3, 3).flat, names, strict=True):
        axes.set_axis_off()
        maze = mazebench.generate(name, SIZE, np.random.default_rng(SEED))
        with tempfile.TemporaryDirectory() as folder:
            mazebench.evaluate(
                "oracle", out=folder, record=True, mazes=maze, distances=DISTANCE, episodes_per_distance=1
            )
            record = load_result(pathlib.Path(folder)).records[0]
            [trajectory] = load_trajectories(pathlib.Path(folder) / TRAJECTORIES)
        path = trajectory.pose.astype(float)[:, :2]
        _show(axes, draw_grid(maze.walls, PANEL // SIZE, record.start, record.goal, path), f"{name} ({group})")
    _save(figure, "kinds.png")


def _save(figure: Figure, name: str) -> None:
    figure.savefig(FOLDER / name, dpi=110, metadata={"Software": None})
    print(FOLDER / name)


def play(track: str, level: int) -> tuple[Maze, Cell, np.ndarray, np.ndarray | None, Shown]:
    """Returns the train maze, and the goal, the poses, the odometry and the shown map of an episode in it."""
    options = {"track": track, "level": level, "split": "train", "distances": DISTANCE}
    maze = load_kind_mazes("train")[HOUSE]
    with tempfile.TemporaryDirectory() as folder:
        mazebench.evaluate("oracle", out=folder, record=True, episodes_per_distance=1, **options)
        result = load_result(pathlib.Path(folder))
        [number] = [record.episode for record in result.records if record.maze == maze.name]
        record = result.records[number]
        shown = shown_of(result.summary.task, Episode(HOUSE, record.start, record.goal, 0.0, record.seed))
        trajectory = load_trajectories(pathlib.Path(folder) / TRAJECTORIES)[number]
        return maze, record.goal, trajectory.pose.astype(float), trajectory.observed, shown


def _shown_map(shown: Shown) -> np.ndarray:
    pixels = shown.walls if shown.are_cells else shown.walls / 255
    start, goal = (None if mark < 0 else divmod(mark, len(pixels)) for mark in (shown.start, shown.goal))
    return draw_grid(pixels, PANEL // len(pixels), start, goal)


def _mark_moved_doors(axes: Axes, maze: Maze, shown: Shown) -> None:
    """Marks the cells in which map and maze differ: a cross where a door is closed, a ring where it is open."""
    pixels = PANEL // maze.size
    for row, column in np.argwhere(shown.walls != maze.walls):
        marker = "x" if maze.walls[row, column] else "o"
        where = ((column + 0.5) * pixels, (row + 0.5) * pixels)
        axes.plot(*where, marker, color="#e8871e", markersize=5, markeredgewidth=1.6, fillstyle="none")


def _draw_odometry(axes: Axes, maze: Maze, pose: np.ndarray, observed: np.ndarray | None) -> None:
    """Draws the path by odometry, laid on the first true pose."""
    assert observed is not None, "the pose of this track is odometry"
    pixels, yaw = PANEL // maze.size, pose[0, 2]
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    x, y = (pose[0, :2] + observed[:, :2].astype(float) @ turn.T).T
    axes.plot(pixels * pose[:, 0], pixels * (maze.size - pose[:, 1]), color="#888888", linewidth=1)
    axes.plot(pixels * x, pixels * (maze.size - y), "--", color="#d1495b", linewidth=1.4)
    axes.set(xlim=(0, pixels * maze.size), ylim=(pixels * maze.size, 0))


def _show(axes: Axes, picture: np.ndarray, title: str) -> None:
    axes.imshow(picture, interpolation="antialiased")
    axes.set_title(title, fontsize=9)


if __name__ == "__main__":
    main()
