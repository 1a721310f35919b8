"""Scans of the lidar: what a map lets one expect, and what a scan tells without a map.

Lengths are in cells, which the constants take for 1 m wide. A pose is (x, y, yaw) on the map, cells and radians. A scan
is `[32]` cells, what the sensor `lidar` observes; a ray that is as long as the sensor's `reach` saw no wall. `H` is the
number of poses.
"""

from __future__ import annotations

import math

import numpy as np

from mazebench.world.lidar import MAX_RANGE, NUM_RAYS

from ..common.kernels import compiled, inlined
from ..robot import rays

# The heading up to quarter turns (rad), x and y within a cell in the frame with that heading; see `wall_frame`.
WallFrame = tuple[float, float, float]

_ANGLES = 2 * np.pi / NUM_RAYS * np.arange(NUM_RAYS)
_COSINES, _SINES = np.cos(_ANGLES), np.sin(_ANGLES)
_FACE_X, _FACE_Y, _NO_FACE = 0, 1, 2  # a ray ends at a wall's face x = constant, y = constant, or at no wall

# The sensor is exact. What errors there are come from the pose, and are measured across the face that a ray ends at.
_SIGMA = 0.02
_OUTLIER_COST = 2.5  # minus the log likelihood of a ray that the map does not explain
_EXPLAINED = 0.05
_SAME_DIRECTION = math.radians(0.3)  # between two pieces of walls
_OFF_LINE = 0.02  # nearer to a line of the grid, a ray's end may lie on it


@compiled
def predict(walls: np.ndarray, poses: np.ndarray, reach: float = MAX_RANGE) -> np.ndarray:
    """Returns `[H, 32]`: the scans that the map `walls` `[N, N]` bool lets one expect at `poses` `[H, 3]`."""
    expected = np.empty((len(poses), NUM_RAYS))
    for h in range(len(poses)):
        cosine, sine = math.cos(poses[h, 2]), math.sin(poses[h, 2])
        for i in range(NUM_RAYS):
            along_x, along_y = cosine * _COSINES[i] - sine * _SINES[i], sine * _COSINES[i] + cosine * _SINES[i]
            expected[h, i], _ = _cast(walls, poses[h, 0], poses[h, 1], along_x, along_y, reach)
    return expected


@compiled
def score(
    walls: np.ndarray, poses: np.ndarray, ranges: np.ndarray, reach: float = MAX_RANGE
) -> tuple[np.ndarray, np.ndarray]:
    """Returns two `[H]`: the log likelihoods of the scan `ranges` at `poses`, and the shares of its rays explained.

    A ray is normal about the ray cast or an outlier, whichever is likelier: a mixture like the beam model of Thrun,
    Burgard & Fox (2005), Probabilistic Robotics, section 6.3, of which only the larger term counts.
    """
    log_likelihoods, explained = np.zeros(len(poses)), np.zeros(len(poses))
    for h in range(len(poses)):
        cosine, sine = math.cos(poses[h, 2]), math.sin(poses[h, 2])
        for i in range(NUM_RAYS):
            along_x, along_y = cosine * _COSINES[i] - sine * _SINES[i], sine * _COSINES[i] + cosine * _SINES[i]
            expected, face = _cast(walls, poses[h, 0], poses[h, 1], along_x, along_y, reach)
            # A grazing ray is long or short by much if the pose is off by little.
            across = along_x if face == _FACE_X else (along_y if face == _FACE_Y else 1.0)
            error = (ranges[i] - expected) * across
            log_likelihoods[h] -= min(0.5 * (error / _SIGMA) ** 2, _OUTLIER_COST)
            explained[h] += (abs(error) < _EXPLAINED) / NUM_RAYS
    return log_likelihoods, explained


@inlined
def _cast(walls: np.ndarray, x: float, y: float, along_x: float, along_y: float, reach: float) -> tuple[float, int]:
    """Returns how far a ray gets, and the kind of face that it ends at; the cell in which it begins counts as free."""
    ray = rays.ray_from(x, y, along_x, along_y)
    while True:
        distance, face = rays.leaves_at(ray), _FACE_X if rays.leaves_sideways(ray) else _FACE_Y
        ray = rays.in_next_cell(ray)
        if distance >= reach or not rays.is_on(ray, walls):
            return reach, _NO_FACE
        if walls[len(walls) - 1 - ray.level, ray.column]:
            return distance, face


