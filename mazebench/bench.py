"""Speed on this machine for `mazebench bench`: agent steps per second, and ratios between what takes turns in one run.

A ratio is the median over rounds, so that a machine whose speed drifts slows both sides.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any, NamedTuple

import mujoco
import numpy as np

from mazebench.constants import ACTIONS, STEPS_PER_ACTION
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.maps.kinds import generate
from mazebench.tasks.task import TRAIN_DISTANCES, Task
from mazebench.world.looks import LOOKS, PICTURES, PLAIN, VARIED, Camera
from mazebench.world.near_walls import near_walls_of
from mazebench.world.ray_camera import RayCamera
from mazebench.world.simulation import MujocoSimulation

NUM_ENVS = (1, 16, 256, 1024, 4096)
SIZES = (13, 31, 51, 101, 255)


class Side(NamedTuple):
    """Something to measure."""

    name: str
    step: Callable[[np.ndarray], Any]  # takes actions `[B]` int and does an agent step in each environment
    num_envs: int = 1  # B


def run(quick: bool) -> dict[str, Any]:
    """Measures everything; `quick`, in fewer and shorter rounds."""
    seconds, rounds = (0.1, 3) if quick else (0.5, 7)  # of each side
    return {
        "cores": os.cpu_count(),
        "mujoco": mujoco.__version__,
        "environments": measure(environments(), seconds, rounds),
        "256 environments by size": measure(sizes(), seconds, rounds),
        "64 environments of building 2 with pictures": measure(with_pictures(), seconds, rounds),
        "pictures alone, each of which counts as a step": measure(pictures(), seconds, rounds),
    }


def environments(num_envs: Sequence[int] = NUM_ENVS) -> list[Side]:
    """Returns the bare loop, and the environments in the benchmark's mazes of 13 x 13 cells, but for the track's."""
    task, middle = Task.of(), num_envs[len(num_envs) // 2]
    return [
        Side("bare MuJoCo loop", _bare_loop(task)),
        Side("Gymnasium", _gymnasium(task)),
        Side("Gymnasium, lidar", _gymnasium(Task.of(sensors=("lidar",), lidar_noise="turtlebot3"))),
        Side("Gymnasium, rebuilt", _gymnasium(Task.of("rebuilt", level=2))),
        *([Side("dm_control", _dm_control(task))] if find_spec("dm_control") else []),  # not for each Python
        *(_vector(f"vector, {count:,}", task, count) for count in num_envs),
        *(_vector(f"vector, {count:,}, 1 thread", task, count, num_threads=1) for count in num_envs if count <= middle),
        _vector(f"vector, {middle:,}, lidar, 1 thread", Task.of(sensors=("lidar",)), middle, num_threads=1),
        _vector(f"vector, {middle:,}, lidar", Task.of(sensors=("lidar",)), middle),
    ]


def sizes(chosen: Sequence[int] = SIZES, num_envs: int = 256) -> list[Side]:
    """Returns vector environments in mazes of several sizes."""
    sides = []
    for size in chosen:
        mazes = [generate("dfs", size, np.random.default_rng([size, index])) for index in range(8)]
        sides.append(_vector(f"{size} x {size}", Task.of(mazes=mazes, distances=TRAIN_DISTANCES), num_envs))
    return sides


def with_pictures(num_envs: int = 64) -> list[Side]:
    """Returns vector environments on a track without and with pictures of 64 pixels a side."""
    observed: dict[str, dict[str, Any]] = {"no picture": {}}
    observed |= {look: {"sensors": "egocentric", "look": look} for look in LOOKS}
    observed["plain, with depth and labels"] = {"sensors": (*PICTURES,)}
    return [_vector(name, Task.of("building", level=2, **options), num_envs) for name, options in observed.items()]


def pictures(chosen: Sequence[int] = (13, 31, 101, 255), pixels: Sequence[int] = (84, 128)) -> list[Side]:
    """Returns cameras that take pictures of 64 pixels in mazes of several sizes, and of more in the first one."""
    sides = [_camera(look, size, 64) for look in LOOKS for size in chosen]
    return sides + [_camera(PLAIN, chosen[0], each) for each in pixels]


def measure(sides: Sequence[Side], seconds: float, rounds: int) -> list[dict[str, Any]]:
    """Returns for each side its agent steps per second, and the ratio to the first side's; all take turns."""
    rates = np.array([[_rate(side, seconds) for side in sides] for _ in range(rounds)])
    return [
        {"name": side.name, "steps/s": round(np.median(own)), "ratio": float(np.median(own / rates[:, 0]))}
        for side, own in zip(sides, rates.T, strict=True)
    ]


def _rate(side: Side, seconds: float) -> float:
    actions = np.random.default_rng(0).integers(len(ACTIONS), size=(512, side.num_envs))
    side.step(actions[0])
    count, begin = 0, time.perf_counter()
    while (elapsed := time.perf_counter() - begin) < seconds:
        side.step(actions[count % len(actions)])
        count += 1
    return count * side.num_envs / elapsed


def _bare_loop(task: Task) -> Callable[[np.ndarray], None]:
    """Returns agent steps of one simulation by mj_step alone: no task, observations or resets."""
    maze, walls, controls = task.mazes[0], near_walls_of(task.mazes, 1, task.body), task.body.action_controls()
    simulation = MujocoSimulation(walls.model, walls)
    model, data = simulation.model, simulation.data
    data.qpos[:2] = maze.point(maze.free_cells[0])

    def step(actions: np.ndarray) -> None:
        row, column = maze.cell_at(*data.qpos[:2].tolist())
        simulation.surround(0, row * maze.size + column)
        data.ctrl[:] = controls[actions[0]]
        mujoco.mj_step(model, data, STEPS_PER_ACTION)

    return step


def _gymnasium(task: Task) -> Callable[[np.ndarray], None]:
    env = MazeEnv(task, 0)
    env.reset()

    def step(actions: np.ndarray) -> None:
        *_, terminated, truncated, _ = env.step(actions[0])
        if terminated or truncated:
            env.reset()

    return step


def _dm_control(task: Task) -> Callable[[np.ndarray], Any]:
    from mazebench.envs.dm_control import Environment

    env = Environment(task, 0)
    env.reset()
    return lambda actions: env.step(actions[0])


def _vector(name: str, task: Task, num_envs: int, num_threads: int = 0) -> Side:
    envs = MazeVectorEnv(task, num_envs, seed=0, num_threads=num_threads)
    envs.reset()
    return Side(name, envs.step, num_envs)


def _camera(look: str, size: int, pixels: int, count: int = 64) -> Side:
    rng = np.random.default_rng(size)
    maze = generate("dfs", size, rng)
    points = maze.point(maze.free_cells[rng.integers(len(maze.free_cells), size=count)])
    pose, marker = np.column_stack([points, rng.uniform(-np.pi, np.pi, count)]), np.zeros((count, 3))
    gain, noise_at = np.ones(count, dtype=np.float32), np.full(count, 0 if look == VARIED else -1)
    camera = RayCamera((maze,), Camera(pixels), look)

    def take(actions: np.ndarray) -> None:
        camera.take(("egocentric",), np.zeros(count, dtype=np.int64), pose, marker, gain, noise_at)

    return Side(f"{look}, {pixels} pixels, {size} x {size}", take, count)
