"""Angles."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np

_Angle = TypeVar("_Angle", float, np.ndarray)


def wrap_angle(angle: _Angle) -> _Angle:
    """Returns the same angle in [-pi, pi], in rad; of an array, each of its angles."""
    return (angle + math.pi) % (2 * math.pi) - math.pi
