"""The lidar's beam model: how likely a scan is from a pose, and what it tells of walls.

After Thrun, Burgard & Fox (2005), Probabilistic Robotics, section 6.3: a ray hits a wall with normal noise, is lost and
reads the largest range, or reads anything. Short readings count as any. The map is a grid of probabilities of walls, so
a ray may end at each cell that it enters: with the probability that this cell is a wall and those before it are not.

Lengths are in cells; `reading_of` turns metres into cells. A pose is (x, y, yaw) with x to the right and y up, and the
grid's lower left corner at (0, 0). `L` is the number of cells on a side of the grid, `R` of rays, `H` of poses.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mazebench.kernels import compiled, inlined
from mazebench.world.ray_casting import LidarModel

from . import rays

# Floors of what the sensor declares, for errors of the model.
_LOST = 0.01  # share of rays that are lost
_SIGMA = 0.005  # m
_RANDOM = 0.04  # share of rays that read anything

_MARGIN = 0.02  # m from the edge of a cell, where what is seen could as well lie in the next cell
_BEHIND = 1.0  # m behind a reading, up to which cells are looked at
_WIDE = 4.0  # standard deviations, beyond which a hit is as good as impossible
_LEAST_PASSED = 1e-3  # probability of getting so far, below which a ray is not followed
_GRAZING = 0.15  # sine of the angle between a ray and a wall; at a smaller one, a hit is not used
_LARGEST_STEP = 2.0  # log odds that one ray adds to a cell, for neighbouring rays share their errors
MOST_EVIDENCE = 8.0  # log odds of a cell, so that errors can be undone
UNKNOWN = 0.4  # probability of a wall where nothing was seen, when a scan is added


class Beams(NamedTuple):
    """The beam model's parameters, in cells."""

    reach: float  # what a ray reads that meets no wall
    sigma: float  # standard deviation of a range
    lost: float  # probability that a ray reads `reach` though it meets a wall
    random: float  # probability of any reading
    metre: float = 1.0  # cells per metre
    growth: float = 0.0  # of the standard deviation, per square of a range
    weight: float = 1.0  # of what a ray tells, less than 1 where neighbouring rays share their errors
    offset: float = 0.0  # of the sensor ahead of the body's centre, of which a pose is


def beams_of(model: LidarModel, cells_per_metre: float, offset: float = 0.0) -> Beams:
    """Returns the beam model of a sensor `offset` (m) ahead of the body's centre."""
    sigma = math.hypot(model.sigma, model.step / math.sqrt(12)) * cells_per_metre  # rounding is uniform
    sigma = max(sigma, _SIGMA * cells_per_metre)
    reach, offset = model.max_range * cells_per_metre, offset * cells_per_metre
    return Beams(reach, sigma, max(model.lost, _LOST), _RANDOM, cells_per_metre, offset=offset)


@inlined
def _hit_likelihood(reading: float, distance: float, across: float, deviation: float, beams: Beams) -> float:
    """Returns the density of a reading (its probability where it is `reach`) of a ray that ends at a wall.

    `across` is the sine of the angle between ray and wall; `deviation` is that of the pose. It is felt more by rays
    that graze.
    """
    off_pose = deviation / max(across, _GRAZING)
    sigma = math.sqrt(beams.sigma**2 + (beams.growth * distance * distance) ** 2 + off_pose**2)
    off = (reading - distance) / sigma
    if reading >= beams.reach:
        return beams.lost + (1 - beams.lost) * (0.0 if off > _WIDE else 0.5 * math.erfc(off * math.sqrt(0.5)))
    floor = beams.random / beams.reach
    if abs(off) > _WIDE:
        return floor
    return floor + (1 - beams.lost - beams.random) * math.exp(-off * off / 2) / (sigma * 2.5066282746310002)


@inlined
def _miss_likelihood(reading: float, beams: Beams) -> float:
    """Returns the same for a ray that meets no wall within reach."""
    return 1 - beams.random if reading >= beams.reach else beams.random / beams.reach


@compiled
def log_likelihoods(
    walls: np.ndarray, poses: np.ndarray, ranges: np.ndarray, beams: Beams, deviation: float
) -> np.ndarray:
    """Returns `[H]`: the log likelihoods of a scan `ranges` `[R]` from `poses` `[H, 3]`.

    `walls` `[L, L]` are probabilities; a larger `deviation` of a pose's position makes the likelihood smoother.
    """
    result = np.zeros(len(poses))
    for h in range(len(poses)):
        result[h] = log_likelihood(walls, poses[h, 0], poses[h, 1], poses[h, 2], ranges, beams, deviation)
    return result


