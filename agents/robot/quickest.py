"""The quickest drive to a goal cell, by a beam search over the body's own motion.

A beam has the best states after a number of steps. A state is good if little of the way is left from where the body
would come to rest, and little was driven. The way that is left is computed once for a goal, by fast marching (Sethian
1996) on a grid of nodes. Lengths are metres. Walls are `[N, N]` bool, indexed by the cells' x and y.
"""

from __future__ import annotations

import heapq
import math
from typing import Any, NamedTuple

import numpy as np

from mazebench.constants import NUM_ACTIONS, STEP_TIME
from mazebench.kernels import compiled
from mazebench.world.bodies import Body, RollingBody

from .motion import BEARINGS, Motion, moved, moved_by_each
from .moving_body import LOOK_LEFT, LOOK_RIGHT, STRAFE_LEFT, STRAFE_RIGHT, Point
from .rolling import RollingMotion

_NODES = 5  # a side of a cell
_DETOUR = 3.0  # a metre of a way along which the body touches a wall counts as so many

_TURNS = 2  # looks to either side of the first heading, at most: one of four drives is within 11 degrees of any way
_TURNS_WITHOUT_STRAFING = 5  # one of the other two drives is
_WIDTH = 12  # states of a beam for each heading
_BEHIND = 1.0  # m that a state may be behind the best one
_SAME = 0.04  # m between states that count as the same one
_DRIVEN_WEIGHT = 0.3  # of a metre that was driven against one that is left
_ARRIVED = -1e9  # added to the score of a state in the goal cell: lower than all others

_STEPS_AHEAD, _WIDTH_AHEAD = 6, 2  # of the search that follows each first action in `costs_of_actions`
_STEP_SECONDS = 0.15625  # about a step at the top speed: what a step is worth after which the goal is reached

_State = np.dtype(
    [
        *((name, np.float64) for name in ("x", "y", "vx", "vy", "driven", "score")),  # m, m/s; low scores are good
        *((name, np.int64) for name in ("turns", "action", "parent")),  # looks to the left; how the state came about
    ]
)


class Course(NamedTuple):
    """A maze, a goal in it, and the body that drives there."""

    motion: Any  # a `Motion`, or the `RollingMotion` of a rolling body
    walls: np.ndarray  # [N, N] bool
    cell_size: float  # m
    goal_x: int
    goal_y: int
    way_left: np.ndarray  # [N * _NODES, N * _NODES] float, m, from each node to the goal cell; infinite in walls


def make_course(body: Body, walls: np.ndarray, cell_size: float, goal: tuple[int, int]) -> Course:
    """Returns a body's course to a goal (row, column) in a maze with walls `[N, N]`, indexed by row and column.

    The border is taken for wall, so that no drive leaves the maze.
    """
    by_x_and_y = np.ascontiguousarray(walls[::-1].T)
    by_x_and_y[[0, -1]] = by_x_and_y[:, [0, -1]] = True
    x, y, reach = goal[1], len(walls) - 1 - goal[0], body.reach / (cell_size / _NODES)  # nodes
    if isinstance(body, RollingBody):
        # Rounded: a rolling body needs the middle of a way that is hardly wider than the body.
        left = _way_left(round(reach), by_x_and_y, cell_size, x, y)
        return Course(RollingMotion.of(body), by_x_and_y, cell_size, x, y, left)
    left = _way_left(math.ceil(reach), by_x_and_y, cell_size, x, y)
    return Course(Motion.of(body), by_x_and_y, cell_size, x, y, left)


def quickest_drive(
    course: Course,
    point: Point,
    velocity: Point,
    yaw: float,
    num_steps: int = 0,
    width: int = _WIDTH,
    strafes: bool = True,
) -> tuple[list[int], list[Point]]:
    """Returns the actions of the quickest drive, and the points (x, y) after each of them.

    Of equally quick drives it is the shortest one. If the search does not find the goal in twice the steps that the way
    takes at the top speed, and some to spare, the drive leads as near to the goal as it has come.

    Args:
      course: the way.
      point: (x, y) of the body.
      velocity: (x, y) of the body on the map, in m/s.
      yaw: of the body, in rad.
      num_steps: that are planned at most; 0 for as many as said above.
      width: states of a beam for each heading.
      strafes: whether the body can strafe.
    """
    turns = _TURNS if strafes else _TURNS_WITHOUT_STRAFING
    way_left = way_left_at(course, *point)
    expected = way_left / (course.motion.top_speed * STEP_TIME) if way_left < np.inf else 0.0
    beams = np.zeros(((num_steps or int(2 * expected) + 49) + 1, width * (2 * turns + 1)), _State)
    first = beams[0, 0]
    first["x"], first["y"], first["vx"], first["vy"] = *point, *velocity
    last, index = _search(course, yaw, beams, turns), 0
    drive = []
    for step in range(last, 0, -1):
        state = beams[step, index]
        drive.append((int(state["action"]), (float(state["x"]), float(state["y"]))))
        index = state["parent"]
    actions, points = zip(*drive[::-1], strict=True)
    return list(actions), list(points)


