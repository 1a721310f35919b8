"""Draws the film of the README and a picture of each environment: `python -m benchmarks.environment_pictures`.

The film, docs/images/rebuilt.gif, is an episode of `navigator` in the dev mazes of `rebuilt` 2, where the shown path is
blocked. The pictures, docs/images/environments/NAME.png, have the shown map on the left, and on the right the maze with
the oracle's path, of train mazes.
"""

from __future__ import annotations

import pathlib
import sys

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from benchmarks.track_pictures import play
from mazebench.evaluation.eval_options import EvalOptions, eval_options
from mazebench.evaluation.plan import make_plan
from mazebench.maps import colors
from mazebench.maps.maze import Maze
from mazebench.maps.pictures import draw_grid
from mazebench.play.film import _run
from mazebench.results.played import shown_of
from mazebench.tasks.tracks import TRACKS

FOLDER = pathlib.Path(__file__).parent.parent / "docs" / "images"
EPISODE = 94  # of the dev episodes of `rebuilt` 2: the navigator finds a door closed and drives around
VIEWS = {"map": "map given; rings: moved doors", "lidar": "real building, lidar and path", "egocentric": "robot's view"}
SIDE, GAP, TITLE = 256, 12, 26  # pixels; three panels and two gaps are 792 wide
RING = (232, 135, 30)  # the colour of rings around doors that have moved
FRAME_TIME = 80  # ms: twice as fast as the robot
COLOURS = 128
THUMBNAIL = 248


def main() -> None:
    """Draws all of them."""
    (FOLDER / "environments").mkdir(parents=True, exist_ok=True)
    film(int(sys.argv[1]) if len(sys.argv) > 1 else EPISODE, FOLDER / "rebuilt.gif")
    for track in TRACKS:
        maze, goal, pose, _, shown = play(track, 2)
        pixels = shown.walls if shown.are_cells else shown.walls / 255
        start, mark = (None if place < 0 else divmod(place, len(pixels)) for place in (shown.start, shown.goal))
        thumbnail(track, draw_grid(pixels, 1 + 2 * THUMBNAIL // len(pixels), start, mark), maze, pose, goal)
    for task, options in (("local", {"distances": 12}), ("hierarchical", {})):
        frames, _ = _run(eval_options("oracle", task=task, split="train", **options), "map", 2 * THUMBNAIL, True)
        save(task, frames[0], frames[-1])


def film(number: int, path: pathlib.Path) -> None:
    """Films an episode of the navigator in three views."""
    options = eval_options("navigator", task="rebuilt", level=2, split="dev", seed=number)
    views = {title: _run(options, view, SIDE, True) for view, title in VIEWS.items()}
    print(*{ending for _, ending in views.values()})
    ring_moved_doors([*views[VIEWS["map"]][0], *views[VIEWS["lidar"]][0]], options)
    moments = [
        titled(pictures, list(views)) for pictures in zip(*(frames for frames, _ in views.values()), strict=True)
    ]
    # One palette for all frames, so that what stands still is stored once.
    swatches = np.repeat(
        [[colors.to_bytes(colors.START)], [colors.to_bytes(colors.GOAL)], [RING]], moments[0].shape[1], axis=1
    )
    of_some = [*moments[:: len(moments) // 6], *[swatches.astype(np.uint8)] * 40]
    palette = Image.fromarray(np.concatenate(of_some)).quantize(COLOURS)
    frames = [Image.fromarray(each).quantize(palette=palette, dither=Image.Dither.NONE) for each in moments]
    durations = [FRAME_TIME] * (len(frames) - 1) + [2000]
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=durations, loop=0, optimize=True)
    print(path, f"{path.stat().st_size / 1e6:.1f} MB, {len(frames)} frames")


def ring_moved_doors(frames: list[np.ndarray], options: EvalOptions) -> None:
    """Draws a ring around each cell in which the map and the maze of the filmed episode differ."""
    plan = make_plan(options)
    episode = plan.trials[options.seed].episode
    walls = plan.task.mazes[episode.maze].walls
    for row, column in np.argwhere(shown_of(plan.task, episode).walls != walls):
        centre = tuple(int((place + 0.5) * SIDE / len(walls)) for place in (column, row))
        for frame in frames:
            cv2.circle(frame, centre, 7, RING, 2, cv2.LINE_AA)


def titled(pictures: tuple[np.ndarray, ...], titles: list[str]) -> np.ndarray:
    """Returns the pictures side by side, each below its title."""
    width = len(pictures) * SIDE + (len(pictures) - 1) * GAP
    image = Image.new("RGB", (width, TITLE + SIDE), "white")
    draw = ImageDraw.Draw(image)
    for column, (picture, title) in enumerate(zip(pictures, titles, strict=True)):
        left = column * (SIDE + GAP)
        draw.text((left + SIDE / 2, TITLE / 2), title, "#222222", ImageFont.load_default(15), anchor="mm")
        image.paste(Image.fromarray(picture), (left, TITLE))
    return np.asarray(image)


def thumbnail(name: str, shown: np.ndarray, maze: Maze, pose: np.ndarray, goal: tuple[int, int]) -> None:
    """Draws a shown map, and its maze with a path."""
    x, y = pose[0, :2]
    start = int(maze.size - y), int(x)
    save(name, shown, draw_grid(maze.walls, 1 + 2 * THUMBNAIL // maze.size, start, goal, pose[:, :2]))


def save(name: str, *pictures: np.ndarray) -> None:
    """Writes pictures side by side."""
    parts = [cv2.resize(each, (THUMBNAIL, THUMBNAIL), interpolation=cv2.INTER_AREA) for each in pictures]
    gap = np.full((THUMBNAIL, GAP, 3), 255, np.uint8)
    path = FOLDER / "environments" / f"{name}.png"
    Image.fromarray(np.concatenate([parts[0], gap, *parts[1:]], axis=1)).save(path, optimize=True)
    print(path)


if __name__ == "__main__":
    main()
