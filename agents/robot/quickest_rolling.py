"""The quickest drive of a rolling body to a goal cell, by a beam search over its own motion.

It is the search of `quickest` for a body that turns with an inertia and drives along its heading only. A state is good
if little of the way is left from where the body would come to rest, and if its heading there is along that way. The
states of a beam are from many sectors of headings, so that a body that turns first is not given up for one that drives.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mazebench.constants import NUM_ACTIONS, STEP_TIME
from mazebench.kernels import compiled

from .motion import push_of_walls
from .moving_body import STRAFE_LEFT, STRAFE_RIGHT, Point
from .quickest import Course, way_left_at
from .rolling import RollingMotion, rolled

_SECTORS = 16  # of headings
_WIDTH, _NARROWEST, _WIDEST = 250, 10, 60  # states of a beam for each sector: for each metre of a step, and bounds
_BEHIND = 1.0  # m that a state may be behind the best one
_SAME = 0.25  # of the way of a command at the top speed, between states that count as the same one
_DRIVEN_WEIGHT = 0.3  # of a metre that was driven against one that is left
_TOUCHED = 2.0  # steps at the top speed, as whose way a step counts after which a wall pushes: it is hard to foresee
_ASKEW_WEIGHT = 0.5  # of the time that a turn along the way takes, in metres at the top speed
_ARRIVED = -1e9  # added to the score of a state in the goal cell: lower than all others
_HELD = 0.08  # m, about as long as a command is held at the top speed, at least two steps

_State = np.dtype(
    [
        *((name, np.float64) for name in ("x", "y", "vx", "vy", "yaw", "turn", "driven", "score")),
        *((name, np.int64) for name in ("action", "steps", "parent")),  # held for how many steps
    ]
)


def quickest_roll(
    course: Course,
    point: Point,
    velocity: Point,
    yaw: float,
    turn: float,
    num_steps: int = 0,
    width: int = 0,
    arcs: bool = True,
    held: int = 0,
) -> tuple[list[int], list[tuple[float, float, float]]]:
    """Returns the actions of the quickest drive, and the poses (x, y, yaw) after each of them.

    See `quickest_drive`.

    Args:
      course: the way.
      point: (x, y) of the body.
      velocity: (x, y) of the body on the map, in m/s.
      yaw: of the body, in rad.
      turn: its yaw rate, in rad/s.
      num_steps: that are planned at most; 0 for as many as said above.
      width: states of a beam for each sector of headings; 0 for the more the faster it is, since it takes fewer steps.
      arcs: whether the body drives arcs.
      held: steps of a command; 0 for as many as lead on by some centimetres, at least two.
    """
    motion, way_left = course.motion, way_left_at(course, *point)
    width = width or min(max(_NARROWEST, round(_WIDTH * motion.top_speed * STEP_TIME)), _WIDEST)
    held = held or max(2, round(_HELD / (motion.top_speed * STEP_TIME)))
    expected = way_left / (motion.top_speed * STEP_TIME) if way_left < np.inf else 0.0
    turning = (math.pi / motion.turn_rate + motion.turn_rate / motion.turn_acceleration) / STEP_TIME
    num_commands = math.ceil((num_steps or int(2 * expected + turning) + 49) / held)
    beams = np.zeros((num_commands + 1, width * _SECTORS), _State)
    first = beams[0, 0]
    first["x"], first["y"], first["vx"], first["vy"], first["yaw"], first["turn"] = *point, *velocity, yaw, turn
    last, index = _search(course, beams, held, arcs), 0
    drive = []
    for command in range(last, 0, -1):
        drive.append(beams[command, index])
        index = drive[-1]["parent"]

    # The poses within commands.
    actions, poses, state = [], [], beams[0, 0]
    x, y, vx, vy, yaw, turn = (float(state[name]) for name in ("x", "y", "vx", "vy", "yaw", "turn"))
    for state in reversed(drive):
        for _ in range(int(state["steps"])):
            action = int(state["action"])
            x, y, vx, vy, yaw, turn = rolled(motion, course.walls, course.cell_size, x, y, vx, vy, yaw, turn, action)
            actions.append(action)
            poses.append((x, y, yaw))
    return actions, poses


@compiled
def _search(course: Course, beams: np.ndarray, held: int, arcs: bool) -> int:
    """Fills the beams after the first one; returns the number of commands after which the first state has arrived."""
    children = np.empty(beams.shape[1] * NUM_ACTIONS, beams.dtype)
    count = 1
    for command in range(1, len(beams)):
        num_children = 0
        for parent in range(count):
            for action in range(NUM_ACTIONS):
                if not arcs and action in (STRAFE_LEFT, STRAFE_RIGHT):
                    continue
                child = children[num_children]
                child.parent, child.action = parent, action
                _roll(course, beams[command - 1, parent], child, held)
                num_children += 1
        count = _keep_best(course.motion, children[:num_children], beams[command], held)
        if beams[command, 0].score < _ARRIVED / 2:
            return command
    return len(beams) - 1


@compiled
def _roll(course: Course, state: Any, child: Any, held: int) -> None:
    """Makes `child` the state after an action from `state` that is held for some steps, or until the goal."""
    x, y, vx, vy, yaw, turn = state.x, state.y, state.vx, state.vy, state.yaw, state.turn
    child.driven, child.steps = state.driven, held
    has_arrived = False
    for step in range(held):
        before_x, before_y = x, y
        x, y, vx, vy, yaw, turn = rolled(
            course.motion, course.walls, course.cell_size, x, y, vx, vy, yaw, turn, child.action
        )
        child.driven += math.hypot(x - before_x, y - before_y)
        push_x, push_y = push_of_walls(course.motion, course.walls, course.cell_size, x, y, 0.0, 0.0, 0.0, 0.0)
        if push_x != 0 or push_y != 0:
            child.driven += _TOUCHED * course.motion.top_speed * STEP_TIME
        if int(x / course.cell_size) == course.goal_x and int(y / course.cell_size) == course.goal_y:
            has_arrived, child.steps = True, step + 1
            break
    child.x, child.y, child.vx, child.vy, child.yaw, child.turn = x, y, vx, vy, yaw, turn
    if has_arrived:
        child.score = _ARRIVED + child.steps + 1e-3 * child.driven
    else:
        child.score = _cost_left(course, x, y, vx, vy, yaw, turn) + _DRIVEN_WEIGHT * child.driven


@compiled
def _cost_left(course: Course, x: float, y: float, vx: float, vy: float, yaw: float, turn: float) -> float:
    """Returns the way (m) that is left from where the body comes to rest, and what the turn along it costs."""
    motion = course.motion
    rest_time = math.hypot(vx, vy) / (2 * motion.acceleration)
    rest_x, rest_y = x + rest_time * vx, y + rest_time * vy
    left = way_left_at(course, rest_x, rest_y)
    if left == np.inf:  # a wall would stop the body
        rest_x, rest_y, left = x, y, way_left_at(course, x, y)

    # Where the way leads, by differences over a fifth of a cell.
    step = course.cell_size / 5
    east, west = way_left_at(course, rest_x + step, rest_y), way_left_at(course, rest_x - step, rest_y)
    north, south = way_left_at(course, rest_x, rest_y + step), way_left_at(course, rest_x, rest_y - step)
    along_x = min(west, left + step) - min(east, left + step)
    along_y = min(south, left + step) - min(north, left + step)
    if along_x == 0 and along_y == 0:
        return left
    heading = yaw + turn * abs(turn) / (2 * motion.turn_acceleration)
    askew = abs(heading - math.atan2(along_y, along_x)) % math.pi
    askew = min(askew, math.pi - askew)  # it also drives backward
    return left + _ASKEW_WEIGHT * motion.top_speed * askew / motion.turn_rate


@compiled
def _keep_best(motion: RollingMotion, children: Any, beam: Any, held: int) -> int:
    """Puts the best children that differ into a beam, the best one first, some of each sector; returns how many."""
    order = np.argsort(children.score)
    num_kept = np.zeros(_SECTORS, np.int64)
    same = _SAME * motion.top_speed * STEP_TIME * held
    along, about = motion.top_speed / (2 * motion.acceleration), motion.top_speed / motion.turn_rate
    count = 0
    for index in order:
        child = children[index]
        if child.score > children[order[0]].score + _BEHIND:
            break
        sector = int(child.yaw * _SECTORS / math.tau) % _SECTORS
        is_new = num_kept[sector] < len(beam) // _SECTORS
        for other in beam[:count]:
            apart = abs(other.x - child.x) + abs(other.y - child.y)
            apart += along * (abs(other.vx - child.vx) + abs(other.vy - child.vy))
            turned = abs(other.yaw - child.yaw) + abs(other.turn - child.turn) * motion.turn_rate / (
                2 * motion.turn_acceleration
            )
            is_new = is_new and apart + about * turned > same
        if is_new:
            beam[count] = child
            num_kept[sector] += 1
            count += 1
    return count
