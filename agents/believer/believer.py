"""A navigator that plans over buildings which it draws from its belief over doors."""

from __future__ import annotations

import dataclasses

import numpy as np

from mazebench.agent import Interface
from mazebench.constants import STEP_TIME
from mazebench.kernels import compiled
from mazebench.maps.maze import Cell

from ..navigator.navigator import Navigator, Robot
from ..robot.occupancy import SURE
from ..robot.senses import Memory
from .doors import DoorBelief, Drawn
from .ways import FREE, UNKNOWN, WALL, drive, lines_of_sight, path_of

_NUM_BUILDINGS = 24
_CRISP = 0.39  # difference from a half of the probability of a wall, in each cell of a map that is not drawn by hand
_PLACED = 0.95  # probability of the way in which the map lies, from which that one is believed
# The price of a door, in cells, by the probability p that it is closed: the larger one of these times -log(1 - p), and
# times the odds.
_RISK, _DETOUR = 3.0, 1.0
_PRICES = ((0.0, 1e3), (0.3, 9.0), (1.0, 6.0), (3.0, 8.0), (6.0, 12.0))  # others that are tried: of open, closed doors
_REACH = 3.0  # m, within which a drawn building is seen
_ON_TIME, _WIDTH = 1.21, 0.03  # of the shortest way, by which a drive is on time, and how sharply that is judged
_LATE = 0.02  # what being later by the shortest way costs, in the probability to be on time
_LONGEST = 3.0  # times the shortest way, at which a drive ends
_KEEP = 0.02  # probability by which another path must be better than the one that is followed
_STEPS_PER_CELL = 0.91  # of the oracle's drives, times those at top speed along the sides of cells


