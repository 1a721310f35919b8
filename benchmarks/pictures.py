"""Draws the pictures of README.md and docs from episodes: `MUJOCO_GL=egl python -m benchmarks.pictures`.

The film is an episode of `navigator` in the dev mazes of `rebuilt` 2, in which the path on the map is blocked. All
other episodes are in train mazes, or in mazes of no split.
"""

from __future__ import annotations

import pathlib
import tempfile
from typing import Any, NamedTuple

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mazebench_agents.neural_planner import NeuralPlanner
from PIL import Image, ImageDraw, ImageFont

import mazebench
from mazebench.agent import Inputs
from mazebench.envs.vector import MazeVectorEnv
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.plan import make_plan
from mazebench.maps import colors
from mazebench.maps.benchmark import load_kind_mazes, load_mazes
from mazebench.maps.kinds import CHECK, KNOWN, NOVEL
from mazebench.maps.maze import Cell, Maze
from mazebench.maps.pictures import draw_grid, write_image
from mazebench.play.film import _run
from mazebench.report.page import lay_on_first_pose
from mazebench.results.played import Shown, shown_of
from mazebench.results.reading import load_result
from mazebench.results.trajectories import TRAJECTORIES, load_trajectories
from mazebench.tasks.episode import Episode
from mazebench.tasks.task import resolve, resolve_in
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import LEVELS, TRACKS

FOLDER = pathlib.Path(__file__).parent.parent / "docs" / "images"
HOUSE = 17  # index of the train maze
DISTANCE = 40  # cells from start to goal
PIXELS = 17  # of a cell
MOVED = "#e8871e"  # the colour of marks at doors that have moved
DRIVEN = "#d1495b"

FILMED = 94  # the episode: the navigator finds a door closed and drives around
VIEWS = {"map": "map given; rings: moved doors", "lidar": "real building, lidar and path", "egocentric": "robot's view"}
SIDE, GAP, TITLE = 256, 12, 26  # pixels; three views and two gaps are 792 wide
FRAME_TIME = 80  # ms: twice as fast as the robot
THUMBNAIL = 248  # pixels a side


