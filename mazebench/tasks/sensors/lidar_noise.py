"""Noise on the readings of the lidar: the option that names it, and the one place where it is drawn.

`K` is the number of bodies.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mazebench.errors import InputError
from mazebench.world.ray_casting import NUM_RAYS, TURTLEBOT3, LidarModel

_TURTLEBOT3 = "turtlebot3"


def noise_text(text: object) -> str | None:
    """Returns the text of the option in one form for each meaning: "turtlebot3", or as "0.1,0.05".

    Raises:
      InputError: if it is anything else.
    """
    if text is None or (isinstance(text, str) and text == _TURTLEBOT3):
        return text
    try:
        sigma, lost = map(float, str(text).split(","))
    except ValueError:
        sigma = lost = np.nan
    if not (0 <= sigma <= 1 and 0 <= lost <= 1):
        raise InputError(
            f"expected lidar_noise 'turtlebot3', or SIGMA,LOST from 0 to 1 as '.1,.1', found {str(text)[:80]!r}"
        )
    return f"{sigma:g},{lost:g}"


def model_of(text: str | None) -> LidarModel:
    """Returns what a lidar with the noise of `noise_text` measures; None stands for an exact one."""
    if text == _TURTLEBOT3:
        return TURTLEBOT3
    sigma, lost = map(float, (text or "0,0").split(","))
    return LidarModel(sigma=sigma, lost=lost)


def read(ranges: np.ndarray, model: LidarModel, rngs: Sequence[np.random.Generator | None]) -> np.ndarray:
    """Returns what a lidar reads: `[K, 32]` float32, m.

    A distance gets normal noise, is rounded to a multiple of the step, and is held between the least and the largest
    that can be read. A ray that meets no wall in reach reads the largest, and so does one whose return is lost.

    Args:
      ranges: `[K, 32]` m, the true distances, at most `model.max_range`.
      model: the lidar.
      rngs: `[K]`, of each body's episode; each draws 32 normal and 32 uniform numbers. None draws no noise.
    """
    normal, uniform = np.zeros((len(rngs), NUM_RAYS)), np.ones((len(rngs), NUM_RAYS))
    for rng, normals, uniforms in zip(rngs, normal, uniform, strict=True):
        if rng is not None:
            rng.standard_normal(out=normals)
            rng.random(out=uniforms)
    readings = ranges + model.sigma * normal
    if model.step:
        readings = model.step * np.rint(readings / model.step)
    np.clip(readings, model.min_range, model.max_range, out=readings)
    readings[(ranges >= model.max_range) | (uniform < model.lost)] = model.max_range
    return readings.astype(np.float32)
