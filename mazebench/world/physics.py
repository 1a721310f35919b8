"""The dm_control Physics of a maze: measurements of the agent's body by name, and exchange of the maze."""

from __future__ import annotations

import copy
import warnings

import mujoco
import numpy as np

with warnings.catch_warnings():
    # dm_control tries every rendering backend when imported, and GLFW warns if there is no display.
    warnings.filterwarnings("ignore", message=".*GLFWError.*|.*DISPLAY.*")
    from dm_control.mujoco import engine, wrapper

from mazebench.world.angles import wrap_angle
from mazebench.world.mjcf import NUM_SENSORS
from mazebench.world.models import copy_maze

STATE_SIZE = 12
_FULL_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


class Physics(engine.Physics):
    """One maze and the body in it; `load_maze` exchanges the maze but keeps MjData and rendering context."""

    @classmethod
    def of_maze(cls, model: mujoco.MjModel) -> Physics:
        """Returns a simulation of a copy of `model`, with the body in the maze's first free cell."""
        physics = cls.from_model(wrapper.MjModel(copy.copy(model)))
        with physics.reset_context():
            physics.data.qpos[:] = physics.model.key_qpos[0]
        return physics

    def after_reset(self) -> None:
        """Computes what follows from positions and velocities, after a reset and in a new copy."""
        super().after_reset()
        self._update()  # dm_control leaves the actuators' velocities at 0, which is wrong in a copy of a moving body

    def load_maze(self, model: mujoco.MjModel) -> None:
        """Changes to the maze of `model`, which must come from the same `MazeModels`."""
        copy_maze(model, self.model.ptr)

    def place_agent(self, position: np.ndarray, yaw: float) -> None:
        """Moves the body to `position` (`[2]`, m) and `yaw` (rad); call it within `reset_context()`."""
        self.data.qpos[:] = (*position, yaw)

    def place_goal(self, position: np.ndarray) -> None:
        """Moves the goal marker to `position` (`[2]`, m)."""
        self.data.mocap_pos[0] = (*position, 0.0)

    def set_controls(self, controls: np.ndarray) -> None:
        """Sets the controls (`[5]`) of the four drives and the turn; see `mjcf.action_controls`."""
        self.data.ctrl[:] = controls

    def position(self) -> np.ndarray:
        """Returns the body's centre (x, y) in metres: `[2]` float."""
        return self.data.qpos[:2].copy()

    def yaw(self) -> float:
        """Returns the body's heading in [-pi, pi) rad, counter-clockwise from +x."""
        return float(wrap_angle(self.data.qpos[2]))

    def speed(self) -> float:
        """Returns the body's speed in the plane in m/s."""
        return float(np.hypot(self.data.qvel[0], self.data.qvel[1]))

    def full_state(self) -> np.ndarray:
        """Returns all that the simulation's future depends on, except the maze: `[S]` float64, MuJoCo's own vector."""
        return self.get_state(_FULL_STATE)

    def set_full_state(self, state: np.ndarray) -> None:
        """Goes back to what `full_state` returned, exactly, in the same maze."""
        self.set_state(state, _FULL_STATE)
        self._update()

    def _update(self) -> None:
        """Computes what follows from positions and velocities, as dm_control does at the end of a step."""
        mujoco.mj_step1(self.model.ptr, self.data.ptr)

    def state(self) -> np.ndarray:
        """Returns the state, `[12]` float64; see `states_from_sensors`."""
        return states_from_sensors(self.data.sensordata)


def states_from_sensors(sensors: np.ndarray) -> np.ndarray:
    """Returns `[..., 12]` float64 states from `[..., 10]` sensor values.

    A state is, in this order: position x, y, z (m); orientation roll, pitch, yaw (rad, yaw in [-pi, pi)); linear
    velocity forward, left, up in the body's frame (m/s); angular velocity about the body's x, y, z (rad/s).
    """
    states = np.zeros((*sensors.shape[:-1], STATE_SIZE))
    states[..., :3] = sensors[..., :3]
    states[..., 5] = wrap_angle(sensors[..., 3])
    states[..., 6:] = sensors[..., 4:NUM_SENSORS]
    return states