def film() -> None:
    """Films an episode in three views, with a ring around each door that has moved."""
    options = eval_options("navigator", task="rebuilt", level=2, split="dev", seed=FILMED)
    views = [_run(options, view, SIDE, is_film=True)[0] for view in VIEWS]
    plan = make_plan(options)
    episode = plan.trials[FILMED].episode
    walls = plan.task.mazes[episode.maze].walls
    moved = np.argwhere(shown_of(plan.task, episode).walls != walls)

    # All frames are a copy of one canvas with the titles.
    width = len(VIEWS) * (SIDE + GAP) - GAP
    canvas = Image.new("RGB", (width, TITLE + SIDE), "white")
    for index, title in enumerate(VIEWS.values()):
        centre = index * (SIDE + GAP) + SIDE / 2, TITLE / 2
        ImageDraw.Draw(canvas).text(centre, title, "#222222", ImageFont.load_default(15), anchor="mm")
    frames = []
    for moment in zip(*views, strict=True):
        frame = canvas.copy()
        for index, (view, picture) in enumerate(zip(VIEWS, moment, strict=True)):
            for row, column in moved if view != "egocentric" else ():
                place = tuple(int((each + 0.5) * SIDE / len(walls)) for each in (column, row))
                cv2.circle(picture, place, 7, tuple(bytes.fromhex(MOVED[1:])), 2, cv2.LINE_AA)
            frame.paste(Image.fromarray(picture), (index * (SIDE + GAP), TITLE))
        frames.append(frame)

    # One palette for all frames, so that what stands still is stored once.
    swatches = [[colors.to_bytes(colors.START)], [colors.to_bytes(colors.GOAL)], [tuple(bytes.fromhex(MOVED[1:]))]] * 40
    some = [np.asarray(frame) for frame in frames[:: len(frames) // 6]]
    palette = Image.fromarray(np.concatenate([*some, np.repeat(swatches, width, axis=1).astype(np.uint8)]))
    palette = palette.quantize(128)
    first, *rest = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    durations = [FRAME_TIME] * len(rest) + [2000]
    first.save(FOLDER / "rebuilt.gif", save_all=True, append_images=rest, duration=durations, loop=0, optimize=True)


def draw_environments() -> None:
    """Draws for each environment the map that is shown, and the oracle's path in the maze."""
    tracks = {name: {"task": name, "level": 2, "distances": DISTANCE} for name in TRACKS}
    tasks: dict[str, dict[str, Any]] = {"local": {"distances": 12}, "hierarchical": {"task": "hierarchical"}}
    for name, options in (tracks | tasks).items():
        maze = load_kind_mazes("train")[HOUSE] if name in TRACKS else load_mazes(13, "train")[0]
        played = play(maze, split="train", **options)
        pictures = (_shown_map(played.shown), _maze_and_path(played))
        shown, driven = (cv2.resize(each, (THUMBNAIL, THUMBNAIL), interpolation=cv2.INTER_AREA) for each in pictures)
        gap = np.full((THUMBNAIL, GAP, 3), 255, np.uint8)
        write_image(np.concatenate([shown, gap, driven], axis=1), FOLDER / "environments" / f"{name}.png")


def draw_tracks() -> None:
    """Draws a row for each track: the maze with the oracle's path, and the map that is shown at each level."""
    figure = Figure(figsize=(9.6, 10.2), layout="constrained")
    maze = load_kind_mazes("train")[HOUSE]
    for row, track in zip(figure.subplots(len(TRACKS), 1 + len(LEVELS)), TRACKS, strict=True):
        for level in LEVELS:
            played = play(maze, split="train", task=track, level=level, distances=DISTANCE)
            _show(row[level], _shown_map(played.shown), f"{track} {level}")
            if track == "rebuilt":
                # A cross where a door is closed, a ring where it is open.
                for cell in np.argwhere(played.shown.walls != maze.walls):
                    marker = "x" if maze.walls[tuple(cell)] else "o"
                    row[level].plot(*(PIXELS * (cell[::-1] + 0.5)), marker, color=MOVED, markersize=5, fillstyle="none")
            if track == "adrift":
                looks = ({"color": "#888888"}, {"color": DRIVEN, "ls": "--"})
                for path, look in zip((played.pose, played.observed), looks, strict=True):
                    row[level].plot(PIXELS * path[:, 0], PIXELS * (maze.size - path[:, 1]), linewidth=1.2, **look)
                row[level].set(xlim=(0, PIXELS * maze.size), ylim=(PIXELS * maze.size, 0))
        _show(row[0], _maze_and_path(played), "the maze, and a path")
    figure.savefig(FOLDER / "tracks.png", dpi=110, metadata={"Software": None})


def draw_kinds() -> None:
    """Draws a maze of each kind, with the oracle's path to a far goal."""
    groups = {"train and test": KNOWN, "test only": NOVEL, "check only": CHECK}
    titles = {kind: f"{kind} ({group})" for group, kinds in groups.items() for kind in kinds}
    figure = Figure(figsize=(9.6, 10.2), layout="constrained")
    for axes, kind in zip(figure.subplots(3, 3).flat, titles, strict=True):
        maze = mazebench.generate(kind, 31, np.random.default_rng(3))
        _show(axes, _maze_and_path(play(maze, mazes=maze, distances=DISTANCE)), titles[kind])
    figure.savefig(FOLDER / "kinds.png", dpi=110, metadata={"Software": None})


class Played(NamedTuple):
    """An episode that was played."""

    maze: Maze
    start: Cell
    goal: Cell
    pose: np.ndarray  # [T, 3] float
    observed: np.ndarray | None  # [T, 3] float, the pose by odometry where the track has it, laid on the first true one
    shown: Shown


def play(maze: Maze | None, agent: str = "oracle", **options: Any) -> Played:
    """Returns an agent's first episode in a maze; without one, the first whose shortest path on the map is blocked."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        mazebench.evaluate(agent, out=folder, record=True, **{"episodes_per_distance": 1} | options)
        result, trajectories = load_result(folder), load_trajectories(folder / TRAJECTORIES)
    record = next(each for each in result.records if (each.blocked if maze is None else each.maze == maze.name))
    task, trajectory = resolve(result.summary.task), trajectories[record.episode]
    observed = None if trajectory.observed is None else lay_on_first_pose(trajectory)
    index = [each.name for each in task.mazes].index(record.maze)
    shown = shown_of(task, Episode(index, record.start, record.goal, float(trajectory.pose[0, 2]), record.seed))
    return Played(task.mazes[index], record.start, record.goal, trajectory.pose.astype(float), observed, shown)


def draw_planner() -> None:
    """Draws what the neural planner knows, pays and plans in the middle of an episode."""
    asked = TaskOptions(task="rebuilt", level=(2,), distances=(35,))
    task = resolve_in([load_kind_mazes("train")[HOUSE]], asked)
    agent, envs = NeuralPlanner.build(task.interface), MazeVectorEnv(task, 1)
    state, new, steps = agent.initial_state(1), np.ones(1, dtype=bool), []
    observation, info = envs.reset(seed=4)
    while not steps or not new.any():
        actions, state = agent.act(Inputs(observation, new, new, np.zeros(1, np.int64)), state)
        steps.append((info["position"][0], state.robots[0].grid, state.robots[0].plan))
        observation, _, terminated, truncated, info = envs.step(actions)
        new = terminated | truncated

    steps = steps[: int(0.55 * len(steps)) + 1]
    _, (prior, walls, _, unlikely), plan = steps[-1]
    panels = {
        "shown: the map, before doors moved": (prior / 255, "Greys"),
        "known: the map and what was seen": (walls / 255, "Greys"),
        "learned: the cost of each cell (log)": (np.log(plan.cost.numpy()), "viridis"),
        "planned: the way to the goal": (np.minimum(plan.way.numpy(), 90), "viridis_r"),
    }
    figure = Figure(figsize=(9.6, 2.7), layout="constrained")
    x, y = np.array([position for position, *_ in steps]).T
    row, column = np.unravel_index(unlikely.argmin(), unlikely.shape)
    for axes, (title, (picture, shades)) in zip(figure.subplots(1, 4), panels.items(), strict=True):
        _show(axes, picture, title, cmap=shades, interpolation="nearest")
        axes.plot(x - 0.5, len(walls) - y - 0.5, color=DRIVEN, marker="o", markersize=4, markevery=[-1])
        axes.plot(column, row, "*", color="#2a9d3a", markersize=9)
    figure.savefig(FOLDER / "neural-planner.png", dpi=150, metadata={"Software": None})


def draw_changes() -> None:
    """Draws a plan, a building in which things have changed since it was drawn, and the navigator's path in that."""
    plan = mazebench.generate("hospital", 41, np.random.default_rng(7))
    options = {"task": "rebuilt", "level": 2, "distances": DISTANCE, "episodes_per_distance": 4}
    played = play(None, "navigator", mazes=plan, **options)
    pixels, walls = 31 * PIXELS // plan.size, played.maze.walls
    both = draw_grid(walls | plan.walls, pixels)
    for changed, shade in ((walls & ~plan.walls, DRIVEN), (plan.walls & ~walls, "#2a9d3a")):
        both[np.kron(changed, np.ones((pixels, pixels), dtype=bool))] = tuple(bytes.fromhex(shade[1:]))
    pictures = {
        "the plan, which the robot is shown": _shown_map(played.shown),
        "what has changed: closed (red), opened (green)": both,
        "the building, and the navigator's path": _maze_and_path(played),
    }
    figure = Figure(figsize=(9.6, 3.4), layout="constrained")
    for axes, (title, picture) in zip(figure.subplots(1, 3), pictures.items(), strict=True):
        _show(axes, picture, title)
    figure.savefig(FOLDER / "your-map.png", dpi=110, metadata={"Software": None})


def _shown_map(shown: Shown) -> np.ndarray:
    pixels = shown.walls if shown.are_cells else shown.walls / 255
    start, goal = (None if mark < 0 else divmod(mark, len(pixels)) for mark in (shown.start, shown.goal))
    return draw_grid(pixels, 31 * PIXELS // len(pixels), start, goal)


def _maze_and_path(played: Played) -> np.ndarray:
    maze = played.maze
    return draw_grid(maze.walls, 31 * PIXELS // maze.size, played.start, played.goal, played.pose[:, :2])


def _show(axes: Axes, picture: np.ndarray, title: str, **look: str) -> None:
    axes.imshow(picture, **({"interpolation": "antialiased"} | look))
    axes.set_title(title, fontsize=8)
    axes.set_axis_off()


if __name__ == "__main__":
    for draw in (film, draw_environments, draw_tracks, draw_kinds, draw_planner, draw_changes):
        draw()
