"""Where on the shown map a body stands whose pose is odometry: its first lidar reading is compared with the map."""

from __future__ import annotations

import math

import numpy as np

from .evidence import NUM_EVIDENCE, SENSED, Readings, place

_HEADINGS = 64  # that are tried
_FINER = 16  # parts of the step between two of them, tried around the best one


def is_odometry(state: np.ndarray) -> bool:
    """Returns whether an episode's first state `[12]` has its pose at the origin, which is outside of all mazes."""
    return not state[[0, 1, 5]].any()


def find_pose(walls: np.ndarray, ranges: np.ndarray, cells: np.ndarray, to_map: np.ndarray) -> tuple[np.ndarray, float]:
    """Returns the cell `[2]` and the heading (rad) at which a reading of the lidar fits the map best.

    Args:
      walls: `[M, M]` float32, the share of wall in each cell.
      ranges: `[R]` float32, m.
      cells: `[C, 2]` int, in the middle of which the body may be.
      to_map: `[2, 2]` float32, rows and columns (first axis) of a metre in x and in y (second axis).
    """
    step = 2 * math.pi / _HEADINGS
    headings = np.arange(_HEADINGS) * step
    fits = np.stack([_fits(walls, ranges, cell, headings, to_map) for cell in cells])
    best, heading = np.unravel_index(fits.argmax(), fits.shape)
    finer = headings[heading] + np.linspace(-step, step, 2 * _FINER + 1)
    return cells[best], float(finer[_fits(walls, ranges, cells[best], finer, to_map).argmax()])


def _fits(
    walls: np.ndarray, ranges: np.ndarray, cell: np.ndarray, headings: np.ndarray, to_map: np.ndarray
) -> np.ndarray:
    """Returns how well the evidence of a reading at each of the headings `[H]` agrees with the map, `[H]`."""
    number, size = len(headings), len(walls)
    planes = np.zeros((number, NUM_EVIDENCE, size, size), dtype=np.float32)
    still = np.zeros((number, 2), dtype=np.float32)
    at = np.broadcast_to(np.asarray(cell, dtype=np.float32), still.shape)
    scans = np.broadcast_to(ranges, (number, len(ranges)))
    readings = Readings(np.arange(number), np.zeros(number, dtype=bool), at, still, still, headings, scans)
    place(planes, readings, to_map)
    return (planes[:, SENSED] * (2 * walls - 1)).sum(axis=(1, 2))
