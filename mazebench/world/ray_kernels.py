"""The kernels of the range sensor, compiled: rays through the cells of mazes, and what a sensor makes of their lengths.

`K` is the number of bodies, `R` the number of rays of each, `N` the cells on a side of a maze.
"""

from __future__ import annotations

import math

import numpy as np

from mazebench.kernels import compiled

_PARALLEL = 1e-300  # the least component of a ray, so that the lines it is parallel to are far away but not at infinity


@compiled
def cast(
    walls: np.ndarray, maze: np.ndarray, pose: np.ndarray, num_rays: int, cell_size: float, max_range: float
) -> np.ndarray:
    """Returns the distances to the nearest walls along rays, at most `max_range`: `[K, R]` float32, m.

    The first ray of a body points straight ahead, the others follow counter-clockwise. A ray goes from cell to cell,
    over the nearer of the next lines of constant x and of constant y (Amanatides and Woo, A Fast Voxel Traversal
    Algorithm for Ray Tracing, 1987), in its maze turned by the quarters after which it points to the right and upwards.

    Args:
      walls: `[mazes, N, N]` bool, with closed borders.
      maze: `[K]` int, the index of the maze that each body is in.
      pose: `[K, 3]` float64, x, y (m) and yaw (rad, not wrapped).
      num_rays: R, a multiple of 4.
      cell_size: m.
      max_range: m.
    """
    size, per_turn, reach = walls.shape[1], num_rays // 4, max_range / cell_size
    step = 2 * math.pi / num_rays  # rad, from one ray to the next
    cosines, sines = np.cos(np.arange(per_turn) * step), np.sin(np.arange(per_turn) * step)
    is_wall = walls.ravel()
    ranges = np.empty((len(pose), num_rays), dtype=np.float32)
    for body in range(len(pose)):
        # Where the body points: in steps, rounded down, and the rest.
        yaw = pose[body, 2]
        heading = math.floor(yaw / step)
        cosine, sine = math.cos(yaw - heading * step), math.sin(yaw - heading * step)

        # The body's cell, and where the body is in it.
        x, y = pose[body, 0] / cell_size, pose[body, 1] / cell_size
        column, level = math.floor(x), math.floor(y)
        beyond_x, beyond_y = x - column, y - level
        first_cell = (maze[body] * size + size - 1 - level) * size + column

        # To the right, up, left and down: the cells to the next line, and to the next cell in `is_wall`.
        gaps = (1.0 - beyond_x, 1.0 - beyond_y, beyond_x, beyond_y)
        moves = (1, -size, -1, size)

        for number in range(per_turn):
            # The cells along the ray between two lines of constant x and of constant y, in the turned maze.
            along_x = cosine * cosines[number] - sine * sines[number]
            along_y = cosine * sines[number] + sine * cosines[number]
            spacing_x, spacing_y = 1.0 / max(along_x, _PARALLEL), 1.0 / max(along_y, _PARALLEL)

            for turn in range(4):
                cell = first_cell
                move_x, move_y = moves[turn], moves[(turn + 1) % 4]
                to_x, to_y = gaps[turn] * spacing_x, gaps[(turn + 1) % 4] * spacing_y
                while True:
                    # Enter the cell behind the nearer line.
                    if to_x < to_y:
                        distance = to_x
                        cell += move_x
                        to_x += spacing_x
                    else:
                        distance = to_y
                        cell += move_y
                        to_y += spacing_y
                    # A body that was never placed may stand outside the free cells, and its rays leave the maze.
                    if is_wall[min(max(cell, 0), len(is_wall) - 1)] or distance >= reach:
                        break
                ray = (turn * per_turn + number - heading) % num_rays
                ranges[body, ray] = min(distance * cell_size, max_range)
    return ranges


@compiled
def measure(
    ranges: np.ndarray, normal: np.ndarray, uniform: np.ndarray, min_range: float, max_range: float, sigma: float,
    step: float, lost: float,
) -> np.ndarray:  # fmt: skip
    """Returns what a lidar reads of true distances (`[K, R]` float32, m): `[K, R]` float32, m.

    `normal` and `uniform` (`[K, R]` float64) are random numbers. The others are the fields of a `LidarModel`, in order.
    """
    readings = np.empty(ranges.shape, dtype=np.float32)
    for ray in np.ndindex(ranges.shape):
        reading = float(ranges[ray]) + sigma * float(normal[ray])
        if step:
            reading = step * round(reading / step)
        is_lost = ranges[ray] >= np.float32(max_range) or uniform[ray] < lost
        readings[ray] = max_range if is_lost else min(max(reading, min_range), max_range)
    return readings
