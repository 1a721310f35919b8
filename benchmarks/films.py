"""Films an episode of each environment: `MUJOCO_GL=egl python -m benchmarks.films [NAME ...]`; all if none is named.

The map that is shown stands beside the building. Episodes are frozen ones of dev mazes and of dev buildings; those of
`local` and `hierarchical`, which have no dev mazes, are in train mazes. Films last some six seconds.
"""

from __future__ import annotations

import io
import pathlib
import sys
import tempfile
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

import mazebench
from benchmarks.pictures import FOLDER, MIDWAY, MOVED, ODOMETRY, PLANNED, add_legend, annotate
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.plan import Plan, make_plan
from mazebench.film import run_episode
from mazebench.maps import colors
from mazebench.report.page import lay_on_first_pose
from mazebench.results.reading import load_result
from mazebench.results.trajectories import TRAJECTORIES, load_trajectories
from mazebench.tasks.shown_map import show_map

GAP, TITLE, LEGEND = 12, 32, 70  # pixels
NUM_FRAMES, TIME, LAST_TIME = 75, 6000, 1500  # frames, about so many, and ms
SHADES, ALMOST_WHITE = 64, 244  # in a film, and of 255
TWO = {"map": "the map that is shown", "lidar": "the building"}
OLDER = {"map": "the map of 2012", "lidar": "the building in 2013"}
ABOVE = {"map": "the map", "top": "the maze"}
THREE = {"map": "the map, its path dashed", "lidar": "building, lidar, path", "egocentric": "the robot's view"}
REAL = "real:raw-industriestrasse-2013-since-2012-07"


class Film(NamedTuple):
    """An episode, and what is shown of it."""

    number: int  # among the episodes that the task's options select
    task: dict[str, Any]
    agent: str = "navigator"
    views: dict[str, str] = TWO  # titles
    side: int = 300  # pixels, of a view
    has_legend: bool = False  # or else the page says what the marks are


FILMS = {
    "rebuilt.gif": Film(94, {"task": "rebuilt", "level": 2, "split": "dev"}, views=THREE, side=256, has_legend=True),
    "films/building.webp": Film(3, {"task": "building", "level": 3, "split": "dev", "distances": 35}),
    "films/rebuilt.webp": Film(3, {"task": "rebuilt", "level": 2, "split": "dev", "distances": 35}),
    "films/adrift.webp": Film(3, {"task": "adrift", "level": 2, "split": "dev", "distances": 27}),
    "films/rough.webp": Film(3, {"task": "rough", "level": 2, "split": "dev", "distances": 36}),
    "films/doors.webp": Film(8, {"task": "doors", "level": 2, "split": "dev", "distances": 36}),
    "films/doors-around.webp": Film(7, {"task": "doors", "level": 2, "split": "dev", "distances": 36}),
    "films/real.webp": Film(11, {"task": "building", "mazes": REAL, "shown": f"{REAL}-older"}, views=OLDER),
    "films/local.webp": Film(4, {"distances": 15, "split": "train"}, agent="mmn", views=ABOVE),
    "films/hierarchical.webp": Film(0, {"task": "hierarchical", "split": "train"}, agent="mmn", views=ABOVE),
}