class _Way:
    """The way to one goal, on a map that lies in one way."""

    def __init__(self, shown: np.ndarray, memory: Memory, start: Cell, goal: Cell, seed: int):
        self.shown, self.start, self.goal, self._seed = shown, start, goal, seed
        self._doors = DoorBelief(shown, memory.cell_size, start, goal)
        self._known = np.full(shown.shape, UNKNOWN, np.int8)
        self._lines = lines_of_sight(_REACH / memory.cell_size)
        self._path: np.ndarray | None = None
        self._num_plans = 0

    def path(self, memory: Memory, cells_driven: float) -> list[Cell]:
        """Returns the path from the robot's cell: the one before, unless something new of doors or walls is seen."""
        known = np.full(self.shown.shape, UNKNOWN, np.int8)
        known[memory.evidence >= SURE], known[memory.evidence <= -SURE] = WALL, FREE
        known[memory.cell] = FREE
        differs = (known != UNKNOWN) & ((known == WALL) != self.shown)
        is_new = ((known != self._known) & ((self._doors.number >= 0) | differs)).any()
        self._known = known

        size = len(self.shown)
        cell = memory.cell[0] * size + memory.cell[1]
        rest = None if self._path is None else self._path[np.flatnonzero(self._path == cell)[:1].sum() :]
        is_off = rest is None or cell != rest[0]
        self._path = self._plan(memory.cell, None if is_off else rest, cells_driven) if is_new or is_off else rest
        assert self._path is not None
        return list(zip((self._path // size).tolist(), (self._path % size).tolist(), strict=True))

    def _plan(self, cell: Cell, followed: np.ndarray | None, cells_driven: float) -> np.ndarray:
        """Returns the path that is most often on time in buildings that are drawn from the belief."""
        doors, known, size = self._doors, self._known, len(self.shown)
        self._num_plans += 1
        seed = (self._seed + self._num_plans) % 2**31
        drawn = doors.draw(known, cell, self.start, self.goal, _NUM_BUILDINGS, seed)
        prices = np.maximum(-_RISK * np.log(1 - drawn.closed), _DETOUR * drawn.closed / (1 - drawn.closed))
        ends = cell[0] * size + cell[1], self.goal[0] * size + self.goal[1]

        # The path that is followed; the cheapest ones by belief and by other prices; some around their next door.
        paths = [path_of(known, self.shown, doors.number, prices, *ends, -1)]
        if followed is not None and len(followed) > 1 and not (known.ravel()[followed] == WALL).any():
            paths.insert(0, followed)
        for of_open, of_closed in _PRICES:
            given = np.where(doors.is_open, of_open, of_closed)
            paths.append(path_of(known, self.shown, doors.number, given, *ends, -1))
        for path in paths[:2]:
            unknown = path[(known.ravel()[path] == UNKNOWN) & (doors.number.ravel()[path] >= 0)]
            if len(unknown):
                avoided = int(doors.number.ravel()[unknown[0]])
                paths.append(path_of(known, self.shown, doors.number, prices, *ends, avoided))
        paths = list({path.tobytes(): path for path in paths if len(path) > 1}.values())
        if len(paths) < 2 or not len(drawn.walls):
            return paths[0] if paths else np.array(ends[:1])

        scores = np.array(
            [
                _score(drawn, known, self.shown, doors.number, prices, path, ends[1], cells_driven, self._lines)
                for path in paths
            ]
        )
        scores[1:] -= _KEEP
        return paths[int(scores.argmax())]


@compiled
def _score(
    drawn: Drawn, known: np.ndarray, shown: np.ndarray, door: np.ndarray, prices: np.ndarray, path: np.ndarray,
    goal: int, cells_driven: float, lines: np.ndarray,
) -> float:  # fmt: skip
    """Returns how probably a drive that begins along a path is on time, less what being late costs."""
    score = 0.0
    for index in range(len(drawn.walls)):
        shortest = drawn.lengths[index]
        most = max(0.0, _LONGEST * shortest - cells_driven)
        steps = drive(drawn.walls[index], known.copy(), shown, door, prices, path, goal, most, lines)
        times = min((cells_driven + steps) / shortest, _LONGEST)
        score += 1 / (1 + np.exp((times - _ON_TIME) / _WIDTH)) - _LATE * times
    return score / len(drawn.walls)


@dataclasses.dataclass
class BelievingRobot(Robot):
    """The robot in one environment, with its belief."""

    seed: int = 0
    way: _Way | None = None
    placement: tuple[int, int, int] | None = None  # of the map that the way is on
    goals: np.ndarray | None = None  # of the leg that it drives, by which legs are told apart
    leg_start: Cell = (0, 0)
    leg_steps: int = 0


class Believer(Navigator):
    """Drives as the navigator does, along paths that it chooses by a belief over the doors that have moved.

    It does so where a map with a pixel for each cell lies in a known way. Elsewhere, and once doors move while it
    drives, it chooses as the navigator does.
    """

    def __init__(self, interface: Interface):
        """Acts in the environments of the interface, as the navigator."""
        super().__init__(interface)
        self._cells_per_step = interface.body.top_speed * STEP_TIME / (interface.cell_size * _STEPS_PER_CELL)

    def begin(self, memory: Memory, seed: int) -> Robot:
        """Returns the robot of an episode, whose buildings are drawn with `seed`."""
        return BelievingRobot(memory, self._passages(memory), seed=seed)

    def find_path(self, robot: Robot, walls: np.ndarray, goal: np.ndarray, closed: np.ndarray | None) -> list[Cell]:
        """Returns the cells of the path from the robot's cell, as the navigator does."""
        assert isinstance(robot, BelievingRobot)
        memory = robot.memory
        if robot.goals is not memory.belief.goals:
            robot.goals, robot.leg_start, robot.leg_steps, robot.way = memory.belief.goals, memory.cell, 0, None
        placement = memory.belief.likeliest(_PLACED)
        if placement != robot.placement:
            robot.placement, robot.way = placement, None
        if placement is not None and robot.way is None:
            robot.way = self._way(robot, placement)
        robot.leg_steps += 1
        if robot.way is None or closed is not None or memory.cell == robot.way.goal:
            return super().find_path(robot, walls, goal, closed)
        path = robot.way.path(memory, (robot.leg_steps - 1) * self._cells_per_step)
        return path if len(path) > 1 else super().find_path(robot, walls, goal, closed)

    def _way(self, robot: BelievingRobot, placement: tuple[int, int, int]) -> _Way | None:
        """Returns the way to the leg's goal on the map as it lies; None if the map is vague, or shows no goal."""
        walls, goals = robot.memory.belief.laid(placement)
        goal = divmod(int(goals.argmax()), len(goals))
        if (np.abs(walls - 0.5) < _CRISP).any() or goals[goal] < 0.5 or walls[goal] == 1:
            return None
        return _Way(walls > 0.5, robot.memory, robot.leg_start, goal, robot.seed)
