"""Draws the pictures of README.md and docs from episodes: `python -m benchmarks.pictures`.

Episodes are in train mazes, or in mazes of no split. The films are made by `benchmarks.films`.
"""

from __future__ import annotations

import itertools
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Mapping
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mazebench_agents.neural_planner import NeuralPlanner
from PIL import Image

import mazebench
from mazebench.agent import Inputs
from mazebench.envs.vector import MazeVectorEnv
from mazebench.maps import colors
from mazebench.maps.benchmark import FROZEN_SPLITS, load_kind_mazes, load_mazes
from mazebench.maps.geodesic import DiscPaths
from mazebench.maps.kinds import CHECK, KNOWN, NOVEL
from mazebench.maps.maze import Cell, Maze, corner_cells, path_through_walls
from mazebench.maps.maze_files import read_located
from mazebench.maps.pictures import draw_grid, draw_rays, write_image
from mazebench.maps.real_buildings import PREFIX, RIGHT, YEARS, building_of, buildings, load_building, load_older
from mazebench.report.figures import WIDTH, to_svg
from mazebench.report.page import lay_on_first_pose
from mazebench.report.write_report import write_report
from mazebench.results.played import Shown, shown_of
from mazebench.results.reading import load_result
from mazebench.results.trajectories import TRAJECTORIES, load_trajectories
from mazebench.tasks.arena import arena_of
from mazebench.tasks.episode import Episode
from mazebench.tasks.perturbations.perturbation import ShownMap
from mazebench.tasks.sensors.cameras import as_colors
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.task import resolve
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import LEVELS, STANDING, TRACKS
from mazebench.world.bodies import SLIDER
from mazebench.world.looks import PLAIN, VARIED, Camera, exposures_of
from mazebench.world.ray_camera import RayCamera
from mazebench.world.ray_casting import ray_ends

FOLDER = pathlib.Path(__file__).parent.parent / "docs" / "images"
HOUSE = 17  # index of the train maze
BLOCKED = 27  # likewise, with a closed door on the path on the map
DISTANCE = 40  # cells from start to goal
PIXELS, NEAR_PIXELS = 17, 40  # of a cell
NEAR = 4 * NEAR_PIXELS  # the lidar's 3.5 m and a little more
MOVED = "#e8871e"  # the colour of marks at doors that have moved
DRIVEN = "#d1495b"
MIDWAY = "#c850a0"  # of the middle of a path in a drawing of a maze
PLANNED = "#7b2cbf"  # of the shortest path on the map, and of the door that closes it
ODOMETRY = "#0b7a8a"
# Of figures with pictures or heat maps, which dark pages don't invert: read on a white and on a dark page.
GREY_TEXT: Any = {"text.color": "#808080"}

OBSERVED = 6  # seed of the episode
SEEN = 4  # likewise of the places in all looks
STRIDE = 0.15  # m, of a drawn shortest path
EXPLORED = 28  # the episode in the explorer
SMALL_MAZE = "#######\n#...#.#\n###.#.#\n#.....#\n#.###.#\n#.....#\n#######\n"  # in the picture of formats
NO_BREAK = "\u00a0"  # a space that SVG keeps
_TEXT_OF_FILE: Any = {"family": "monospace", "fontsize": 6.8, "va": "top"}
DETOUR = 25  # the episode in that building of which the front pages have a picture
THEMES = {
    "": {"page": "#ffffff", "wall": "#4d535c", "floor": "#ffffff", "text": "#1f2328", "path": PLANNED},
    "-dark": {"page": "#0d1117", "wall": "#8b949e", "floor": "#0d1117", "text": "#e6edf3", "path": "#c9a0f5"},
}
CHECKED = "pal-office-7th-floor-changed-1"  # the real building whose old map is checked


