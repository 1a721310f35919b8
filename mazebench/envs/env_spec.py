"""Gymnasium's `spec` of an environment in a form that JSON can hold."""

from __future__ import annotations

import dataclasses
import os
from enum import Enum
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec

from mazebench.constants import BENCHMARK_SIZES, TASK_VERSION
from mazebench.tasks.task import Task


class JsonSpec:
    """Base class of environments whose `spec.to_json()` describes them, mazes of one's own included.

    It has no `max_episode_steps`, for which Gymnasium would put a `TimeLimit` around what is made of it.
    """

    task: Task
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
            for name in ("mazes", "shown"):
                if not isinstance(kwargs.get(name), str | None):  # else a path, or none
                    kwargs[name] = self.task.options.to_json()[name]
            spec = dataclasses.replace(spec, kwargs=kwargs)
        self._spec = spec


def env_spec_of(task: Task) -> EnvSpec:
    """Returns Gymnasium's spec of the environment of a task, in plain values."""
    name = task.options.task.title() + (f"-{BENCHMARK_SIZES[0]}" if task.options.track is None else "")
    spec = gymnasium.spec(f"mazebench/{name}-v{TASK_VERSION}")
    return dataclasses.replace(spec, kwargs=task.options.to_json())


def _plain(value: Any) -> Any:
    """Returns NumPy's numbers and arrays, ranges, paths and members of enumerations as JSON can hold them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, list | tuple | range):
        return [_plain(item) for item in value]
    return value.value if isinstance(value, Enum) else value
