"""A body: its shape and speeds, how actions become controls, its MJCF, and what its sensors tell of its state."""

from __future__ import annotations

import abc
import dataclasses
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from mazebench.constants import PHYSICS_TIMESTEP, STATE_SIZE, STEP_TIME
from mazebench.world.angles import wrap_angle
from mazebench.world.looks import Camera

if TYPE_CHECKING:
    import mujoco

# Metres before a wall at which contacts act, so that no body ever sinks in. The margins of two geoms add up, so bodies
# have none.
CONTACT_MARGIN = 0.03
# Of contacts of bodies and walls: as stiff as the timestep allows, and overdamped: with a damping ratio of 1 up to 18 %
# of the speed rebounds.
CONTACT_SOLREF = (2 * PHYSICS_TIMESTEP, 3.0)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Body(abc.ABC):
    """A body that moves along x and y and yaws; its height, roll and pitch are fixed.

    Its joints are x, y and yaw, in this order: `qpos` is its pose.
    """

    strafes: ClassVar[bool]  # whether it can move sideways

    name: str
    radius: float  # m
    height: float  # m
    mass: float  # kg
    yaw_inertia: float  # kg m^2
    top_speed: float  # m/s, of a drive
    fastest: float  # m/s, which it never exceeds, whatever its actions are
    turn_step: float  # rad, which it turns in an agent step
    # Where sensors are: the camera above the floor and ahead of the centre, the lidar ahead of the centre.
    camera_height: float = Camera().height  # m
    camera_offset: float = Camera().offset  # m
    lidar_offset: float = 0.0  # m

    @property
    def turn_rate(self) -> float:
        """The yaw rate of a turn, in rad/s."""
        return self.turn_step / STEP_TIME

    @property
    def reach(self) -> float:
        """The metres from its centre at which walls begin to push."""
        return self.radius + CONTACT_MARGIN

    @property
    def joint_damping(self) -> float:
        """The damping of the joints x and y, in N s/m."""
        return 0.0

    @abc.abstractmethod
    def rest_time(self, speed: float) -> float:
        """Returns the seconds for which a speed (m/s) leads as far as the body gets when it is let go or stopped."""

    def rest_turn(self, rate: float) -> float:
        """Returns the rad that the body turns on at a yaw rate (rad/s) when its turn is stopped."""
        return 0.0

    @property
    @abc.abstractmethod
    def quarter_turn_steps(self) -> int:
        """The agent steps of a quarter turn, from rest to rest."""

    # How actions become controls.

    @abc.abstractmethod
    def action_controls(self) -> np.ndarray:
        """Returns the controls for each of `ACTIONS`: `[6, C]` float."""

    @abc.abstractmethod
    def velocity_controls(self, velocities: np.ndarray) -> np.ndarray:
        """Returns the controls that drive the body at `[..., 3]` velocities: `[..., C]` float.

        A velocity is (forward, left, turn to the left) in the body's frame, each in [-1, 1]: forward and left in shares
        of the top speed, the turn in shares of the turn rate.
        """

    # Its state.

    def states(self, sensors: np.ndarray) -> np.ndarray:
        """Returns `[..., 12]` float64 states from `[..., 10]` values of its sensors (see `_add_sensors`).

        A state is, in this order: position x, y, z (m); orientation roll, pitch, yaw (rad, yaw in [-pi, pi)); linear
        velocity forward, left, up in the body's frame (m/s); angular velocity about the body's x, y, z (rad/s).
        """
        states = np.zeros((*sensors.shape[:-1], STATE_SIZE))
        states[..., 0:3] = sensors[..., 0:3]
        states[..., 5] = wrap_angle(sensors[..., 3])
        states[..., 6:12] = sensors[..., 4:10]
        return states

    def state(self, sensors: np.ndarray) -> np.ndarray:
        """Returns one of the `states`, with plain numbers, which take half the time."""
        x, y, z, yaw, *velocities = sensors.tolist()
        return np.array([x, y, z, 0.0, 0.0, wrap_angle(yaw), *velocities])

    # Its MJCF.

    def add_to(self, spec: mujoco.MjSpec, behind: float) -> None:
        """Adds the body with its actuators, its sensors and the cameras on it, one of which is `behind` (m) it."""
        import mujoco  # which tasks and agents do without

        # The joints measure from the world's origin.
        body = spec.worldbody.add_body(name="agent", pos=[0, 0, self.height / 2])
        damping = [self.joint_damping, 0, 0]
        body.add_joint(name="x", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0], damping=damping)
        body.add_joint(name="y", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 1, 0], damping=damping)
        body.add_joint(name="yaw", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
        body.mass = self.mass
        body.inertia = [self.yaw_inertia] * 3
        body.ipos = [0, 0, 0]
        body.explicitinertial = True

        self._add_shape(body)
        body.add_site(name="agent", pos=[0, 0, 0], size=[0.01, 0.01, 0.01], group=4)

        # The camera looks along the body's x axis: its right is -y, its up is z. The nose is below its view.
        eye = [self.camera_offset, 0, self.camera_height - self.height / 2]
        body.add_camera(name="egocentric", pos=eye, xyaxes=[0, -1, 0, 0, 0, 1], fovy=Camera().fov)
        # Nearer to the body, it looks down more steeply.
        pos, down = [-1.6 * behind, 0, 2.2], 0.66 * behind
        body.add_camera(name="chase", pos=pos, xyaxes=[0, -1, 0, 0.75, 0, down], fovy=60)

        self._add_actuators(spec)
        self._add_sensors(spec)

    @abc.abstractmethod
    def _add_shape(self, body: Any) -> None:
        """Adds one geom, by which it touches walls, and what is only seen."""

    @abc.abstractmethod
    def _add_actuators(self, spec: mujoco.MjSpec) -> None:
        """Adds one actuator for each control."""

    def _add_sensors(self, spec: mujoco.MjSpec) -> None:
        import mujoco

        kind, site = mujoco.mjtSensor, mujoco.mjtObj.mjOBJ_SITE
        spec.add_sensor(name="position", type=kind.mjSENS_FRAMEPOS, objtype=site, objname="agent")
        spec.add_sensor(name="yaw", type=kind.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname="yaw")
        spec.add_sensor(name="velocity", type=kind.mjSENS_VELOCIMETER, objtype=site, objname="agent")
        spec.add_sensor(name="angular_velocity", type=kind.mjSENS_GYRO, objtype=site, objname="agent")
