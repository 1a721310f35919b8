"""The quickest drive and the motion of a body of any kind, in one form: the search and the model of its kind."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mazebench.world.bodies import RollingBody

from .motion import NO_WALLS, Motion, moved, moved_in_the_open
from .moving_body import LOOK_LEFT, LOOK_RIGHT, MovingBody, Point
from .quickest import Course, quickest_drive
from .quickest_rolling import quickest_roll
from .rolling import RollingMotion, rolled


class Motions(NamedTuple):
    """The velocities of a body."""

    velocity: Point = (0.0, 0.0)  # x, y on the map, m/s
    turn: float = 0.0  # yaw rate, rad/s, of a rolling body; sliding ones turn as they are told


def quickest(
    course: Course,
    point: Point,
    motions: Motions,
    yaw: float,
    num_steps: int = 0,
    width: int | None = None,
    strafes: bool = True,
) -> tuple[list[int], list[tuple[float, float, float]]]:
    """Returns the actions of the quickest drive and the poses (x, y, yaw) after each; see `quickest_drive`.

    `strafes` says whether there are actions that strafe, which are arcs of a rolling body.
    """
    widths = {} if width is None else {"width": width}
    if isinstance(course.motion, RollingMotion):
        return quickest_roll(
            course, point, motions.velocity, yaw, motions.turn, num_steps=num_steps, arcs=strafes, **widths
        )
    actions, points = quickest_drive(course, point, motions.velocity, yaw, num_steps, strafes=strafes, **widths)
    looks = np.cumsum([(action == LOOK_LEFT) - (action == LOOK_RIGHT) for action in actions])
    yaws = (yaw + course.motion.turn_step * looks).tolist()
    return actions, [(*each, yaw) for each, yaw in zip(points, yaws, strict=True)]


def motions_after(course: Course, point: Point, motions: Motions, yaw: float, action: int) -> Motions:
    """Returns the velocities after an action from a point and a yaw on a course."""
    (x, y), (vx, vy), motion = point, motions.velocity, course.motion
    if isinstance(motion, RollingMotion):
        _, _, vx, vy, _, turn = rolled(motion, course.walls, course.cell_size, x, y, vx, vy, yaw, motions.turn, action)
        return Motions((vx, vy), turn)
    *_, vx, vy = moved(motion, course.walls, course.cell_size, x, y, vx, vy, yaw, action)
    return Motions((vx, vy))


def step_in_the_open(body: MovingBody, action: int, cell_size: float) -> tuple[Point, float]:
    """Returns the velocity (x, y) on the map in m/s after an action where no wall is near, and the rad turned in it."""
    vx, vy = (cell_size * speed for speed in body.velocity())
    if isinstance(body.model, RollingBody):
        motion = RollingMotion.of(body.model)
        _, _, vx, vy, yaw, _ = rolled(motion, NO_WALLS, 1.0, 0.0, 0.0, vx, vy, body.yaw, body.turn, action)
        return (vx, vy), yaw - body.yaw
    _, _, vx, vy = moved_in_the_open(Motion.of(body.model), vx, vy, body.yaw, action)
    return (vx, vy), body.model.turn_step * ((action == LOOK_LEFT) - (action == LOOK_RIGHT))
