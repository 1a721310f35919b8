"""Gymnasium's `spec` of an environment in a form that JSON can hold."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from enum import Enum
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec

from mazebench.errors import InputError
from mazebench.maps.maze import Maze
from mazebench.maps.text import format_maze, parse_maze
from mazebench.tasks.spec import TaskSpec


class JsonSpec:
    """Base class of environments whose `spec.to_json()` describes them, mazes of one's own included."""

    task_spec: TaskSpec
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's spec of the environment in plain values; None if Gymnasium did not make it."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        """Takes over `spec` in plain values."""
        if spec is not None:
            kwargs = {name: _plain(value) for name, value in spec.kwargs.items()}
            if not isinstance(kwargs.get("mazes"), str | None):  # else a path, or none
                kwargs["mazes"] = [_describe(maze) for maze in self.task_spec.fixed_mazes]
            spec = dataclasses.replace(spec, kwargs=kwargs)
        self._spec = spec


def with_mazes(options: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the options of an environment, with the mazes that a `JsonSpec` describes in place of the descriptions.

    Raises:
      InputError: if a description is none of a `JsonSpec`, or of no legal maze.
    """
    mazes = options.get("mazes")
    if not (isinstance(mazes, list) and mazes and all(isinstance(described, dict) for described in mazes)):
        return dict(options)
    return {**options, "mazes": [_maze(described) for described in mazes]}


def _describe(maze: Maze) -> dict[str, Any]:
    return {"name": maze.name, "rows": format_maze(maze).splitlines(), "cell_size": maze.cell_size}


def _maze(described: dict[str, Any]) -> Maze:
    if described.keys() != {"name", "rows", "cell_size"}:
        raise InputError(f"expected a maze with name, rows and cell_size, found {', '.join(map(str, described))}")
    maze = parse_maze("\n".join(described["rows"]), described["name"])
    return dataclasses.replace(maze, cell_size=described["cell_size"])


def _plain(value: Any) -> Any:
    """Returns NumPy's numbers and arrays, ranges, paths and members of enumerations as JSON can hold them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, list | tuple | range):
        return [_plain(item) for item in value]
    return value.value if isinstance(value, Enum) else value