@compiled
def costs_of_actions(
    motion: Motion,
    walls: np.ndarray,
    way_left: np.ndarray,
    goal: np.ndarray,
    cell_size: float,
    pose: np.ndarray,
    velocity: np.ndarray,
) -> np.ndarray:
    """Returns `[B, 6]`: metres of way left after each action and the best steps that a narrow search finds after it.

    Less is better; a goal that is reached early counts as less than no way. Only differences mean something.

    Args:
      motion: of the bodies.
      walls: `[B, N, N]` bool, `Course.walls` of each body's course.
      way_left: `[B, N * 5, N * 5]` float, `Course.way_left`.
      goal: `[B, 2]` int, the goals' x and y in cells.
      cell_size: m.
      pose: `[B, 3]` float, x and y (m) and yaw (rad).
      velocity: `[B, 2]` float, on the map, m/s.
    """
    costs = np.empty((len(pose), NUM_ACTIONS))
    beams = np.zeros((_STEPS_AHEAD + 1, _WIDTH_AHEAD * (2 * _TURNS + 1)), _State)
    for body in range(len(pose)):
        course = Course(motion, walls[body], cell_size, goal[body, 0], goal[body, 1], way_left[body])
        for action in range(NUM_ACTIONS):
            yaw = pose[body, 2] + motion.turn_step * ((action == LOOK_LEFT) - (action == LOOK_RIGHT))
            first = beams[0, 0]
            x, y, vx, vy = pose[body, 0], pose[body, 1], velocity[body, 0], velocity[body, 1]
            first.x, first.y, first.vx, first.vy = moved(motion, course.walls, cell_size, x, y, vx, vy, yaw, action)
            first.driven, first.turns = 0.0, 0
            last = 0
            if int(first.x / cell_size) != course.goal_x or int(first.y / cell_size) != course.goal_y:
                last = _search(course, yaw, beams, _TURNS)
                costs[body, action] = beams[last, 0].score
            if last == 0 or costs[body, action] < 0:
                costs[body, action] = -_STEP_SECONDS * motion.top_speed * (_STEPS_AHEAD - last)
    return costs


@compiled
def _search(course: Course, yaw: float, beams: Any, turns: int) -> int:
    """Fills the beams after the first one; returns the number of steps after which the first state has arrived.

    Headings are at most `turns` looks from the first one; beyond `_TURNS`, the body does not strafe.
    """
    children = np.empty(beams.shape[1] * NUM_ACTIONS, beams.dtype)
    after = np.empty((len(BEARINGS) + 1, 4))  # of the actions of a parent; both looks are the last one
    count = 1
    for step in range(1, len(beams)):
        num_children = 0
        for parent in range(count):
            state = beams[step - 1, parent]
            heading = yaw + course.motion.turn_step * state.turns
            moved_by_each(
                course.motion, course.walls, course.cell_size, state.x, state.y, state.vx, state.vy, heading, after
            )
            for action in range(NUM_ACTIONS):
                if turns > _TURNS and action in (STRAFE_LEFT, STRAFE_RIGHT):
                    continue
                child = children[num_children]
                child.turns = state.turns + (action == LOOK_LEFT) - (action == LOOK_RIGHT)
                if abs(child.turns) <= turns:
                    child.parent, child.action = parent, action
                    _drive(course, state, child, after[min(action, len(BEARINGS))])
                    num_children += 1
        count = _keep_best(course.motion, children[:num_children], beams[step], turns)
        if beams[step, 0].score < 0:
            return step
    return len(beams) - 1


