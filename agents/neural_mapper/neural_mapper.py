"""The neural planner without senses that are written by hand: a network writes the map of what was seen.

docs/agents/neural_mapper.md describes it.
"""

from __future__ import annotations

import pathlib
from importlib import resources
from typing import ClassVar

import numpy as np

from mazebench.agent import Interface
from mazebench.errors import UnplayableError

from ..neural_planner.neural_planner import NeuralPlanner
from ..robot.moving_body import MovingBody
from ..robot.senses import Senses
from .network import NAME, load

SHIPPED = pathlib.Path(str(resources.files("mazebench_assets") / "checkpoints" / f"{NAME}.safetensors"))


class WrittenSenses(Senses):
    """Takes the observed pose for the pose on the map, and writes what scans tell by a network."""

    num_turns = 1

    def __init__(self, interface: Interface, agent: str):
        """Raises `UnplayableError`, in the name of `agent`, without exact positions, a lidar and cells of 1 m."""
        super().__init__(interface, agent)
        if interface.odometry_noise or interface.cell_size != 1.0 or "lidar" not in interface.sensors:
            raise UnplayableError(
                f"agent {agent!r}: expected the sensor 'lidar', exact positions and cells of 1 m, found "
                f"{', '.join(interface.sensors) or 'no sensor'}, odometry with noise {interface.odometry_noise:g} and "
                f"cells of {interface.cell_size:g} m"
            )
        self._writer = load(SHIPPED)

    def write(self, evidence: np.ndarray, body: MovingBody, ranges: np.ndarray, deviation: float) -> None:
        """Writes what a scan tells, in place."""
        self._writer.write(evidence, body.x, body.y, body.yaw, ranges)


class NeuralMapper(NeuralPlanner):
    """Plans on costs and drives by a policy, both learned, on a map that a network writes from scans."""

    name: ClassVar[str] = "neural-mapper"
    needs_sensors: ClassVar[tuple[str, ...]] = ("lidar",)
    senses_class: ClassVar[type[Senses]] = WrittenSenses
    believes: ClassVar[bool] = True