@compiled
def wall_frame(ranges: np.ndarray, reach: float = MAX_RANGE) -> WallFrame:
    """Returns what the scan `ranges` tells of the pose without a map, where walls lie on the grid of the cells.

    The pieces of walls between the ends of neighbouring rays have the directions of the grid, but for those that cross
    a corner: the heading is the one on which most pieces agree, in (-pi / 4, pi / 4]. x and y in [0, 1) follow from how
    far the walls are in the frame with that heading. The true pose is (heading, x, y) seen from some corner of the grid
    and turned by quarter turns. What no wall in view tells is NaN.
    """
    directions, first = np.empty(NUM_RAYS), np.empty(NUM_RAYS, np.int64)
    count = 0
    for i in range(NUM_RAYS):
        j = (i + 1) % NUM_RAYS
        if ranges[i] < reach and ranges[j] < reach:
            ahead = ranges[j] * _COSINES[j] - ranges[i] * _COSINES[i]
            aside = ranges[j] * _SINES[j] - ranges[i] * _SINES[i]
            directions[count], first[count] = math.atan2(aside, ahead), i
            count += 1
    grid = _quarter(_common_direction(directions[:count]))
    cosine, sine = math.cos(grid), math.sin(grid)
    sums = np.zeros((2, 2))  # by kind of face: the sum of unit vectors whose angles are the faces' places in a cell
    for piece in range(count):
        offset = directions[piece] - grid
        if abs(_quarter(offset)) < _SAME_DIRECTION:
            i = first[piece]
            ahead, aside = ranges[i] * _COSINES[i], ranges[i] * _SINES[i]
            face = _FACE_Y if abs(math.cos(offset)) > 0.5 else _FACE_X
            place = cosine * aside - sine * ahead if face == _FACE_Y else cosine * ahead + sine * aside
            sums[face, 0] += math.cos(2 * np.pi * place)
            sums[face, 1] += math.sin(2 * np.pi * place)
    x, y = _within_cell(sums[_FACE_X]), _within_cell(sums[_FACE_Y])
    if math.isnan(x) and not math.isnan(y):
        x = _from_single_rays(ranges, -grid, y, reach)
    elif math.isnan(y) and not math.isnan(x):
        # A quarter turn makes y of the frame x of another one, in which its x is -y.
        y = _from_single_rays(ranges, -grid - np.pi / 2, 1 - x, reach)
    return -grid, x, y


@inlined
def _from_single_rays(ranges: np.ndarray, heading: float, y: float, reach: float) -> float:
    """Returns x within a cell, by rays whose ends lie on no line y = constant of the grid; NaN if there are none."""
    total = np.zeros(2)
    for i in range(NUM_RAYS):
        along_x, along_y = math.cos(heading + _ANGLES[i]), math.sin(heading + _ANGLES[i])
        end_x, end_y = ranges[i] * along_x, y + ranges[i] * along_y
        if ranges[i] < reach and abs(end_y - round(end_y)) > _OFF_LINE:
            total[0] += math.cos(2 * np.pi * end_x)
            total[1] += math.sin(2 * np.pi * end_x)
    return _within_cell(total)


@inlined
def _common_direction(directions: np.ndarray) -> float:
    """Returns a direction, up to quarter turns, on which most of `directions` agree; NaN if no two of them do."""
    quarters = np.array([_quarter(direction) for direction in directions])
    best, most = np.nan, 1
    for candidate in quarters:
        total, count = 0.0, 0
        for quarter in quarters:
            difference = quarter - candidate
            if difference > np.pi / 4:
                difference -= np.pi / 2
            elif difference < -np.pi / 4:
                difference += np.pi / 2
            if abs(difference) < _SAME_DIRECTION:
                total += difference
                count += 1
        if count > most:
            best, most = candidate + total / count, count
    return best


@inlined
def _quarter(angle: float) -> float:
    """Returns the angle in [-pi / 4, pi / 4) that differs from `angle` by quarter turns."""
    return (angle + np.pi / 4) % (np.pi / 2) - np.pi / 4


@inlined
def _within_cell(total: np.ndarray) -> float:
    """Returns the coordinate in [0, 1) of a body that sees faces at the mean angle of `total` `[2]`."""
    if total[0] == 0 and total[1] == 0:
        return np.nan
    return (-math.atan2(total[1], total[0]) / (2 * np.pi)) % 1.0
