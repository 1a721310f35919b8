"""From options to tasks and environments: `make_spec` and `load`."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable, Sequence
from typing import Any

from mazebench.errors import InputError
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.files import read_mazes
from mazebench.maps.maze import Maze
from mazebench.tasks.navigation import Environment
from mazebench.tasks.spec import EVAL_DISTANCES, TIME_LIMIT, TRAIN_DISTANCES, Perturbation, TaskSpec

_DEFAULT_SIZE = 13


def make_spec(
    task: str = "local",
    size: int | None = None,
    split: str = "train",
    *,
    maps: str | pathlib.Path | Maze | Sequence[Maze] | None = None,
    distances: Iterable[int] | None = None,
    pairs: str = "random",
    time_limit: int = TIME_LIMIT,
    landmark_distance: int = 5,
    context_size: int | None = None,
    num_goals: int = 1,
    map_flip: float = 0.0,
    map_warp: float = 0.0,
    position_noise: float = 0.0,
    continuous: bool = False,
    cameras: str | Iterable[str] = (),
    camera_size: int = 64,
) -> TaskSpec:
    """A navigation task.

    Args:
      task: "local" or "hierarchical".
      size: N, the cells a side of the benchmark's mazes (13, 15, 17, 19 or 21; default 13); with `maps` only checked.
      split: "train" or "eval" mazes of benchmark v1.
      maps: mazes of your own instead: a `Maze`, several, or a text or image file or a folder of them.
      distances: cells between start and goal of local episodes; by default 1-5 on train mazes, 1-15 on eval mazes.
      pairs: "random", a new pair each episode, or "fixed", one pair a maze.
      time_limit: agent steps to reach the goal, or each landmark.
      landmark_distance: cells between landmarks.
      context_size: M, the side of the context's planes; min(N, 21) by default.
      num_goals: of a local episode, one after the other; rewards and `success` speak of the last one only.
      map_flip: probability of each inner cell but start and goal to be shown flipped.
      map_warp: how far each corner of the shown map may be moved, in shares of its side.
      position_noise: m, standard deviation of the noise on x and y of each observation.
      continuous: whether actions are velocities (forward, left, turn), `[3]` in [-1, 1], instead of one of six.
      cameras: of "egocentric", "top" and "chase", those whose pictures are observed too.
      camera_size: pixels a side of these pictures.

    Raises:
      InputError: if an option is unknown or out of range, or a map can't be read.
    """
    if maps is None:
        mazes = load_mazes(_DEFAULT_SIZE if size is None else size, split)
    elif isinstance(maps, Maze):
        mazes = (maps,)
    elif isinstance(maps, (str, pathlib.Path)):
        mazes = read_mazes(maps)
    else:
        mazes = tuple(maps)
    if distances is None:
        distances = TRAIN_DISTANCES if split == "train" or maps is not None else EVAL_DISTANCES
    spec = TaskSpec(
        task,
        mazes,
        tuple(distances),
        pairs,
        time_limit,
        landmark_distance,
        context_size or 0,
        num_goals,
        Perturbation(map_flip, map_warp, position_noise),
        continuous,
        (cameras,) if isinstance(cameras, str) else tuple(cameras),
        camera_size,
    )
    if size is not None and spec.size != size:
        raise InputError(f"expected mazes of size {size}, found size {spec.size}")
    return spec


def load(
    task: str = "local", size: int | None = None, split: str = "train", seed: int | None = None, **options: Any
) -> Environment:
    """A dm_control environment of a navigation task; `options` are those of `make_spec`.

    Its first episode is the one of `reset(seed=seed)`; `env.physics` and `env.task` are a
    `mazebench.world.physics.Physics` and a `mazebench.tasks.navigation.Navigation`.
    """
    return Environment(make_spec(task, size, split, **options), seed)
