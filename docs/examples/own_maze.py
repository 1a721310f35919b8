"""Takes an array of one's own to a maze, an environment, and files for other tools.

python docs/examples/own_maze.py --out own
mazebench eval --agent planner --mazes own --distances 1-6
"""

import argparse
import pathlib

import numpy as np

import mazebench
from mazebench.maps.text import write_text_maze
from mazebench.world.export import write_mesh, write_mjcf

parser = argparse.ArgumentParser()
parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("own"))
arguments = parser.parse_args()

grid = np.array(
    [
        [1, 1, 1, 1, 1, 1, 1],
        [1, 0, 0, 0, 1, 0, 1],
        [1, 0, 1, 0, 1, 0, 1],
        [1, 0, 1, 0, 0, 0, 1],
        [1, 0, 1, 1, 1, 0, 1],
        [1, 0, 0, 0, 0, 0, 1],
        [1, 1, 1, 1, 1, 1, 1],
    ]
)
maze = mazebench.Maze(grid == 1, name="ring")  # True is wall; what is no legal maze is refused with the cell
print(f"{len(maze.free_cells)} free cells, the farthest {maze.diameter} cells apart")

environment = mazebench.load("local", mazes=maze, distances=[6], seed=0)
time_step = environment.reset()
print(f"from {environment.task.episode.start} to {environment.task.episode.goal}, a map of {maze.size} x {maze.size}")

arguments.out.mkdir(parents=True, exist_ok=True)
write_text_maze(maze, arguments.out / "ring.txt")
write_mjcf(maze, arguments.out / "ring.xml")  # opens in any MuJoCo tool: python -m mujoco.viewer --mjcf=ring.xml
write_mesh(maze, arguments.out / "ring.glb")
