"""Perturbations of the map, of the building and of the senses: a file each, and the table of those that are options."""

from __future__ import annotations

from collections.abc import Callable

from mazebench.tasks.perturbations.flip_warp_noise import PERTURBATIONS
from mazebench.tasks.perturbations.odometry import MotionNoise
from mazebench.tasks.perturbations.perturbation import Perturbation

# By the option that has the strength. They are applied in this order, before those of a track.
OF_OPTION: dict[str, Callable[[float], Perturbation]] = {**PERTURBATIONS, "odometry_noise": MotionNoise}
