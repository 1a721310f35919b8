"""A body: its shape and speeds, how actions become controls, its MJCF, and what its sensors tell of its state."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from mazebench.constants import ACTIONS, PHYSICS_TIMESTEP, STATE_SIZE, STEP_TIME
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

# The columns of controls, in the order in which `_add_actuators` adds them: four drives and the turn.
_NUM_CONTROLS = 5
_FORWARD, _BACKWARD, _LEFT, _RIGHT, _TURN = range(_NUM_CONTROLS)

_NOSE_OF = 0.15  # m, the radius of a body whose nose is as large as `add_to` says


@dataclasses.dataclass(frozen=True, kw_only=True)
class Body:
    """A body that slides along x and y and yaws; its height, roll and pitch are fixed.

    A drive that is on pulls it in one direction with the force `drive_gain` * (speed - v), at most `drive_force`,
    against linear damping; the two balance at the top speed. A turn holds a yaw rate.

    Its joints are x, y and yaw, in this order: `qpos` is its pose. A body with other drives overrides the methods.
    """

    name: str
    radius: float  # m
    height: float  # m
    mass: float  # kg
    yaw_inertia: float  # kg m^2
    top_speed: float  # m/s, of a drive
    fastest: float  # m/s, which it never exceeds, whatever its actions are
    turn_step: float  # rad, which it turns in an agent step
    damping: float  # N s/m
    drive_gain: float  # N s/m
    drive_force: float  # N
    yaw_gain: float  # N m s/rad

    @property
    def turn_rate(self) -> float:
        """The yaw rate of a turn, in rad/s."""
        return self.turn_step / STEP_TIME

    @property
    def drive_speed(self) -> float:
        """The speed (m/s) at which a drive pulls no more, above the top speed, at which damping balances it."""
        return self.top_speed * (1 + self.damping / self.drive_gain)

    @property
    def coasting_time(self) -> float:
        """The seconds after which a body that is let go at speed v comes to rest: it moves on by v times as much."""
        return self.mass / self.damping

    @property
    def reach(self) -> float:
        """The metres from its centre at which walls begin to push."""
        return self.radius + CONTACT_MARGIN

    # How actions become controls.

    def action_controls(self) -> np.ndarray:
        """Returns the controls for each of `ACTIONS`: `[6, C]` float."""
        controls = np.zeros((len(ACTIONS), _NUM_CONTROLS))
        for drive in (_FORWARD, _BACKWARD, _LEFT, _RIGHT):
            controls[drive, drive] = 1.0
        controls[ACTIONS.index("look_left"), _TURN] = self.turn_rate
        controls[ACTIONS.index("look_right"), _TURN] = -self.turn_rate
        return controls

    def velocity_controls(self, velocities: np.ndarray) -> np.ndarray:
        """Returns the controls that drive the body at `[..., 3]` velocities: `[..., C]` float.

        A velocity is (forward, left, turn to the left) in the body's frame, each in [-1, 1]: forward and left in shares
        of the top speed, the turn in shares of the turn rate. If forward and left together exceed the top speed, they
        are shortened to it. With one of the three at 1 or -1 and the others at 0, the controls are those of an action.
        With all at 0 the body coasts.
        """
        forward, left, turn = np.moveaxis(velocities, -1, 0)
        excess = np.maximum(1.0, np.hypot(forward, left))
        controls = np.zeros((*velocities.shape[:-1], _NUM_CONTROLS))
        for ahead, back, share in ((_FORWARD, _BACKWARD, forward / excess), (_LEFT, _RIGHT, left / excess)):
            # The control under which drive and damping balance at `share * top_speed`.
            control = self.damping * np.abs(share) / (self.drive_gain * (1 - np.abs(share)) + self.damping)
            controls[..., ahead] = np.where(share > 0, control, 0.0)
            controls[..., back] = np.where(share < 0, control, 0.0)
        controls[..., _TURN] = self.turn_rate * turn
        return controls

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
        damping = [self.damping, 0, 0]
        body.add_joint(name="x", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0], damping=damping)
        body.add_joint(name="y", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 1, 0], damping=damping)
        body.add_joint(name="yaw", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
        body.mass = self.mass
        body.inertia = [self.yaw_inertia] * 3
        body.ipos = [0, 0, 0]
        body.explicitinertial = True

        body.add_geom(
            name="agent",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[self.radius, self.height / 2 - self.radius, 0],
            material="agent",
            condim=1,
            solref=CONTACT_SOLREF,
        )
        wide = self.radius / _NOSE_OF
        nose = {"pos": [0.11 * wide, 0, 0.02], "size": [0.06 * wide, 0.09 * wide, 0.05]}
        body.add_site(name="nose", type=mujoco.mjtGeom.mjGEOM_BOX, **nose, material="nose")
        body.add_site(name="agent", pos=[0, 0, 0], size=[0.01, 0.01, 0.01], group=4)

        # The camera looks along the body's x axis: its right is -y, its up is z. The nose is below its view.
        camera = Camera()
        eye = [camera.offset, 0, camera.height - self.height / 2]
        body.add_camera(name="egocentric", pos=eye, xyaxes=[0, -1, 0, 0, 0, 1], fovy=camera.fov)
        # Nearer to the body, it looks down more steeply.
        pos, down = [-1.6 * behind, 0, 2.2], 0.66 * behind
        body.add_camera(name="chase", pos=pos, xyaxes=[0, -1, 0, 0.75, 0, down], fovy=60)

        self._add_actuators(spec)
        self._add_sensors(spec)

    def _add_actuators(self, spec: mujoco.MjSpec) -> None:
        import mujoco

        directions = ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0])
        for name, direction in zip(ACTIONS[:4], directions, strict=True):
            spec.add_actuator(
                name=name,
                trntype=mujoco.mjtTrn.mjTRN_SITE,
                target="agent",
                refsite="",
                gear=[*direction, 0, 0, 0],
                gaintype=mujoco.mjtGain.mjGAIN_AFFINE,
                gainprm=[self.drive_gain * self.drive_speed, 0, -self.drive_gain] + [0] * 7,
                ctrllimited=True,
                ctrlrange=[0, 1],
                forcelimited=True,
                forcerange=[0, self.drive_force],
            )
        turn = spec.add_actuator(
            name="turn",
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target="yaw",
            ctrllimited=True,
            ctrlrange=[-self.turn_rate, self.turn_rate],
        )
        turn.set_to_velocity(kv=self.yaw_gain)

    def _add_sensors(self, spec: mujoco.MjSpec) -> None:
        import mujoco

        kind, site = mujoco.mjtSensor, mujoco.mjtObj.mjOBJ_SITE
        spec.add_sensor(name="position", type=kind.mjSENS_FRAMEPOS, objtype=site, objname="agent")
        spec.add_sensor(name="yaw", type=kind.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname="yaw")
        spec.add_sensor(name="velocity", type=kind.mjSENS_VELOCIMETER, objtype=site, objname="agent")
        spec.add_sensor(name="angular_velocity", type=kind.mjSENS_GYRO, objtype=site, objname="agent")