def draw_environments() -> None:
    """Draws for each environment the map that is shown, and the oracle's path in the building."""
    levels = {name: 3 if name == "building" else 2 for name in TRACKS}  # building 3 is turned and mirrored
    tracks = {name: {"task": name, "level": levels[name], "distances": DISTANCE} for name in TRACKS}
    tasks: dict[str, dict[str, Any]] = {"local": {"distances": 12}, "hierarchical": {"task": "hierarchical"}}
    for name, options in (tracks | tasks).items():
        maze = load_kind_mazes("train")[BLOCKED] if name in TRACKS else load_mazes(13, "train")[0]
        played = play(maze, split="train", **options)
        figure = Figure(figsize=(7.4, 4.95), layout="constrained")
        on_map, on_maze = figure.subplots(1, 2)
        side = len(played.seen.seen_walls)
        _show(on_map, _shown_map(played.shown), f"{name}: the map that is shown", 14, extent=(0, side, 0, side))
        _show(
            on_maze, _maze_and_path(played), "the building, the oracle's path", 14, extent=(0, maze.size, 0, maze.size)
        )
        if played.observed is not None:
            on_maze.plot(*played.observed[:, :2].T, "--", color=ODOMETRY, lw=2, label="path by odometry")
        annotate(on_map, on_maze, maze, played.seen, played.start, played.goal)
        add_legend(figure)
        figure.savefig(FOLDER / "environments" / f"{name}.png", dpi=100, metadata={"Software": None})


@mpl.rc_context(GREY_TEXT)
def draw_observation() -> None:
    """Draws what the agent observes in a moment of `rebuilt` 2, with a camera besides the lidar."""
    env = mazebench.make("rebuilt", level=2, sensors=("lidar", "egocentric"))
    env.reset(seed=OBSERVED)
    for _ in range(4):
        observation, *_, info = env.step(0)
    maze, pose = env.unwrapped.task.mazes[info["maze"]], np.append(info["position"], info["yaw"])
    shown, around, goal, start = observation["context"]

    marks = np.full((*goal.shape, 3), 230, dtype=np.uint8)
    marks[goal == 1], marks[start == 1] = colors.to_bytes(colors.GOAL), colors.to_bytes(colors.START)
    rays = draw_grid(maze.walls, NEAR_PIXELS)
    draw_rays(rays, NEAR_PIXELS, pose[:2], ray_ends(pose, observation["lidar"]))
    pictures = {
        "context[0]: the map": 1 - shown,
        "context[1]: around the start": 1 - around,
        "context[2], [3]: goal, start": marks,
        "lidar: 32 distances": rays,
        "egocentric: 64 x 64 pixels": observation["egocentric"],
    }
    figure = Figure(figsize=(8, 5.7), layout="constrained")
    *panels, last = figure.subplots(2, 3).flat
    for axes, (title, picture) in zip(panels, pictures.items(), strict=True):
        _show(axes, picture, title, 13, cmap="gray", interpolation="nearest")
    x, y = NEAR_PIXELS * pose[0], NEAR_PIXELS * (maze.size - pose[1])
    panels[3].set(xlim=(x - NEAR, x + NEAR), ylim=(y + NEAR, y - NEAR))

    groups = ("position x, y, z in m", "roll, pitch, yaw in rad", "velocity in m/s", "turning in rad/s")
    state = zip(groups, (observation["state"].reshape(4, 3) + 0.0).tolist(), strict=True)
    text = "\n\n".join(f"{group}\n" + "   ".join(f"{number:.2f}" for number in numbers) for group, numbers in state)
    _show(last, np.zeros((1, 1, 4)), "state: 12 numbers", 13, extent=(0, 1, 0, 1))
    last.text(0, 0.98, text, fontsize=13, va="top", linespacing=1.2)
    _save(figure, "observation", 100, transparent=True)


