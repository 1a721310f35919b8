"""The body in a maze: placing it, driving it and reading its state, on MuJoCo's own bindings."""

from __future__ import annotations

import abc
import copy
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np

from mazebench.world.angles import wrap_angle
from mazebench.world.near_walls import NearWalls, WallGeoms
from mazebench.world.profiler import stop_profiler

FULL_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)  # all that MuJoCo's next step depends on


class Simulation(abc.ABC):
    """One maze and the body in it, as a task places and reads them.

    `model` and `data` are MuJoCo's, or dm_control's wrappers, which have the same arrays.
    """

    model: Any
    data: Any

    @abc.abstractmethod
    def surround(self, maze: int, cell: int) -> None:
        """Makes the walls around the body those of a cell (row * N + column) of maze number `maze`."""

    def place_agent(self, position: np.ndarray, yaw: float) -> None:
        """Moves the body to `position` (`[2]`, m) and `yaw` (rad); call it within `reset_context()`."""
        self.data.qpos[:] = (*position, yaw)

    def place_goal(self, position: np.ndarray) -> None:
        """Moves the goal marker to `position` (`[2]`, m)."""
        self.data.mocap_pos[0] = (*position, 0.0)

    def set_controls(self, controls: np.ndarray) -> None:
        """Sets the controls `[C]`; see `Body.action_controls`."""
        self.data.ctrl[:] = controls

    def position(self) -> np.ndarray:
        """Returns the body's centre (x, y) in metres: `[2]` float."""
        return self.data.qpos[:2].copy()

    def yaw(self) -> float:
        """Returns the body's heading in [-pi, pi) rad, counter-clockwise from +x."""
        return wrap_angle(float(self.data.qpos[2]))

    @abc.abstractmethod
    def full_state(self) -> np.ndarray:
        """Returns all that the simulation's future depends on, except the maze: `[S]` float64, MuJoCo's own vector."""

    @abc.abstractmethod
    def set_full_state(self, state: np.ndarray) -> None:
        """Goes back to what `full_state` returned, exactly, in the same maze."""


class MujocoSimulation(Simulation):
    """A simulation on MuJoCo's bindings and nothing else."""

    def __init__(self, model: mujoco.MjModel, walls: NearWalls | None = None):
        """Copies `model` and puts the body into the maze's first free cell.

        With `walls`, whose model it then is, `surround` chooses the walls.
        """
        stop_profiler()
        self.model = copy.copy(model)
        self.data = mujoco.MjData(self.model)
        self._walls, self._geoms = walls, WallGeoms.of_model(self.model)
        self._around = (-1, -1)  # maze and cell that the walls are around
        with self.reset_context():
            self.data.qpos[:] = model.key_qpos[0]

    def __reduce__(self) -> tuple[Any, ...]:
        return _resumed, (self.model, self._walls, self.full_state())

    def surround(self, maze: int, cell: int) -> None:
        if self._walls is not None and (maze, cell) != self._around:
            self._walls.write(self._geoms, np.array([0]), np.array([maze]), np.array([cell]))
            self._around = maze, cell

    @contextmanager
    def reset_context(self) -> Iterator[None]:
        """Resets the simulation, lets its user place the body, and computes what follows from that."""
        mujoco.mj_resetData(self.model, self.data)
        yield
        mujoco.mj_step1(self.model, self.data)

    def step(self, num_steps: int) -> None:
        """Takes physics steps; afterwards, what follows from positions and velocities is current.

        Each step's second half comes first, as in dm_control: the first half was computed when the controls were set.
        """
        mujoco.mj_step2(self.model, self.data)
        mujoco.mj_step(self.model, self.data, num_steps - 1)
        mujoco.mj_step1(self.model, self.data)

    def full_state(self) -> np.ndarray:
        state = np.empty(mujoco.mj_stateSize(self.model, FULL_STATE))
        mujoco.mj_getState(self.model, self.data, state, FULL_STATE)
        return state

    def set_full_state(self, state: np.ndarray) -> None:
        mujoco.mj_setState(self.model, self.data, state, FULL_STATE)
        mujoco.mj_step1(self.model, self.data)


def _resumed(model: mujoco.MjModel, walls: NearWalls | None, state: np.ndarray) -> MujocoSimulation:
    """Returns a simulation of `model` that goes on from a full state."""
    simulation = MujocoSimulation(model, walls)
    simulation.set_full_state(state)
    return simulation
