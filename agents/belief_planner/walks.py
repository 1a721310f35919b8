"""Walks of a simulated robot: what it has seen and felt of a layout on its way to the goal.

No physics: the body is in cells' centres, or near them. Lengths are in cells. `L` is the number of cells on a side of
the grid, `K` of poses, `R` of the lidar's rays.
"""

from __future__ import annotations

import math

import numpy as np

from mazebench.world.lidar import NUM_RAYS, TURTLEBOT3, LidarModel

from ..common.kernels import compiled
from ..robot import rays
from ..robot.beams import beams_of
from ..robot.contacts import SURELY
from ..robot.occupancy import Occupancy
from ..robot.planning import plan
from .network import View
from .wrong_maps import Situation

_WITH_LIDAR = 0.6  # share of walks
_SENSORS = (TURTLEBOT3, TURTLEBOT3, LidarModel(), LidarModel(max_range=10.0))
_BEAMS = tuple(beams_of(model, 1.0) for model in _SENSORS)
_DEVIATION = 0.02  # cells; about that of a pose which is tracked
_OFF_CENTRE = 0.12  # cells, the standard deviation of poses around the way from centre to centre
_SCANS = 3  # for each cell of the way: some of what the robot sees in it
_LONGEST_STRETCH = 8  # cells from one plan to the next
_AT_ONCE = 0.15  # share of walks that have not begun
_MEAN_CELLS = 18.0  # of the others, which are as often cut at each cell
_MOST_CELLS = 70
_NEXT_LEG = 0.1  # share of walks after which the goal is another one, so that nothing was searched


def walk_to_goal(situation: Situation, num_views: int, rng: np.random.Generator) -> list[View]:
    """Returns what a robot knows at some moments on its way from the start towards the goal, by the rule's belief."""
    truth, start, goal, belief, _ = situation
    occupancy, searched = Occupancy.unseen(len(truth)), np.zeros(truth.shape, dtype=bool)
    walk = _Walk(truth, occupancy, rng)
    looks_at = np.minimum(rng.exponential(_MEAN_CELLS, num_views), _MOST_CELLS) * (rng.random(num_views) > _AT_ONCE)
    moments = np.sort(looks_at).astype(int).tolist()  # by the number of cells that were walked
    is_leg_before = rng.random() < _NEXT_LEG
    prior, goals = belief.mixture()
    aims = goals if not is_leg_before else rng.random(truth.shape) ** 20

    views: list[View] = []
    cell, num_walked = start, 0
    if moments[-1] > 0:
        walk.look(np.array([start]))
    while True:
        # What the robot knows here.
        if not is_leg_before:
            searched[cell] = True
        if belief.update(occupancy.evidence, searched):
            prior, goals = belief.mixture()
            aims = goals if not is_leg_before else aims
        while len(views) < num_views and num_walked >= moments[len(views)]:
            views.append(View(prior, occupancy.evidence.copy(), goals, searched.copy()))
        if len(views) == num_views:
            return views
        walls = occupancy.walls(prior)
        walls[occupancy.is_seen() & (walls > 0.5)] = 1.0
        possible = aims * ~(searched | (walls == 1))
        if is_leg_before:
            possible[cell] = 0.0
        if not possible.any():
            break

        # The next cells of its way, up to one that is blocked, or to the goal, where an episode would have ended.
        num_cells = min(int(rng.integers(1, _LONGEST_STRETCH + 1)), moments[len(views)] - num_walked)
        way = plan(walls, possible, cell)[1 : 1 + num_cells]
        free = next((k for k, each in enumerate(way) if truth[each] or (each == goal and not is_leg_before)), len(way))
        if free:
            walk.look(np.array([cell, *way[:free]]))
            searched[tuple(np.transpose(way[:free]))] = not is_leg_before
            cell, num_walked = way[free - 1], num_walked + free
        if free < len(way):
            if not truth[way[free]]:  # the goal
                break
            occupancy.feel(way[free], SURELY)
            num_walked += 1
    return views + [View(prior, occupancy.evidence, goals, searched)] * (num_views - len(views))


class _Walk:
    """What the senses of one robot add to the evidence."""

    def __init__(self, truth: np.ndarray, occupancy: Occupancy, rng: np.random.Generator):
        """`truth` `[L, L]` bool are the walls; `occupancy` is changed in place."""
        self._truth, self._occupancy, self._rng = truth, occupancy, rng
        self._sensor = int(rng.integers(len(_SENSORS))) if rng.random() < _WITH_LIDAR else None

    def look(self, way: np.ndarray) -> None:
        """Passes through cells `[K, 2]` (row, column) side by side, from the centre of the first one on."""
        if self._sensor is None:
            for row, column in way.tolist():
                self._occupancy.visit((row, column))
            return
        model, size = _SENSORS[self._sensor], len(self._truth)
        centres = np.column_stack([way[:, 1] + 0.5, size - way[:, 0] - 0.5])
        along = np.linspace(0, len(way) - 1, 1 + _SCANS * (len(way) - 1))
        points = np.column_stack([np.interp(along, np.arange(len(way)), each) for each in centres.T])
        points += np.clip(self._rng.normal(0, _OFF_CENTRE, points.shape), -0.3, 0.3)
        poses = np.column_stack([points, self._rng.uniform(-math.pi, math.pi, len(points))])
        ranges = true_ranges(self._truth, poses, model.max_range)
        readings = _read(ranges, model, self._rng)
        for (x, y, yaw), scan in zip(poses.tolist(), readings, strict=True):
            self._occupancy.see((x, y, yaw), scan, _BEAMS[self._sensor], _DEVIATION)


def _read(ranges: np.ndarray, model: LidarModel, rng: np.random.Generator) -> np.ndarray:
    """Returns what a lidar reads where the true distances are `ranges` `[K, R]`, as `mazebench.tasks.sensors` says."""
    if not model.is_random:
        return ranges
    readings = ranges + model.sigma * rng.standard_normal(ranges.shape)
    readings = np.clip(model.step * np.rint(readings / model.step), model.min_range, model.max_range)
    readings[(ranges >= model.max_range) | (rng.random(ranges.shape) < model.lost)] = model.max_range
    return readings


@compiled
def true_ranges(walls: np.ndarray, poses: np.ndarray, reach: float) -> np.ndarray:
    """Returns the distances `[K, R]` from poses `[K, 3]` (x, y, yaw) to walls `[L, L]` bool, at most `reach`."""
    size = len(walls)
    ranges = np.full((len(poses), NUM_RAYS), reach)
    for k in range(len(poses)):
        for i in range(NUM_RAYS):
            angle = poses[k, 2] + 2 * math.pi * i / NUM_RAYS
            ray = rays.ray_from(poses[k, 0], poses[k, 1], math.cos(angle), math.sin(angle))
            while True:
                distance = rays.leaves_at(ray)
                ray = rays.in_next_cell(ray)
                if distance >= reach or not rays.is_on(ray, walls):
                    break
                if walls[size - 1 - ray.level, ray.column]:
                    ranges[k, i] = distance
                    break
    return ranges