def draw_old_map() -> None:
    """Draws a scanned office as its old map shows it and as it is, with the path on the map and the robot's.

    There are a wide and a narrow form, for light and for dark pages.
    """
    maze, older = load_building(PREFIX + CHECKED), load_older(PREFIX + building_of(CHECKED).older, PREFIX + CHECKED)
    maps = {"mazes": PREFIX + CHECKED, "shown": PREFIX + building_of(CHECKED).older}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        mazebench.evaluate("navigator", out=folder, record=True, task="rebuilt", split="dev", **maps)
        record = load_result(folder).records[DETOUR]
        pose = load_trajectories(folder / TRAJECTORIES)[DETOUR].pose
    path = maze.point(np.array(path_through_walls(older.walls, record.start, record.goal)))
    rows, columns = np.nonzero(~older.walls)
    left, right = (maze.cell_size * x for x in (columns.min() - 1, columns.max() + 2))
    bottom, top = (maze.cell_size * (maze.size - y) for y in (rows.max() + 2, rows.min() - 1))

    metres = f"{record.path_length:.0f} m instead of {record.shortest_path:.0f} m"
    for (theme, look), (form, num_columns) in itertools.product(THEMES.items(), {"": 2, "-narrow": 1}.items()):
        figure = Figure(figsize=(3.6 * num_columns, 5.9 / num_columns), layout="constrained", facecolor=look["page"])
        panels = figure.subplots(2 // num_columns, num_columns)
        titles = "The old map, and the path on it", f"The building today: {metres}"
        for axes, title, walls in zip(panels, titles, (older.walls, maze.walls), strict=True):
            cells = np.where(walls, look["wall"], look["floor"])
            if walls is maze.walls:
                cells = np.where(walls & ~older.walls, DRIVEN, cells)
            colors_of_cells = np.array([list(bytes.fromhex(each[1:])) for each in cells.flat], dtype=np.uint8)
            axes.imshow(colors_of_cells.reshape(*walls.shape, 3), extent=2 * (0, maze.side), interpolation="nearest")
            axes.plot(*path.T, "--", color=look["path"], lw=1.8, label="shortest path on the old map")
            axes.set_title(title, fontsize=9, loc="left", color=look["text"])
            axes.set(xlim=(left, right), ylim=(bottom, top))
            axes.set_axis_off()
        panels[1].plot(*pose[:, :2].T, color="#e8871e", lw=1.8, label="the robot's way")
        panels[1].plot([], [], "s", color=DRIVEN, label="closed since")
        for axes in panels:
            for label, place, shade in (("start", record.start, colors.START), ("goal", record.goal, colors.GOAL)):
                axes.plot(*maze.point(np.array(place)), "o", color=shade, ms=6, label=label, zorder=5)
        handles, labels = panels[1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=5 if num_columns == 2 else 2, frameon=False,
                      fontsize=8, labelcolor=look["text"], handlelength=1.6, columnspacing=1.2)  # fmt: skip
        (FOLDER / f"old-map{theme}{form}.svg").write_bytes(to_svg(figure))


def draw_formats() -> None:
    """Draws a small maze in each format that is read, as its file looks and as it is read."""
    with tempfile.TemporaryDirectory() as name:
        files = _files_of_formats(pathlib.Path(name))
        for form, columns in {"": 3, "-narrow": 1}.items():
            rows = -(-len(files) // columns)
            figure = Figure(figsize=(3.2 * columns, 1.75 * rows), layout="constrained")
            panels = figure.subplots(rows, 2 * columns).reshape(-1, 2)
            for (on_file, on_maze), (title, (path, options)) in zip(panels, files.items(), strict=False):
                on_file.set_title(title, fontsize=8, loc="left")
                picture = path.with_suffix(".pgm") if path.suffix == ".yaml" else path
                if picture.suffix in (".png", ".pgm"):
                    on_file.imshow(np.asarray(Image.open(picture).convert("L")), cmap="gray", vmin=0, vmax=255)
                elif path.suffix == ".npy":
                    on_file.text(0, 1, str(np.load(path).astype(int)).replace(" ", NO_BREAK), **_TEXT_OF_FILE)
                else:
                    lines = path.read_text(encoding="utf-8").rstrip().splitlines()
                    lines = [part for line in lines for part in textwrap.wrap(line, 27, drop_whitespace=False)]
                    on_file.text(0, 1, "\n".join(lines).replace(" ", NO_BREAK), **_TEXT_OF_FILE)
                maze = read_located(path, **options)[0]
                on_maze.imshow(~maze.walls, cmap="gray", vmin=-0.25, vmax=1, interpolation="nearest")
            for axes in panels.flat:
                axes.set_axis_off()
            (FOLDER / f"formats{form}.svg").write_bytes(to_svg(figure))


def _files_of_formats(folder: pathlib.Path) -> dict[str, tuple[pathlib.Path, dict[str, Any]]]:
    """Writes a file in each format into `folder`, and returns them with the options to read them, by title."""
    walls = np.array([[char == "#" for char in row] for row in SMALL_MAZE.split()])
    rows = SMALL_MAZE.split()
    numbers = json.dumps(walls.astype(int).tolist()).replace("], ", "],\n ")
    posts = "o---o---o---o\n|       |   |\no---o   o   o\n|           |\no   o---o   o\n|           |\no---o---o---o\n"
    texts = {
        "text": ("maze.txt", SMALL_MAZE),
        "DeepMind Lab, labmaze": ("lab.txt", "*******\n*P  * *\n*** * *\n*   O *\n* *** *\n*    G*\n*******\n"),
        "MovingAI": ("moving.map", f"type octile\nheight 7\nwidth 7\nmap\n{SMALL_MAZE.replace('#', '@')}"),
        "D4RL": ("d4rl.txt", "\\".join(row.replace(".", "O") for row in rows)),
        "Gymnasium-Robotics": ("robotics.json", numbers),
        "table": ("table.csv", "".join(",".join(map(str, row)) + "\n" for row in walls.astype(int))),
        "walls between posts": ("posts.txt", posts),
        "plan of +, - and |": ("plan.txt", "+-----+\n|...|.|\n+-+.|.|\n|.....|\n|.--+.|\n|.....|\n+-----+\n"),
        "JSON object": ("object.json", f'{{"grid":\n{numbers}}}'),
    }
    files: dict[str, tuple[pathlib.Path, dict[str, Any]]] = {}
    for title, (name, text) in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
        files[title] = folder / name, {}
    np.save(folder / "array.npy", walls)
    files["NumPy"] = folder / "array.npy", {}

    # A plan with thin walls, as a ROS map and as a picture with a scale.
    plan = np.full((140, 140), 205, np.uint8)
    plan[10:130, 10:130] = 254
    for top, left, bottom, right in ((10, 10, 14, 130), (126, 10, 130, 130), (10, 10, 130, 14), (10, 126, 130, 130),
                                     (10, 70, 50, 74), (66, 14, 70, 90), (90, 74, 130, 78)):  # fmt: skip
        plan[top:bottom, left:right] = 0
    Image.fromarray(plan).save(folder / "ros.pgm")
    (folder / "ros.yaml").write_text(
        "image: ros.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    files["ROS map: ros.yaml and ros.pgm"] = folder / "ros.yaml", {}
    write_image(draw_grid(walls, 12), folder / "cells.png")
    files["picture of cells"] = folder / "cells.png", {}
    Image.fromarray(np.where(plan == 0, 0, 255).astype(np.uint8)).save(folder / "floor.png")
    files["floor plan, --pixel-size 0.05"] = folder / "floor.png", {"pixel_size": 0.05}
    return files


def draw_tracks() -> None:
    """Draws a row for each track: the maze with the oracle's path, and the map that is shown at each level."""
    figure = Figure(figsize=(9.6, 10.2), layout="constrained")
    maze = load_kind_mazes("train")[HOUSE]
    for row, track in zip(figure.subplots(len(STANDING), 1 + len(LEVELS)), STANDING, strict=True):
        for level in LEVELS:
            played = play(maze, split="train", task=track, level=level, distances=DISTANCE)
            _show(row[level], _shown_map(played.shown), f"{track} {level}", 13, extent=2 * (0, maze.size))
            if track == "rebuilt":
                for doors, marker in ((maze.walls & ~played.seen.walls, "x"), (played.seen.walls & ~maze.walls, "o")):
                    row[level].plot(*maze.point(np.argwhere(doors)).T, marker, color=MOVED, ms=5, fillstyle="none")
            if track == "adrift":
                row[level].plot(*played.pose[:, :2].T, color="#888888", lw=1.2)
                row[level].plot(*played.observed[:, :2].T, "--", color=DRIVEN, lw=1.2)
                row[level].set(xlim=(0, maze.size), ylim=(0, maze.size))
        _show(row[0], _maze_and_path(played), "the maze, a path", 13)
    _save(figure, "tracks")


def draw_kinds() -> None:
    """Draws a maze of each kind, with the oracle's path to a far goal."""
    groups = {"train and test": KNOWN, "test only": NOVEL, "check only": CHECK}
    titles = {kind: f"{kind} ({group})" for group, kinds in groups.items() for kind in kinds}
    figure = Figure(figsize=(9.6, 10.2), layout="constrained")
    for axes, kind in zip(figure.subplots(3, 3).flat, titles, strict=True):
        maze = mazebench.generate(kind, 31, np.random.default_rng(3))
        _show(axes, _maze_and_path(play(maze, mazes=maze, distances=DISTANCE)), titles[kind])
    _save(figure, "kinds")


class Played(NamedTuple):
    """An episode that was played."""

    maze: Maze
    start: Cell
    goal: Cell
    pose: np.ndarray  # [T, 3] float
    observed: np.ndarray | None  # [T, 3] float, the pose by odometry where the track has it, laid on the first true one
    shown: Shown
    seen: ShownMap


def play(maze: Maze | None, agent: str = "oracle", **options: Any) -> Played:
    """Returns an agent's first episode in a maze; without one, the first whose shortest path on the map is blocked."""
    one = {} if options.get("task") == "hierarchical" else {"episodes_per_distance": 1}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        mazebench.evaluate(agent, out=folder, record=True, **one | options)
        result, trajectories = load_result(folder), load_trajectories(folder / TRAJECTORIES)
    record = next(each for each in result.records if (each.blocked if maze is None else each.maze == maze.name))
    task, trajectory = resolve(result.summary.task), trajectories[record.episode]
    observed = None if trajectory.observed is None else lay_on_first_pose(trajectory)
    index = [each.name for each in task.mazes].index(record.maze)
    episode = Episode(index, record.start, record.goal, float(trajectory.pose[0, 2]), record.seed)
    shown, seen, pose = shown_of(task, episode), show_map(task, episode), trajectory.pose.astype(float)
    return Played(task.mazes[index], record.start, record.goal, pose, observed, shown, seen)


@mpl.rc_context(GREY_TEXT)
def draw_planner() -> None:
    """Draws what the neural planner knows, pays and plans in the middle of an episode."""
    asked = TaskOptions(task="rebuilt", level=(2,), distances=(35,))
    task = resolve(asked, arena=arena_of(asked, (load_kind_mazes("train")[HOUSE],)))
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
    _save(figure, "neural-planner", 150, transparent=True)


def draw_changes() -> None:
    """Draws a plan, a building in which things have changed since it was drawn, and the navigator's path in that."""
    plan = mazebench.generate("hospital", 41, np.random.default_rng(7))
    options = {"task": "rebuilt", "level": 2, "distances": DISTANCE, "episodes_per_distance": 4}
    played = play(None, "navigator", mazes=plan, **options)
    changes = _draw_changes(played.maze.walls, plan.walls, 31 * PIXELS // plan.size)
    pictures = {
        "the plan, which the robot is shown": _shown_map(played.shown),
        "what has changed: closed (red), opened (green)": changes,
        "the building, and the navigator's path": _maze_and_path(played),
    }
    figure = Figure(figsize=(9.6, 3.4), layout="constrained")
    for axes, (title, picture) in zip(figure.subplots(1, 3), pictures.items(), strict=True):
        _show(axes, picture, title)
    _save(figure, "your-map", columns=1)


def draw_real_buildings() -> None:
    """Draws all real buildings of each split, and what differs between the maps of those that are in two."""
    for split in FROZEN_SPLITS:
        chosen = [each for each in buildings().values() if each.split == split and each.setting == RIGHT]
        panels = {}
        for each in chosen:
            maze = load_building(PREFIX + each.name)
            panels[f"{each.name}\n{each.use}, {each.origin}, {maze.side:.0f} m"] = draw_grid(_cut(maze.walls)[0], 2)
        _save_panels(panels, 5, f"real-{split}")
    panels = {}
    for each in buildings().values():
        if each.setting == YEARS:
            maze = load_building(PREFIX + each.name)
            walls, older = _cut(maze.walls, load_older(PREFIX + each.older, PREFIX + each.name).walls)
            panels[each.name.replace("-since-", "\nsince ")] = _draw_changes(walls, older, 2)
    _save_panels(panels, 4, "real-years")


def _save_panels(panels: Mapping[str, np.ndarray], columns: int, name: str) -> None:
    """Saves pictures with their titles, in rows of some columns."""
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(9.6, 2.15 * rows * 5 / columns), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for own, (title, picture) in zip(axes, panels.items(), strict=False):
        _show(own, picture, title, 7)
    for own in axes[len(panels) :]:
        own.set_axis_off()
    _save(figure, name)


def _cut(*grids: np.ndarray) -> list[np.ndarray]:
    """Returns grids `[N, N]` bool of walls without the rows and columns around that are wall in all of them."""
    free = ~np.all(grids, axis=0)
    rows, columns = (np.flatnonzero(free.any(axis=axis)) for axis in (1, 0))
    return [grid[rows[0] - 1 : rows[-1] + 2, columns[0] - 1 : columns[-1] + 2] for grid in grids]


def _draw_changes(walls: np.ndarray, older: np.ndarray, pixels: int) -> np.ndarray:
    """Returns a picture of walls `[H, W]` bool: red where it is wall now, green where it is free now."""
    both = draw_grid(walls | older, pixels)
    for changed, shade in ((walls & ~older, DRIVEN), (older & ~walls, "#2a9d3a")):
        both[np.kron(changed, np.ones((pixels, pixels), dtype=bool))] = tuple(bytes.fromhex(shade[1:]))
    return both


def draw_looks() -> None:
    """Draws six places in mazes of no split by the agent's camera, a look in each row."""
    envs = mazebench.make_vec("local", 6, kinds=("house", "rooms"), size=31, distances=(2, 3, 4))
    envs.reset(seed=SEEN)
    rules = envs.rules
    light = {split: exposures_of(np.random.default_rng(SEEN), 6, split) for split in ("train", "dev", "eval")}
    as_it_is = np.ones(6, dtype=np.float32), np.full(6, -1)
    near, wide = Camera(size=96), Camera(size=96, fov=200)
    rows = (
        ("egocentric", near, PLAIN, "train", as_it_is),
        *(("egocentric", near, VARIED, split, light[split]) for split in light),
        ("egocentric", wide, VARIED, "eval", as_it_is),
        ("depth", near, PLAIN, "train", as_it_is),
        ("labels", near, PLAIN, "train", as_it_is),
    )
    sheet = np.zeros((len(rows) * 100 - 4, 6 * 100 - 4, 4), dtype=np.uint8)
    for row, (name, camera, look, split, exposures) in enumerate(rows):
        eye = RayCamera(envs.task.mazes, camera, look, split)
        pictures = eye.take((name,), rules.maze, rules.pose, rules.marker, *exposures)[name]
        for column, picture in enumerate(pictures):
            top, left = 100 * row, 100 * column
            sheet[top : top + 96, left : left + 96] = np.dstack([as_colors(name, picture), np.full((96, 96), 255)])
    Image.fromarray(sheet).save(FOLDER / "looks.png", optimize=True)


def draw_shortest_paths() -> None:
    """Draws the shortest paths of the body as a disc between opposite corners of three mazes, with their lengths."""
    figure = Figure(figsize=(9.6, 3.5), layout="constrained")
    for axes, kind in zip(figure.subplots(1, 3), ("dfs", "obstacles", "house"), strict=True):
        maze = mazebench.generate(kind, 13, np.random.default_rng(2))
        start, goal = corner_cells(maze)
        path, length = _path_of_disc(maze, SLIDER.radius, start, goal)
        picture = draw_grid(maze.walls, NEAR_PIXELS, start, goal, path)
        _show(axes, picture, f"{length:.1f} m; on the grid {maze.distance(start, goal)} m", 11)
    _save(figure, "shortest-paths", columns=1)


def _path_of_disc(maze: Maze, radius: float, start: Cell, goal: Cell) -> tuple[np.ndarray, float]:
    """Returns points `[T, 2]` (m) down the slope of the length that is left to the goal, and the whole length (m)."""
    walls = maze.point(np.argwhere(maze.walls))
    angles = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    steps = STRIDE * np.column_stack([np.cos(angles), np.sin(angles)])
    paths, path = DiscPaths(maze, radius), [np.array(maze.point(start))]
    whole = left = paths.length(path[0], goal)
    while left > 0:
        near = path[-1] + steps
        beyond = np.maximum(np.abs(near[:, None] - walls) - maze.cell_size / 2, 0)
        near = near[np.hypot(*np.moveaxis(beyond, -1, 0)).min(axis=1) >= radius]
        lengths = [paths.length(point, goal) for point in near]
        path.append(near[np.argmin(lengths)])
        left = min(lengths)
    return np.array(path), whole


def draw_explorer() -> None:
    """Takes a picture of the report's explorer, at an episode in which a closed door is driven around."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        options = {"task": "rebuilt", "level": 2, "split": "dev", "episodes_per_maze": 1}
        mazebench.evaluate("navigator", out=folder / "navigator", record=True, **options)
        write_report([folder / "navigator"], folder / "report")
        # The explorer alone: what is around it is hidden.
        hidden = "header, .skip, .notice, #figures, #results {display: none}"
        _take(folder / "report" / "report.html", "report-explorer", hidden, "1100,690", f"#episode=0-{EXPLORED}")


def draw_check() -> None:
    """Takes a picture of the page of a check of an old map, without the explorer."""
    with tempfile.TemporaryDirectory() as name:
        maps = ("--mazes", f"{PREFIX}{CHECKED}", "--shown", f"{PREFIX}{building_of(CHECKED).older}")
        command = (sys.executable, "-m", "mazebench", "check-map", *maps, "--out", name)
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        hidden = "nav, .skip, #explorer, #results, .note {display: none} main {max-width: 900px}"
        _take(pathlib.Path(name) / "index.html", "check-map", hidden, "900,1120")


def _take(page: pathlib.Path, name: str, style: str, size: str, address: str = "") -> None:
    """Takes a picture of a page to which a style is added, in a window of a size."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        print(f"{name}.png: expected Chromium, found none; the picture stays as it is")
        return
    text = re.sub("<meta http-equiv[^>]*>", f"<style>{style}</style>", page.read_text(encoding="utf-8"))
    page.write_text(text, encoding="utf-8")
    look = ("--headless", "--no-sandbox", "--hide-scrollbars", "--virtual-time-budget=20000", f"--window-size={size}")
    target = f"--screenshot={FOLDER / f'{name}.png'}"
    subprocess.run([browser, *look, target, page.as_uri() + address], check=True, capture_output=True)


def _shown_map(shown: Shown) -> np.ndarray:
    pixels = shown.walls if shown.are_cells else shown.walls / 255
    start, goal = (None if mark < 0 else divmod(mark, len(pixels)) for mark in (shown.start, shown.goal))
    return draw_grid(pixels, 31 * PIXELS // len(pixels), start, goal)


def _maze_and_path(played: Played) -> np.ndarray:
    maze = played.maze
    return draw_grid(maze.walls, 31 * PIXELS // maze.size, played.start, played.goal, played.pose[:, :2])


def annotate(
    on_map: Axes, on_maze: Axes, maze: Maze, seen: ShownMap, start: Cell, goal: Cell, has_doors: bool = True
) -> None:
    """Adds to pictures of a shown map and of its maze the path on the map, and the doors that moved; all in cells."""

    def points(cells: np.ndarray) -> np.ndarray:
        return maze.point(cells) / maze.cell_size

    for label, color in (("start", colors.START), ("goal", colors.GOAL)):
        on_map.plot([], [], "o", color=color, label=label)
    path = path_through_walls(seen.walls, start, goal)
    on_map.plot(*seen.seen_points(points(np.array(path))).T, "--", lw=2, color=PLANNED, label="path on the map")

    closed, on_path = maze.walls & ~seen.walls, np.zeros_like(maze.walls)
    on_path[tuple(np.transpose(path))] = True
    marks = {
        "blocking door": ("x", PLANNED, closed & on_path),
        "other closed doors": ("x", MOVED, closed & ~on_path),
        "opened doors": ("o", MOVED, seen.walls & ~maze.walls),
    }
    for label, (marker, shade, doors) in marks.items():
        if doors.any() and has_doors:
            at, look = points(np.argwhere(doors)), {"ls": "", "ms": 7, "mew": 2, "fillstyle": "none"}
            on_maze.plot(*at.T, marker, color=shade, label=label, **look)
            on_map.plot(*seen.seen_points(at).T, marker, color=shade, **look)


def add_legend(figure: Figure) -> None:
    """Names the marks of `annotate` below the panels."""
    figure.legend(loc="outside lower left", ncols=3, fontsize=13, frameon=False, handlelength=1.5)


def _save(figure: Figure, name: str, dpi: int = 110, columns: int = 2, **options: Any) -> None:
    """Saves a figure, and the form for a phone, in which its panels are in so many columns."""
    options["metadata"] = {"Software": None}
    figure.savefig(FOLDER / f"{name}.png", dpi=dpi, **options)
    spec = figure.axes[0].get_subplotspec()
    assert spec
    was, (width, height) = spec.get_gridspec(), figure.get_size_inches()
    rows = -(-len(figure.axes) // columns)
    shape = (height / was.nrows) / (width / was.ncols)  # of a panel
    figure.set_size_inches(WIDTH / 1.6, rows * shape * WIDTH / 1.6 / columns)
    grid = figure.add_gridspec(rows, columns)
    for place, axes in enumerate(figure.axes):
        axes.set_subplotspec(grid[divmod(place, columns)])
        for text in (axes.title, *axes.texts):
            text.set_fontsize(min(text.get_fontsize(), 9))
    figure.savefig(FOLDER / f"{name}-narrow.png", dpi=120, **options)


def _show(axes: Axes, picture: np.ndarray, title: str, fontsize: float = 8, **look: Any) -> None:
    axes.imshow(picture, **({"interpolation": "antialiased"} | look))
    axes.set_title(title, fontsize=fontsize)
    axes.set_axis_off()


if __name__ == "__main__":
    of_episodes = draw_environments, draw_observation, draw_tracks, draw_kinds, draw_planner, draw_changes
    for draw in (
        *of_episodes,
        draw_old_map,
        draw_formats,
        draw_real_buildings,
        draw_looks,
        draw_shortest_paths,
        draw_explorer,
        draw_check,
    ):
        draw()
