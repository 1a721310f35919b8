"""The body of the paper's protocol and of the tracks, which moves like DeepMind Lab's.

1 m stands for 100 game units. The numbers are fitted to measurements in DeepMind Lab, which docs/task.md lists.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from mazebench.constants import ACTIONS, SLIDER_RADIUS
from mazebench.world.bodies.body import CONTACT_SOLREF, Body

if TYPE_CHECKING:
    import mujoco

# The columns of controls, in the order in which `_add_actuators` adds them: four drives and the turn.
_NUM_CONTROLS = 5
_FORWARD, _BACKWARD, _LEFT, _RIGHT, _TURN = range(_NUM_CONTROLS)

_NOSE_OF = 0.15  # m, the radius of a body whose nose is as large as `add_to` says


@dataclasses.dataclass(frozen=True, kw_only=True)
class SlidingBody(Body):
    """A body that slides along x and y.

    A drive that is on pulls it in one direction with the force `drive_gain` * (speed - v), at most `drive_force`,
    against linear damping; the two balance at the top speed. A turn holds a yaw rate.
    """

    strafes: ClassVar[bool] = True

    damping: float  # N s/m
    drive_gain: float  # N s/m
    drive_force: float  # N
    yaw_gain: float  # N m s/rad

    @property
    def joint_damping(self) -> float:
        """The damping of its joints, in N s/m."""
        return self.damping

    @property
    def drive_speed(self) -> float:
        """The speed (m/s) at which a drive pulls no more, above the top speed, at which damping balances it."""
        return self.top_speed * (1 + self.damping / self.drive_gain)

    @property
    def coasting_time(self) -> float:
        """The seconds after which a body that is let go at speed v comes to rest: it moves on by v times as much."""
        return self.mass / self.damping

    def rest_time(self, speed: float) -> float:
        """Returns the `coasting_time`, which is the same for all speeds."""
        return self.coasting_time

    @property
    def quarter_turn_steps(self) -> int:
        """The agent steps of a quarter turn, whose rate stands at once."""
        return round(math.pi / 2 / self.turn_step)

    def action_controls(self) -> np.ndarray:
        """Returns four drives and two turns."""
        controls = np.zeros((len(ACTIONS), _NUM_CONTROLS))
        for drive in (_FORWARD, _BACKWARD, _LEFT, _RIGHT):
            controls[drive, drive] = 1.0
        controls[ACTIONS.index("look_left"), _TURN] = self.turn_rate
        controls[ACTIONS.index("look_right"), _TURN] = -self.turn_rate
        return controls

    def velocity_controls(self, velocities: np.ndarray) -> np.ndarray:
        """Returns the controls of velocities, see `Body`.

        If forward and left together exceed the top speed, they are shortened to it. With one of the three at 1 or -1
        and the others at 0, the controls are those of an action. With all at 0 the body coasts.
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

    def _add_shape(self, body: Any) -> None:
        import mujoco  # which tasks and agents do without

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


SLIDER = SlidingBody(
    name="slider",
    radius=SLIDER_RADIUS,  # DeepMind Lab's box is 30 x 30 x 56 units
    height=0.56,
    mass=1.0,
    yaw_inertia=0.02,
    top_speed=3.2,
    # A drive pushes the body to its top speed ahead. While it turns, it is pushed aside, too. Let v be its speed and c
    # the cosine of the angle between push and motion. v grows only while the push along it, c times at most 34 N, is
    # above the damping, 8 v: v < 4.25 c. The push falls below 34 N at v c = 3.06. So v can't grow beyond the v at which
    # both hold, 3.61 m/s. With two drives at once, as velocities set them, it is 3.643 m/s, over all pairs of them and
    # all angles.
    fastest=1.14 * 3.2,
    turn_step=math.radians(21.12),  # in 10 frames, 20 pixels of 0.1056 degrees each
    damping=8.0,
    drive_gain=60.0,
    drive_force=34.0,
    yaw_gain=20.0,  # with the inertia a time constant of 1 ms, well within a frame
)
