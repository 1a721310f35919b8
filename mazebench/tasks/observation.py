"""The observations of agents: their specs, the errors of observed states, and the open sensors."""

from __future__ import annotations

from typing import Any

import numpy as np
from dm_env import specs

from mazebench.constants import STATE_SIZE
from mazebench.tasks.context import NUM_PLANES
from mazebench.tasks.episode import Episode, episode_level, perturbations_of
from mazebench.tasks.perturbations.odometry import NoisyMotion
from mazebench.tasks.perturbations.perturbation import StateError
from mazebench.tasks.sensors import SENSORS
from mazebench.tasks.sensors.sensor import Sensor, Worlds
from mazebench.tasks.streams import Stream
from mazebench.tasks.task import Task


def observation_specs(task: Task) -> dict[str, specs.Array]:
    """Returns shape, type and range of each observation by name: the state, the context, and that of each sensor."""
    size = task.context_size
    return {
        "state": specs.Array((STATE_SIZE,), np.float32, name="state"),
        "context": specs.BoundedArray((NUM_PLANES, size, size), np.float32, 0.0, 1.0, name="context"),
        **{name: SENSORS[name].observation_spec(name, task.options) for name in task.options.sensors},
    }


def state_errors(task: Task, episode: Episode) -> list[StateError]:
    """Returns what is wrong with the states observed in `episode`; each has a random stream of its own."""
    if task.options.exact_pose:
        return []
    errors = [perturbation.state_error(rng) for perturbation, rng in perturbations_of(task, episode)]
    alpha = task.odometry_noise_at(episode_level(task, episode))
    noise = NoisyMotion(alpha, episode.stream(Stream.MOTION_NOISE)) if alpha else None
    return [error for error in (noise, *errors) if error is not None]


class OpenSensors:
    """The sensors of a task, opened for one environment."""

    def __init__(self, task: Task):
        self._task = task
        names: dict[type[Sensor], list[str]] = {}
        for name in task.options.sensors:
            names.setdefault(SENSORS[name], []).append(name)
        self._sensors = [kind(tuple(of_kind), task.options, task.mazes) for kind, of_kind in names.items()]

    def __reduce__(self) -> tuple[Any, ...]:
        """Makes copies open sensors of their own."""
        return OpenSensors, (self._task,)

    def read(self, worlds: Worlds) -> dict[str, np.ndarray]:
        """Returns `[K, ...]` by the sensor's name, for K >= 1 worlds."""
        return {name: values for sensor in self._sensors for name, values in sensor.read(worlds).items()}
