"""Measures how much of real buildings their mazes keep, for a folder of ROS maps.

    python benchmarks/reading.py MAPS [--turn 30] [--radius 0.35] > table.txt

The reach of a disc of 0.15 m, or of another radius, on the pixels is the connected set of its positions that has most
of the maze. The share that is kept lies within 0.4 m of the maze; what does not, in pieces above 2 m2, are lost
regions. `--turn` turns the pictures first, enlarged so that their pixels lose nothing by it.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import math
import pathlib
import time
import warnings
from collections.abc import Iterator

import cv2
import numpy as np

from mazebench.constants import SLIDER_RADIUS
from mazebench.errors import InputError
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.readers.occupancy_grid import FREE, UNKNOWN, LocatedMaze, OccupancyGrid, locate_maze
from mazebench.maps.readers.ros import read_occupancy

_NEAR = 0.4  # m
_LEAST_LOST = 2.0  # m2
_ENLARGED = 4  # times, before a picture is turned
_MOST_PIXELS = 3 * 10**7  # of a turned picture; larger ones are enlarged less


def turned(grid: OccupancyGrid, degrees: float) -> OccupancyGrid:
    """Returns a map whose picture is turned counter-clockwise in its frame."""
    known = grid.states != UNKNOWN
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    states = grid.states[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    height, width = (
        abs(cosine) * states.shape[0] + abs(sine) * states.shape[1],
        abs(sine) * states.shape[0] + abs(cosine) * states.shape[1],
    )
    times = next(times for times in range(_ENLARGED, 0, -1) if times**2 * height * width < _MOST_PIXELS or times == 1)
    states = states.repeat(times, axis=0).repeat(times, axis=1)
    height, width = math.ceil(height * times) + 2, math.ceil(width * times) + 2
    turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0]])
    turn[:, 2] = np.array([width - 1, height - 1]) / 2 - turn[:, :2] @ ((np.array(states.shape[::-1]) - 1) / 2)
    shifted = cv2.warpAffine(  # cv2 has no int8
        (states + 1).astype(np.uint8), turn, (width, height), flags=cv2.INTER_NEAREST, borderValue=UNKNOWN + 1
    )
    return dataclasses.replace(grid, states=shifted.astype(np.int8) - np.int8(1), resolution=grid.resolution / times)


def share_kept(
    grid: OccupancyGrid, located: LocatedMaze, radius: float = SLIDER_RADIUS
) -> tuple[float, list[float], float]:
    """Returns the share of the disc's reach that a maze keeps, the lost regions, and the reach; both in m2."""
    free = np.pad(grid.states == FREE, 1)
    distance = cv2.distanceTransform(free.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * grid.resolution
    _, positions = cv2.connectedComponents((distance > radius).astype(np.uint8), connectivity=4)
    in_maze = np.pad(_in_maze(grid, located), 1)
    common = np.bincount(positions[in_maze], minlength=2)
    common[0] = 0
    reach = positions == common.argmax()
    far = cv2.distanceTransform((~in_maze).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    missed = reach & (far * grid.resolution > _NEAR)
    *_, stats, _ = cv2.connectedComponentsWithStats(missed.astype(np.uint8), connectivity=4)
    areas = stats[1:, cv2.CC_STAT_AREA] * grid.resolution**2
    lost = sorted((float(area) for area in areas if area > _LEAST_LOST), reverse=True)
    return 1 - missed.sum() / max(1, reach.sum()), lost, float(reach.sum() * grid.resolution**2)


def _in_maze(grid: OccupancyGrid, located: LocatedMaze) -> np.ndarray:
    """Returns which pixels have their centre in a free cell of the maze: `[H, W]` bool."""
    maze, (x, y, yaw) = located
    old_x, old_y, old_yaw = grid.origin
    height, width = grid.states.shape
    right, up = (np.arange(width) + 0.5) * grid.resolution, (height - np.arange(height) - 0.5) * grid.resolution
    turn, back = old_yaw - yaw, -yaw
    shift_x = math.cos(back) * (old_x - x) - math.sin(back) * (old_y - y)
    shift_y = math.sin(back) * (old_x - x) + math.cos(back) * (old_y - y)
    inside = np.zeros(grid.states.shape, dtype=bool)
    for row in range(height):
        columns = np.floor((shift_x + math.cos(turn) * right - math.sin(turn) * up[row]) / maze.cell_size).astype(int)
        rows = (
            maze.size
            - 1
            - np.floor((shift_y + math.sin(turn) * right + math.cos(turn) * up[row]) / maze.cell_size).astype(int)
        )
        legal = (rows >= 0) & (rows < maze.size) & (columns >= 0) & (columns < maze.size)
        inside[row, legal] = ~maze.walls[rows[legal], columns[legal]]
    return inside


def measure(folder: pathlib.Path, degrees: float, radius: float) -> Iterator[str]:
    """Yields a line of the table for each map of a folder."""
    yield "map | reach m2 | cells | share kept | lost regions m2 | CPU s | walls"
    for path in sorted(folder.glob("*.yaml")):
        with warnings.catch_warnings(action="ignore"):
            begin = time.process_time()
            grid = read_occupancy(path)
            reading = time.process_time() - begin
            try:
                grid = turned(grid, degrees) if degrees else grid
                begin = time.process_time()
                located = locate_maze(grid, ReadOptions(), path.stem, radius)
                reading += time.process_time() - begin
            except (InputError, IndexError) as error:
                yield f"{path.stem} | refused: {error}"
                continue
        share, lost, reach = share_kept(grid, located, radius)
        walls = hashlib.sha256(located.maze.walls.tobytes()).hexdigest()[:12]
        yield (
            f"{path.stem} | {reach:.0f} | {located.maze.size} x {located.maze.cell_size:g} m | {share:.3f} | "
            f"{' '.join(f'{area:.0f}' for area in lost) or '-'} | {reading:.2f} | {walls}"
        )


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("maps", type=pathlib.Path, help="a folder of YAML files and pictures")
    parser.add_argument("--turn", type=float, default=0.0, help="degrees by which the pictures are turned first")
    parser.add_argument("--radius", type=float, default=SLIDER_RADIUS, help="m, of the body")
    options = parser.parse_args()
    for line in measure(options.maps, options.turn, options.radius):
        print(line, flush=True)


if __name__ == "__main__":
    main()