def film(name: str, chosen: Film) -> None:
    """Films an episode, with the path on the map and marks at the doors that have moved."""
    plan = make_plan(eval_options(chosen.agent, **chosen.task))
    views = [run_episode(plan, chosen.number, view, chosen.side, is_film=True) for view in chosen.views]
    moments = list(zip(*(frames for frames, _ in views), strict=True))
    marks, places = _marks(plan, chosen)
    frames = []
    for moment in [*moments[: -1 : max(1, round(len(moments) / NUM_FRAMES))], moments[-1]]:
        frame = Image.new("RGB", marks.size, "white")
        for place, picture in zip(places, moment, strict=True):
            frame.paste(Image.fromarray(picture), place)
        frame.paste(marks, mask=marks)
        frames.append(frame)

    # One palette for all frames, so that what stands still is stored once; white is the page's.
    shades = [MOVED, PLANNED, MIDWAY, ODOMETRY, colors.to_hex(colors.START), colors.to_hex(colors.GOAL)]
    swatches = np.array([[list(bytes.fromhex(shade[1:]))] for shade in shades * 40], dtype=np.uint8)
    some = [np.asarray(frame) for frame in frames[:: len(frames) // 6]]
    palette = Image.fromarray(np.concatenate([*some, np.repeat(swatches, marks.width, axis=1)])).quantize(SHADES)
    palette.putpalette([255 if value > ALMOST_WHITE else value for value in palette.getpalette() or ()])
    first, *rest = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    durations = [TIME // len(rest)] * len(rest) + [LAST_TIME]
    path = FOLDER / name
    path.parent.mkdir(exist_ok=True)
    look = {"optimize": True} if path.suffix == ".gif" else {"lossless": True, "method": 6}
    first.save(path, save_all=True, append_images=rest, duration=durations, loop=0, **look)
    print(f"{name}: {path.stat().st_size / 1000:.0f} kB, {len(frames)} frames; {views[0][1].words}")


def _marks(plan: Plan, chosen: Film) -> tuple[Image.Image, list[tuple[int, int]]]:
    """Returns what all frames have before them, on a transparent ground, and the upper left corners of the views."""
    episode = plan.trials[chosen.number].episode
    maze, seen = plan.task.mazes[episode.maze], show_map(plan.task, episode)
    side, count = chosen.side, len(chosen.views)
    width, height = count * (side + GAP) + GAP, TITLE + side + (LEGEND if chosen.has_legend else GAP)
    figure = Figure(figsize=(width / 100, height / 100))
    places = [(GAP + index * (side + GAP), TITLE) for index in range(count)]
    panels = [figure.add_axes((x / width, 1 - (TITLE + side) / height, side / width, side / height)) for x, _ in places]
    for axes, title, walls in zip(panels, chosen.views.values(), (seen.seen_walls, *[maze.walls] * 2), strict=False):
        axes.set_title(title, fontsize=14)
        axes.set_axis_off()
        _frame(axes, walls)
    annotate(*panels[:2], maze, seen, episode.start, episode.goal, has_doors=plan.task.options.track != "building")
    if plan.task.options.track in ("adrift", "rough", "doors"):
        with tempfile.TemporaryDirectory() as name:
            mazebench.evaluate(chosen.agent, out=name, record=True, **chosen.task)
            trajectory = load_trajectories(pathlib.Path(name) / TRAJECTORIES)[chosen.number]
            record = load_result(pathlib.Path(name)).records[chosen.number]
        if trajectory.observed is not None:
            panels[1].plot(*lay_on_first_pose(trajectory)[:, :2].T, "--", color=ODOMETRY, lw=2)
        for top, left, *_ in record.model_dump().get("doors", ()):
            for axes in panels:
                axes.plot(left + 0.5, maze.size - top - 0.5, "s", color=MOVED, ms=11, mew=2, fillstyle="none")
    if chosen.has_legend:
        add_legend(figure)
    figure.savefig(file := io.BytesIO(), transparent=True, dpi=100)
    return Image.open(file), places


def _frame(axes: Axes, walls: np.ndarray) -> None:
    """Lets the axes have the limits of a view, in cells: the free part of the map in the middle of a square."""
    free = np.argwhere(walls < 0.5)
    (top, left), (bottom, right) = np.maximum(free.min(axis=0) - 1, 0), np.minimum(free.max(axis=0) + 2, len(walls))
    half, x, y = max(bottom - top, right - left) / 2, (left + right) / 2, len(walls) - (top + bottom) / 2
    axes.set(xlim=(x - half, x + half), ylim=(y - half, y + half))


if __name__ == "__main__":
    for name in sys.argv[1:] or FILMS:
        film(name, FILMS[name])
