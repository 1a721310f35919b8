"""The interface: the part of its environments that an agent may know."""

from __future__ import annotations

import dataclasses

from mazebench.constants import VELOCITIES
from mazebench.errors import UnplayableError
from mazebench.world.bodies import SLIDER, Body
from mazebench.world.looks import Camera
from mazebench.world.ray_casting import LidarModel


@dataclasses.dataclass(frozen=True)
class Interface:
    """The environments that an agent is built for.

    No field names a track or a level, but `odometry_noise` and `context_size` differ between some of them.
    """

    task: str  # "local" or "hierarchical"
    size: int  # N
    context_size: int  # M
    actions: str = "six"  # or "four", "velocity" or "diff": which ones the agent answers with
    sensors: tuple[str, ...] = ()  # whose readings are observed beside the state and the context
    cell_size: float = 1.0  # m, the side of a cell of the mazes
    hidden: tuple[str, ...] = ()  # of "map" and "goal": what the context does not show
    lidar: LidarModel | None = None  # what the sensor lidar measures; None without it
    camera: Camera | None = None  # of the sensors egocentric, depth and labels; None without them
    odometry_noise: float = 0.0  # alpha of `mazebench.tasks.perturbations.odometry.NoisyMotion`
    body: Body = SLIDER  # that is driven

    @property
    def action_shape(self) -> tuple[int, ...]:
        """The shape of an action: () for one of six or four, (3,) or (2,) for velocities."""
        return (len(VELOCITIES[self.actions]),) if self.actions in VELOCITIES else ()

    def require_sensor(self, name: str, agent: str) -> None:
        """Raises `UnplayableError` if there is no sensor called `name`, which `agent` needs."""
        if name not in self.sensors:
            found, both = ", ".join(self.sensors), ",".join((name, *self.sensors))
            raise UnplayableError(
                f"agent {agent!r}: expected the sensor {name}, found {found}; add it: --sensors {both}"
            )
