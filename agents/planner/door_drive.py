"""A drive to a goal through doors that move: it takes the way of earliest arrival and waits where that is quicker."""

from __future__ import annotations

import enum
import math
from typing import NamedTuple

import numpy as np

from mazebench.maps.maze import Cell, cell_of_point
from mazebench.tasks.schedule import FOREVER, Schedule
from mazebench.world.bodies import Body

from ..robot.arrival import MovingDoors, earliest_way, free_from
from ..robot.motion import moved
from ..robot.moving_body import LOOK_LEFT, LOOK_RIGHT, Point
from ..robot.quickest import Course, make_course, quickest_drive

_MAX_OFF = 0.1  # m from where the drive should be, before it is planned anew
_CLEAR = 0.02  # m beyond where walls begin to push, that a drive keeps from closed doors
_BEFORE = 0.5  # m, at least, from a closed door to the cell in which the body waits for it
_REST = 3  # steps in which a body that is let go comes to rest
_IN_SIGHT = 4  # steps ahead in which a robot that knows no times looks for closed doors
_SLOW = 0.3  # m/s, at which a body counts as waiting


_PACES = (0.6, 0.85, 1.0, 1.15)  # of the usual one, for which ways are tried
_MOST_TRIES = 8
_LONGEST_WAIT = 600  # steps
_NEVER = 1e6  # steps, by which a drive with a wait is worse for who does not wait


class Policy(enum.Enum):
    """The knowledge that a driver has of the doors, and its way to deal with closed ones."""

    KNOWS = "knows the times, and waits where that is quicker"
    HURRIES = "knows the times, and does not wait unless there is no other way"
    WAITS = "knows no times, and waits at each closed door"


class _Try(NamedTuple):
    """A drive that may be taken."""

    steps: float  # until it is at the goal
    course: Course
    way: list[Cell]
    doors: tuple[int, ...]  # that it leads through
    actions: list[int]
    points: list[Point]  # after each action
    conflict: int | None  # the first door that is closed when it comes there


