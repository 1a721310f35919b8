"""Draws what an agent sees with and without textures, docs/images/textures.png, and measures what textures cost.

`MUJOCO_GL=egl python benchmarks/textures.py`.
"""

from __future__ import annotations

import pathlib
import time
from collections.abc import Callable

import numpy as np

from mazebench.maps.benchmark import load_mazes
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze, cell_to_point
from mazebench.maps.pictures import write_image
from mazebench.world.models import MazeModels
from mazebench.world.rendering import Cameras

PICTURE = pathlib.Path(__file__).parent.parent / "docs" / "images" / "textures.png"
PIXELS, GAP = 170, 6
START, GOAL = (9, 1), (1, 11)  # in the first eval maze
STEPS = (3, 9, 11, 16, 24, 27)  # cells from the start


def main() -> None:
    """Draws the picture and prints a table of costs."""
    maze = load_mazes(13, "eval")[0]
    write_image(np.concatenate([seen(maze, textures) for textures in (False, True)])[:-GAP, :-GAP], PICTURE)
    print(PICTURE)
    print("cells, textures, geoms, compiling (ms), model (kB), egocentric (ms), top (ms)")
    for size in (13, 31, 61):
        mazes = [generate("dfs", size, np.random.default_rng(seed)) for seed in range(2)]
        for textures in (False, True):
            print(size, textures, *costs(mazes, textures))


def seen(maze: Maze, textures: bool) -> np.ndarray:
    """Returns pictures through the agent's eyes on its way to the goal, side by side, with gaps."""
    path = np.array([cell_to_point(cell, maze.size) for cell in maze.shortest_path(START, GOAL)])
    cameras = Cameras(MazeModels([maze], textures), ("egocentric",), PIXELS)
    pictures = []
    for step in STEPS:
        right, up = path[step + 1] - path[step]
        pose = np.array([*path[step], np.arctan2(up, right)])
        picture = cameras.take(0, pose, np.array([*path[-1], 0.0]))["egocentric"]
        pictures.append(np.pad(picture, ((0, GAP), (0, GAP), (0, 0)), constant_values=255))
    return np.concatenate(pictures, axis=1)


def costs(mazes: list[Maze], textures: bool) -> list[float]:
    """Returns the geoms of a maze, ms to compile it, its kB, and ms of pictures of 64 x 64, egocentric and top."""
    models = MazeModels(mazes, textures)
    compiling = milliseconds(lambda: MazeModels(mazes[:1], textures)[0], 5)
    pictures = []
    for name in ("egocentric", "top"):
        cameras = Cameras(models, (name,), 64, smooth=False)
        pictures.append(milliseconds(lambda: cameras.take(0, models[0].key_qpos[0], np.zeros(3)), 40))  # noqa: B023
        cameras.close()
    return [models[0].ngeom, round(compiling), models[0].nbuffer // 1000, *(round(value, 1) for value in pictures)]


def milliseconds(call: Callable[[], object], count: int) -> float:
    """Returns the processor time of the shortest of some calls, in ms; other programs hardly change it."""
    call()
    times = []
    for _ in range(count):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    return 1e3 * min(times)


if __name__ == "__main__":
    main()