@compiled
def _drive(course: Course, state: Any, child: Any, after: np.ndarray) -> None:
    """Gives the child of a state a position and a velocity, `after` (`[4]` float), and the score that follows."""
    x, y, vx, vy = after
    child.x, child.y, child.vx, child.vy = x, y, vx, vy
    child.driven = state.driven + math.hypot(x - state.x, y - state.y)
    if int(x / course.cell_size) == course.goal_x and int(y / course.cell_size) == course.goal_y:
        child.score = child.driven + _ARRIVED
    else:
        left = way_left_at(course, x + course.motion.coasting_time * vx, y + course.motion.coasting_time * vy)
        if left == np.inf:  # a wall would stop the body
            left = way_left_at(course, x, y)
        child.score = left + _DRIVEN_WEIGHT * child.driven


@compiled
def _keep_best(motion: Motion, children: Any, beam: Any, turns: int) -> int:
    """Puts the best children that differ into a beam, the best one first, some of each heading; returns how many."""
    order = np.argsort(children.score)
    num_kept = np.zeros(2 * turns + 1, np.int64)
    count = 0
    for index in order:
        child = children[index]
        if child.score > children[order[0]].score + _BEHIND:
            break
        is_new = num_kept[child.turns + turns] < len(beam) // len(num_kept)
        for other in beam[:count]:
            apart = abs(other.x - child.x) + abs(other.y - child.y)
            apart += motion.coasting_time * (abs(other.vx - child.vx) + abs(other.vy - child.vy))
            is_new = is_new and (other.turns != child.turns or apart > _SAME)
        if is_new:
            beam[count] = child
            num_kept[child.turns + turns] += 1
            count += 1
    return count


@compiled
def _way_left(reach: int, walls: np.ndarray, cell_size: float, goal_x: int, goal_y: int) -> np.ndarray:
    """Returns `Course.way_left`, for a body that touches walls `reach` nodes from its centre."""
    spacing = cell_size / _NODES
    left = np.full((len(walls) * _NODES, len(walls) * _NODES), np.inf)
    is_done = np.zeros(left.shape, np.bool_)
    queue = [(0.0, goal_x * _NODES + i, goal_y * _NODES + j) for i in range(_NODES) for j in range(_NODES)]
    for _, i, j in queue:
        left[i, j] = 0.0
    while queue:
        _, i, j = heapq.heappop(queue)
        if is_done[i, j]:
            continue
        is_done[i, j] = True
        for a, b in ((i - 1, j), (i, j - 1), (i + 1, j), (i, j + 1)):
            is_inside = _NODES <= a < len(left) - _NODES and _NODES <= b < len(left) - _NODES
            if not is_inside or walls[a // _NODES, b // _NODES] or is_done[a, b]:
                continue
            # A step costs more where the body would touch a wall.
            touches = False
            for x in (a - reach, a, a + reach):
                for y in (b - reach, b, b + reach):
                    touches = touches or walls[x // _NODES, y // _NODES]
            step = spacing * (_DETOUR if touches else 1.0)

            # The eikonal equation with the nearer neighbours along x and y.
            by_x, by_y = min(left[a - 1, b], left[a + 1, b]), min(left[a, b - 1], left[a, b + 1])
            found = min(by_x, by_y) + step
            if abs(by_x - by_y) < step:
                found = (by_x + by_y + math.sqrt(2 * step * step - (by_x - by_y) ** 2)) / 2
            if found < left[a, b]:
                left[a, b] = found
                heapq.heappush(queue, (found, a, b))
    return left


@compiled
def way_left_at(course: Course, x: float, y: float) -> float:
    """Returns the way that is left from a point, between the nodes around it; infinite if they are all in walls."""
    x_in_nodes, y_in_nodes = x * _NODES / course.cell_size - 0.5, y * _NODES / course.cell_size - 0.5
    last = len(course.way_left) - 2
    i, j = min(max(int(x_in_nodes), 0), last), min(max(int(y_in_nodes), 0), last)
    total, weight = 0.0, 0.0
    for a in (i, i + 1):
        for b in (j, j + 1):
            if course.way_left[a, b] < np.inf:
                share = (1 - abs(x_in_nodes - a)) * (1 - abs(y_in_nodes - b))
                total, weight = total + share * course.way_left[a, b], weight + share
    return total / weight if weight > 0 else np.inf