class DoorDrive:
    """The drive of one body in one episode."""

    def __init__(self, body: Body, cell_size: float, schedule: Schedule, walls: np.ndarray, policy: Policy):
        """`walls` are those before any door moves, `[N, N]` bool."""
        self._body, self._cell_size, self._schedule, self._policy = body, cell_size, schedule, policy
        self._walls = walls.copy()  # with all doors open that move
        self._doors = MovingDoors.of(schedule, len(walls))
        self._walls[self._doors.door >= 0] = False
        if policy is Policy.WAITS:  # it takes the way that the map shows
            never = np.array([FOREVER, 1, FOREVER])
            self._doors = self._doors._replace(times=np.broadcast_to(never, self._doors.times.shape).copy())
        self._boxes = np.array([schedule.box(number) for number in self._doors.numbers.tolist()]).reshape(-1, 4)
        self._courses: dict[tuple[Cell, tuple[int, ...]], Course] = {}
        self._step, self._moved = 0, 0  # the time, and the set of doors that have moved
        self._goal: Cell | None = None
        self._velocity: Point = (0.0, 0.0)
        self._actions: list[int] = []
        self._points: list[Point] = []  # where each action begins
        self._open: tuple[int, ...] = ()  # the doors on the way
        self._course: Course | None = None
        self._waits_for: int | None = None  # a door that is closed now, of who knows no times

    def act(self, point: Point, yaw: float, goal: Cell) -> int:
        """Returns the next action of a body at a point (x, y; m) with a heading (rad), to a goal cell."""
        if self._step:
            self._moved = self._schedule.moved_after(self._step, self._moved, point)
        if goal != self._goal:
            self._goal, self._actions = goal, []
        if (
            self._actions
            and self._policy is Policy.WAITS
            and self._conflict(self._points[1:], _IN_SIGHT, self._open) is not None
        ):
            self._actions = []
        if self._waits_for is not None and self._is_closed(self._waits_for, self._moved):
            self._wait(point, 1)
        elif not self._actions or math.dist(self._points[0], point) > _MAX_OFF:
            self._waits_for = None
            self._plan(point, yaw, goal)
        action = self._actions.pop(0)
        self._points.pop(0)
        assert self._course is not None
        # Computed, and not observed: what is observed may be wrong.
        motion, walls = self._course.motion, self._course.walls
        *_, vx, vy = moved(motion, walls, self._cell_size, *point, *self._velocity, yaw, action)
        self._velocity = vx, vy
        self._step += 1
        return action

    def _plan(self, point: Point, yaw: float, goal: Cell) -> None:
        """Plans the actions that come next, and the points where they begin."""
        start = self._cell(point)
        best = min(self._tries(point, yaw, start, goal), key=lambda each: each.steps)
        self._course, self._open, actions, points = best.course, best.doors, best.actions, best.points
        if best.conflict is None:
            self._actions, self._points = actions, [point, *points]
            return
        if self._policy is Policy.WAITS:
            self._waits_for = best.conflict
            self._wait(point, 1)
            return
        door, way, doors, course = best.conflict, best.way, best.doors, best.course

        # It waits where it stands if it stands before the door, or else drives there.
        is_slow = math.hypot(*self._velocity) < _SLOW
        place = self._place_before(door, way)
        if not is_slow or start != place:
            doors = tuple(each for each in doors if each != door)
            course = self._course_of(place, doors) if place != start else course
            if place != start:
                actions, points = quickest_drive(course, point, self._velocity, yaw)
                if self._conflict(points, len(points), doors) is None:
                    self._course, (self._actions, self._points) = course, (actions, [point, *points])
                    return
            self._wait(point, _REST if not is_slow else 1)
            return
        for delay in range(1, _LONGEST_WAIT):
            late = self._conflict([*[point] * delay, *points], delay + len(points), doors, delay)
            if late is None or late[0] != door:
                break
        else:
            delay = _REST
        self._wait(point, delay)  # and plans anew

    def _wait(self, point: Point, steps: int) -> None:
        """Turns to and fro for some steps."""
        self._actions = [LOOK_LEFT if step % 2 == 0 else LOOK_RIGHT for step in range(steps)]
        self._points = [point] * (steps + 1)

    def _tries(self, point: Point, yaw: float, start: Cell, goal: Cell) -> list[_Try]:
        """Returns drives along ways of earliest arrival, for bodies of several paces and without doors that are shut.

        A door that is closed when the body comes to it is shut in another try.
        """
        tries: list[_Try] = []
        queue: list[frozenset[int]] = [frozenset()]
        for shut in queue:
            for pace in _PACES if self._policy is not Policy.WAITS else (1.0,):
                way = self._way(start, goal, shut, pace)
                doors = tuple(sorted({int(self._doors.door[cell]) for cell in (start, *way)} - {-1}))
                if not way or any(doors == each.doors for each in tries):
                    continue
                course = self._course_of(goal, doors)
                actions, points = quickest_drive(course, point, self._velocity, yaw)
                ahead = _IN_SIGHT if self._policy is Policy.WAITS else len(points)
                steps, conflict = float(len(points)), self._conflict(points, ahead, doors)
                if conflict is not None:
                    door, ahead = conflict
                    opens = free_from(self._step + ahead, self._doors.is_open[door], self._doors.times[door])
                    steps += opens - self._step - ahead + (_NEVER if self._policy is Policy.HURRIES else 0)
                    if len(tries) < _MOST_TRIES and (more := shut | {door}) not in queue and door not in shut:
                        queue.append(more)
                tries.append(_Try(steps, course, way, doors, actions, points, conflict and conflict[0]))
        return tries

    def _way(self, start: Cell, goal: Cell, shut: frozenset[int], pace: float) -> list[Cell]:
        """Returns the way of earliest arrival that leads through no `shut` door; an empty one where there is none.

        Who does not wait takes a way on which it does if there is no other one.
        """
        walls = self._walls
        if shut:
            walls = walls | np.isin(self._doors.door, list(shut))
        place = start, goal, self._step, self._cell_size, pace
        way = earliest_way(walls, self._doors, *place, waits=self._policy is not Policy.HURRIES)[0]
        return way or earliest_way(walls, self._doors, *place)[0]

    def _course_of(self, goal: Cell, doors: tuple[int, ...]) -> Course:
        """Returns the course to a goal with some of the moving doors open, and no other one."""
        if (goal, doors) not in self._courses:
            walls = self._walls | ((self._doors.door >= 0) & ~np.isin(self._doors.door, doors))
            self._courses[goal, doors] = make_course(self._body, walls, self._cell_size, goal)
        return self._courses[goal, doors]

    def _conflict(
        self, points: list[Point], steps: int, doors: tuple[int, ...], delay: int = 0
    ) -> tuple[int, int] | None:
        """Returns the one of some doors that is closed when the body comes to it, and when, on a drive to points.

        It may be in the first points, up to `delay`, in which the body waits for it.
        """
        near = self._body.reach + _CLEAR
        moved_doors = self._moved
        for ahead, point in enumerate(points[:steps]):
            left, low, right, high = self._boxes.T
            far_x = np.maximum(np.maximum(left - point[0], point[0] - right), 0)
            far_y = np.maximum(np.maximum(low - point[1], point[1] - high), 0)
            touches = np.flatnonzero(far_x * far_x + far_y * far_y < near * near)
            now = moved_doors
            if self._policy is not Policy.WAITS:
                moved_doors = self._schedule.moved_after(self._step + ahead + 1, moved_doors, point)
            for index in set(doors) & set(touches.tolist()) if ahead >= delay else ():
                if self._is_closed(index, now) or self._is_closed(index, moved_doors):
                    return index, ahead
        return None

    def _is_closed(self, door: int, moved_doors: int) -> bool:
        """Returns whether a door is closed when a set of doors has moved."""
        return bool(moved_doors >> int(self._doors.numbers[door]) & 1) == self._doors.is_open[door]

    def _place_before(self, door: int, way: list[Cell]) -> Cell:
        """Returns the cell of a way in which the body waits for a door on it."""
        first = next((index for index, cell in enumerate(way) if self._doors.door[cell] == door), 1)
        return way[max(0, first - max(1, round(_BEFORE / self._cell_size)))]

    def _cell(self, point: Point) -> Cell:
        return cell_of_point(point[0] / self._cell_size, point[1] / self._cell_size, len(self._walls))