@inlined
def log_likelihood(
    walls: np.ndarray, x: float, y: float, yaw: float, ranges: np.ndarray, beams: Beams, deviation: float
) -> float:
    """Returns the log likelihood of a scan from one pose; rays that read NaN tell nothing."""
    total, size, num_rays = 0.0, len(walls), len(ranges)
    turn_cosine, turn_sine = math.cos(2 * math.pi / num_rays), math.sin(2 * math.pi / num_rays)
    along_x, along_y = math.cos(yaw), math.sin(yaw)
    x, y = x + beams.offset * along_x, y + beams.offset * along_y
    for i in range(num_rays):
        reading, passed, likelihood = ranges[i], 1.0, 0.0
        ray = rays.ray_from(x, y, along_x, along_y)
        while not math.isnan(reading):
            distance = rays.leaves_at(ray)
            across = abs(along_x) if rays.leaves_sideways(ray) else abs(along_y)
            ray = rays.in_next_cell(ray)
            if distance >= beams.reach or passed < _LEAST_PASSED:
                likelihood += passed * _miss_likelihood(reading, beams)
                break
            if not rays.is_on(ray, walls):  # outside of the grid is wall
                likelihood += passed * _hit_likelihood(reading, distance, across, deviation, beams)
                break
            wall = walls[size - 1 - ray.level, ray.column]
            likelihood += passed * wall * _hit_likelihood(reading, distance, across, deviation, beams)
            passed *= 1 - wall
        if not math.isnan(reading):
            total += beams.weight * math.log(likelihood)
        along_x, along_y = along_x * turn_cosine - along_y * turn_sine, along_y * turn_cosine + along_x * turn_sine
    return total


@compiled
def add_scan(
    evidence: np.ndarray, x: float, y: float, yaw: float, ranges: np.ndarray, beams: Beams, deviation: float
) -> None:
    """Adds what a scan tells to `evidence` `[L, L]`, the log odds of walls, in place.

    Each ray adds to a cell the log ratio of its likelihoods with and without a wall there, given all other cells as
    they were estimated before (forward sensor model: Thrun 2003, Learning occupancy grid maps with forward sensor
    models). So a ray that may be lost frees cells a little, and a hit counts for each wall that explains it.
    """
    size = len(evidence)
    most = int(2 * beams.reach) + 4
    rows, columns = np.empty(most, np.int64), np.empty(most, np.int64)
    hits, walls, may_free, may_mark = np.empty(most), np.empty(most), np.empty(most, np.bool_), np.empty(most, np.bool_)
    margin, behind = _MARGIN * beams.metre + 2 * deviation, _BEHIND * beams.metre
    body_x, body_y = x, y
    x, y = x + beams.offset * math.cos(yaw), y + beams.offset * math.sin(yaw)
    for i in range(len(ranges)):
        angle, reading = yaw + 2 * math.pi * i / len(ranges), ranges[i]
        if math.isnan(reading):
            continue
        along_x, along_y = math.cos(angle), math.sin(angle)

        # The cells that the ray enters, and how likely the reading is if it ends there.
        count, ray = 0, rays.ray_from(x, y, along_x, along_y)
        while count < most:
            distance, sideways = rays.leaves_at(ray), rays.leaves_sideways(ray)
            ray = rays.in_next_cell(ray)
            if distance >= beams.reach or distance > reading + behind or not rays.is_on(ray, evidence):
                break
            rows[count], columns[count] = size - 1 - ray.level, ray.column
            across = abs(along_x) if sideways else abs(along_y)
            hits[count] = _hit_likelihood(reading, distance, across, deviation, beams)
            walls[count] = 1 / (1 + math.exp(-evidence[rows[count], columns[count]]) * (1 - UNKNOWN) / UNKNOWN)
            beside = y + distance * along_y - ray.level if sideways else x + distance * along_x - ray.column
            may_mark[count] = min(beside, 1 - beside) > margin and across > _GRAZING
            middle = (distance + min(rays.leaves_at(ray), reading)) / 2
            depth_x, depth_y = x + middle * along_x - ray.column, y + middle * along_y - ray.level
            may_free[count] = middle > distance and min(depth_x, 1 - depth_x, depth_y, 1 - depth_y) > margin
            count += 1

        # Backwards: `beyond` is the likelihood if the ray passes a cell.
        beyond = _miss_likelihood(reading, beams)
        passing = np.empty(count)
        for k in range(count - 1, -1, -1):
            passing[k] = beyond
            beyond = walls[k] * hits[k] + (1 - walls[k]) * beyond

        # Forwards: `before` is the likelihood of ending before a cell, `passed` the probability of getting to it.
        before, passed = 0.0, 1.0
        for k in range(count):
            step = beams.weight * math.log((before + passed * hits[k]) / (before + passed * passing[k]))
            if (step > 0 and may_mark[k]) or (step < 0 and may_free[k]):
                step = min(max(step, -beams.weight * _LARGEST_STEP), beams.weight * _LARGEST_STEP)
                changed = evidence[rows[k], columns[k]] + step
                evidence[rows[k], columns[k]] = min(max(changed, -MOST_EVIDENCE), MOST_EVIDENCE)
            before += passed * walls[k] * hits[k]
            passed *= 1 - walls[k]
    # The body is in a free cell.
    column, row = math.floor(body_x), size - 1 - math.floor(body_y)
    if 0 <= row < size and 0 <= column < size:
        evidence[row, column] = max(evidence[row, column] - _LARGEST_STEP, -MOST_EVIDENCE)
