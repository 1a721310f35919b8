"""The observations of agents: their specs, the errors of observed states, and the open sensors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from dm_env import specs

from mazebench.constants import STATE_SIZE
from mazebench.tasks.context import NUM_PLANES
from mazebench.tasks.episode import Episode, perturbations_of
from mazebench.tasks.perturbations.perturbation import Of, StateError
from mazebench.tasks.sensors import SENSORS
from mazebench.tasks.sensors.sensor import Sensor, Worlds
from mazebench.tasks.task import Task

Noise = tuple[np.random.Generator | None, ...]  # by sensor: of what is drawn in one episode; None if nothing is


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
    errors = (perturbation.observed(rng) for perturbation, rng in perturbations_of(task, episode, Of.SENSES))
    return [error for error in errors if error is not None]


class OpenSensors:
    """The sensors of a task, opened for one environment."""

    def __init__(self, task: Task):
        self._task = task
        names: dict[type[Sensor[Any]], list[str]] = {}
        for name in task.options.sensors:
            names.setdefault(SENSORS[name], []).append(name)
        self._sensors = [kind(tuple(of_kind), task.options, task.standing) for kind, of_kind in names.items()]

    def __reduce__(self) -> tuple[Any, ...]:
        """Makes copies open sensors of their own."""
        return OpenSensors, (self._task,)

    def begin(self, episode: Episode | None) -> Noise:
        """Returns the generators of the sensors' noise in an episode that begins; without one, nothing is drawn."""
        return tuple(
            None if episode is None or sensor.stream is None else episode.stream(sensor.stream)
            for sensor in self._sensors
        )

    def read(
        self, maze: np.ndarray, pose: np.ndarray, marker: np.ndarray, noise: Sequence[Noise], num_threads: int
    ) -> dict[str, np.ndarray]:
        """Returns `[K, ...]` by the sensor's name, for K >= 1 worlds as in `Worlds`; `noise` is of their episodes."""
        observed: dict[str, np.ndarray] = {}
        for sensor, rngs in zip(self._sensors, zip(*noise, strict=True), strict=True):
            observed |= sensor.read(Worlds(maze, pose, marker, rngs, num_threads))
        return observed
