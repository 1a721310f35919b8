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
from benchmarks.pictures import FOLDER, MIDWAY, MOVED, ODOMETRY, PLANNED, annotate
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.plan import Plan, make_plan
from mazebench.film import run_episode
from mazebench.maps import colors
from mazebench.report.page import lay_on_first_pose
from mazebench.results.reading import load_result
from mazebench.results.trajectories import TRAJECTORIES, load_trajectories
from mazebench.tasks.shown_map import show_map

SIDE, GAP, TITLE = 300, 12, 32  # pixels; of a view, between two, and above them
NUM_FRAMES, TIME, LAST_TIME = 75, 6000, 1500  # frames, about so many, and ms
SHADES, ALMOST_WHITE = 64, 244  # in a film, and of 255
TWO = {"map": "the map that is shown", "lidar": "the building"}
OLDER = {"map": "the map of 2012", "lidar": "the building in 2013"}
ABOVE = {"map": "the map", "top": "the maze"}
REAL = "real:raw-industriestrasse-2013-since-2012-07"


class Film(NamedTuple):
    """An episode, and what is shown of it."""

    number: int  # among the episodes that the task's options select
    task: dict[str, Any]
    agent: str = "navigator"
    views: dict[str, str] = TWO  # titles


FILMS = {
    "building": Film(3, {"task": "building", "level": 3, "split": "dev", "distances": 35}),
    "rebuilt": Film(3, {"task": "rebuilt", "level": 2, "split": "dev", "distances": 35}),
    "adrift": Film(3, {"task": "adrift", "level": 2, "split": "dev", "distances": 27}),
    "rough": Film(3, {"task": "rough", "level": 2, "split": "dev", "distances": 36}),
    "doors": Film(8, {"task": "doors", "level": 2, "split": "dev", "distances": 36}),
    "doors-around": Film(7, {"task": "doors", "level": 2, "split": "dev", "distances": 36}),
    "real": Film(11, {"task": "building", "mazes": REAL, "shown": f"{REAL}-older"}, views=OLDER),
    "local": Film(4, {"distances": 15, "split": "train"}, agent="mmn", views=ABOVE),
    "hierarchical": Film(0, {"task": "hierarchical", "split": "train"}, agent="mmn", views=ABOVE),
}


def film(name: str, chosen: Film) -> None:
    """Films an episode, with the path on the map and marks at the doors that have moved."""
    plan = make_plan(eval_options(chosen.agent, **chosen.task))
    views = [run_episode(plan, chosen.number, view, SIDE, is_film=True) for view in chosen.views]
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
    path = FOLDER / "films" / f"{name}.webp"
    path.parent.mkdir(exist_ok=True)
    first.save(path, save_all=True, append_images=rest, duration=durations, loop=0, lossless=True, method=6)
    print(f"{name}: {path.stat().st_size / 1000:.0f} kB, {len(frames)} frames; {views[0][1].words}")


def _marks(plan: Plan, chosen: Film) -> tuple[Image.Image, list[tuple[int, int]]]:
    """Returns what all frames have before them, on a transparent ground, and the upper left corners of the views."""
    episode = plan.trials[chosen.number].episode
    maze, seen = plan.task.mazes[episode.maze], show_map(plan.task, episode)
    count = len(chosen.views)
    width, height = count * (SIDE + GAP) + GAP, TITLE + SIDE + GAP
    figure = Figure(figsize=(width / 100, height / 100))
    places = [(GAP + index * (SIDE + GAP), TITLE) for index in range(count)]
    panels = [figure.add_axes((x / width, 1 - (TITLE + SIDE) / height, SIDE / width, SIDE / height)) for x, _ in places]
    for axes, title, walls in zip(panels, chosen.views.values(), (seen.seen_walls, maze.walls), strict=True):
        axes.set_title(title, fontsize=14)
        axes.set_axis_off()
        _frame(axes, walls)
    annotate(*panels, maze, seen, episode.start, episode.goal, has_doors=plan.task.options.track != "building")
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
