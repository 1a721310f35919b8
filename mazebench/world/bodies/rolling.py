"""A body on two driven wheels, a differential drive: it moves along its heading and turns, and can't strafe."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from mazebench.constants import PHYSICS_TIMESTEP, STEP_TIME
from mazebench.world.bodies.body import CONTACT_SOLREF, Body

if TYPE_CHECKING:
    import mujoco

# The columns of controls, in the order in which `_add_actuators` adds them; the grip's is always 0.
_NUM_CONTROLS = 3
_DRIVE, _GRIP, _TURN = range(_NUM_CONTROLS)  # m/s, 0, rad/s

# Of what velocity and yaw rate are off: where the most force is not needed, a physics step leaves half of it, so that
# neither overshoots.
FOLLOWING = 1 / PHYSICS_TIMESTEP  # 1/s
# Of the velocity across the wheels: a step leaves 1/11 of it. A body that turns at the rate w and drives at v slips by
# w v times 1.1 physics steps, since a step turns it after its velocity.
GRIP = 10 / PHYSICS_TIMESTEP  # 1/s

ARC = 0.5  # of the turn rate, with which the body turns while it drives an arc
# The six actions as velocities: forward in shares of the top speed, turn in shares of the turn rate. What strafes for
# other bodies is an arc for this one.
SHARES = np.array([(1, 0), (-1, 0), (1, ARC), (1, -ARC), (0, 1), (0, -1)], np.float64)  # [6, 2]


@dataclasses.dataclass(frozen=True, kw_only=True)
class RollingBody(Body):
    """A body on two driven wheels.

    Its velocity along its heading and its yaw rate follow what is commanded, each by at most its acceleration. Its
    wheels grip: across them, its velocity is damped within a physics step.
    """

    strafes: ClassVar[bool] = False

    acceleration: float  # m/s^2, of starting and of braking
    turn_acceleration: float  # rad/s^2
    yaw_inertia: float = dataclasses.field(init=False)  # of a disc
    fastest: float = dataclasses.field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "yaw_inertia", self.mass * self.radius**2 / 2)
        object.__setattr__(self, "fastest", 1.02 * self.top_speed)  # with what it slips

    def rest_time(self, speed: float) -> float:
        """Returns the seconds for which a speed (m/s) leads as far as the body gets while it brakes."""
        return speed / (2 * self.acceleration)

    def rest_turn(self, rate: float) -> float:
        """Returns the rad that the body turns while it brakes from a yaw rate (rad/s)."""
        return rate * abs(rate) / (2 * self.turn_acceleration)

    @property
    def quarter_turn_steps(self) -> int:
        """The agent steps of a quarter turn, from rest to rest."""
        rate, acceleration, angle = self.turn_rate, self.turn_acceleration, math.pi / 2
        if angle < rate**2 / acceleration:  # it brakes before it turns at its turn rate
            return math.ceil(2 * math.sqrt(angle / acceleration) / STEP_TIME)
        return math.ceil((angle / rate + rate / acceleration) / STEP_TIME)

    def action_controls(self) -> np.ndarray:
        """Returns those of `SHARES`."""
        return self.velocity_controls(np.insert(SHARES, 1, 0.0, axis=-1))

    def velocity_controls(self, velocities: np.ndarray) -> np.ndarray:
        """Returns the controls of velocities, see `Body`; they have no part to the left."""
        controls = np.zeros((*velocities.shape[:-1], _NUM_CONTROLS))
        controls[..., _DRIVE] = self.top_speed * velocities[..., 0]
        controls[..., _TURN] = self.turn_rate * velocities[..., 2]
        return controls

    def _add_shape(self, body: Any) -> None:
        import mujoco  # which tasks and agents do without

        # What touches walls is not drawn: one capsule, also of a body that is wider than high.
        body.add_geom(
            name="agent",
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            size=[self.radius, max(self.height / 2 - self.radius, 0.01), 0],
            group=3,
            condim=1,
            solref=CONTACT_SOLREF,
        )
        # A base between two wheels, a mast, and a lidar on it; a nose says where ahead is.
        radius, half = self.radius, self.height / 2
        wheel = min(0.33 * radius, half)
        cylinder, box = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_BOX
        base = min(0.5 * half, 0.7 * radius)
        body.add_site(
            name="base", type=cylinder, size=[0.95 * radius, base, 0], pos=[0, 0, base + wheel / 2 - half],
            material="agent",
        )  # fmt: skip
        top = 2 * base + wheel / 2 - half
        body.add_site(
            name="mast", type=cylinder, size=[0.4 * radius, (0.85 * half - top) / 2, 0],
            pos=[0, 0, (top + 0.85 * half) / 2], material="agent",
        )  # fmt: skip
        lidar = {"size": [0.3 * radius, 0.075 * half, 0], "pos": [0, 0, 0.925 * half]}
        body.add_site(name="lidar", type=cylinder, **lidar, material="nose")
        for name, side in (("left_wheel", 1), ("right_wheel", -1)):
            body.add_site(
                name=name, type=cylinder, size=[wheel, 0.08 * radius, 0],
                pos=[0, side * 0.9 * radius, wheel - half], quat=[math.sqrt(0.5), math.sqrt(0.5), 0, 0],
                material="nose",
            )  # fmt: skip
        nose = {"size": [0.15 * radius, 0.3 * radius, 0.3 * base], "pos": [0.85 * radius, 0, top - 0.5 * base]}
        body.add_site(name="nose", type=box, **nose, material="nose")

    def _add_actuators(self, spec: mujoco.MjSpec) -> None:
        import mujoco

        # The grip damps one direction of the plane only, which couples the joints: implicitfast would neglect that.
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICIT
        site = {"trntype": mujoco.mjtTrn.mjTRN_SITE, "target": "agent", "refsite": ""}
        force, torque = self.mass * self.acceleration, self.yaw_inertia * self.turn_acceleration
        drive = spec.add_actuator(
            name="drive", **site, gear=[1, 0, 0, 0, 0, 0], forcelimited=True, forcerange=[-force, force],
            ctrllimited=True, ctrlrange=[-self.top_speed, self.top_speed],
        )  # fmt: skip
        drive.set_to_velocity(kv=self.mass * FOLLOWING)
        grip = spec.add_actuator(name="grip", **site, gear=[0, 1, 0, 0, 0, 0])
        grip.set_to_velocity(kv=self.mass * GRIP)
        turn = spec.add_actuator(
            name="turn", trntype=mujoco.mjtTrn.mjTRN_JOINT, target="yaw", forcelimited=True,
            forcerange=[-torque, torque], ctrllimited=True, ctrlrange=[-self.turn_rate, self.turn_rate],
        )  # fmt: skip
        turn.set_to_velocity(kv=self.yaw_inertia * FOLLOWING)
