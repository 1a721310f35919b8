"""From options to tasks and environments: `make_spec` and `load`."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable
from typing import Any

from mazebench.errors import InputError, unknown
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.files import read_mazes
from mazebench.maps.maze import Maze
from mazebench.options import options_of
from mazebench.tasks.navigation import Environment
from mazebench.tasks.options import EVAL_DISTANCES, TaskOptions
from mazebench.tasks.spec import TaskSpec

_DEFAULT_SIZE = 13

# Mazes of one's own: one or several, or the path of a file or of a folder.
Maps = str | pathlib.Path | Maze | Iterable[Maze]


def make_spec(
    task: str = "local", size: int | None = None, split: str = "train", *, maps: Maps | None = None, **options: Any
) -> TaskSpec:
    """Returns a navigation task.

    Args:
      task: "local" or "hierarchical".
      size: N, the cells on a side of the benchmark's mazes; see `load_mazes_of`.
      split: "train" or "eval" mazes of benchmark v1.
      maps: mazes of your own instead.
      **options: those of `mazebench.tasks.options.TaskOptions`, which docs/options.md lists; None stands for the
        default.

    Raises:
      InputError: if an option is unknown or not allowed, or a map can't be read.
    """
    known = options_of(TaskOptions)
    for name in options:
        if name not in known:
            raise unknown("option", name, known)
    given = {name: value for name, value in options.items() if value is not None}
    if split == "eval" and maps is None:
        given.setdefault("distances", EVAL_DISTANCES)
    return TaskSpec(task=task, mazes=load_mazes_of(size, split, maps), **given)


def load_mazes_of(size: int | None = None, split: str = "train", maps: Maps | None = None) -> tuple[Maze, ...]:
    """Returns the mazes of a task.

    Args:
      size: N, the cells on a side of benchmark v1's mazes: 13 (the default), 15, 17, 19 or 21; with `maps`, a size that
        they must have.
      split: "train" or "eval" mazes of benchmark v1; without effect with `maps`.
      maps: mazes of your own instead: a `Maze`, several of one size, or a text or image file or a folder of them.

    Raises:
      InputError: if there are no such mazes, or a map can't be read.
    """
    if maps is None:
        return load_mazes(_DEFAULT_SIZE if size is None else size, split)
    if isinstance(maps, Maze):
        mazes: tuple[Maze, ...] = (maps,)
    else:
        mazes = read_mazes(maps) if isinstance(maps, (str, pathlib.Path)) else tuple(maps)
    for maze in mazes:
        if size not in (None, maze.size):
            raise InputError(f"expected mazes of size {size}, found size {maze.size}")
    return mazes


def load(
    task: str = "local", size: int | None = None, split: str = "train", seed: int | None = None, **options: Any
) -> Environment:
    """Returns a dm_control environment of a navigation task; `options` are those of `make_spec`.

    Its first episode is the one of `reset(seed=seed)`. `env.physics` and `env.task` are a
    `mazebench.world.physics.Physics` and a `mazebench.tasks.navigation.Navigation`.
    """
    return Environment(make_spec(task, size, split, **options), seed)
