"""The expert: what each action is worth by the oracle's look-ahead, from the true state of training environments.

Labels are made of the truth, which agents are not shown: they are for training, not for evaluations. `B` is the number
of environments.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import Any

import numpy as np

from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.maps.maze import Cell
from mazebench.maps.moving_doors import StandingMazes
from mazebench.tasks.schedule import Schedule
from mazebench.world.bodies import Body

from .robot.arrival import MovingDoors, earliest_way
from .robot.motion import Motion
from .robot.quickest import costs_of_actions, make_course

# m, of the six actions, where the body waits for a door: it turns to either side.
_OF_WAITING = np.array([0.5, 0.5, 0.5, 0.5, 0.0, 0.0])

_experts: weakref.WeakKeyDictionary[MazeVectorEnv, Expert] = weakref.WeakKeyDictionary()


def labels(envs: MazeVectorEnv, costs: bool = False) -> np.ndarray:
    """Returns what the oracle would do now in each environment, whatever was done before.

        >>> actions = mazebench_agents.expert.labels(envs)
        >>> observation, reward, terminated, truncated, info = envs.step(actions)

    Args:
      envs: of `mazebench.make_vec` with the six actions, also in wrappers; after `reset`.
      costs: whether to return the costs of all six actions.

    Returns:
      `[B]` int, the best actions; with `costs`, `[B, 6]` float: the way (m) that is left some steps after each of the
      actions, less than 0 where the goal is reached by then. Only differences between actions mean something. In the
      hierarchical task, the goal is the next landmark.

    Raises:
      InputError: if `envs` are other environments, have other actions, or were not reset.
    """
    envs = getattr(envs, "unwrapped", envs)
    if not isinstance(envs, MazeVectorEnv):
        raise InputError(f"expected environments of mazebench.make_vec, found {type(envs).__name__}")
    if envs.task.actions != "six":
        raise InputError(f"expected environments with actions 'six', found {envs.task.actions!r}")
    rules = envs.rules
    if not rules.active.any():
        raise InputError("expected a call to reset() before that of labels(), found no episode under way")
    if envs not in _experts:
        _experts[envs] = Expert(envs.task.standing, envs.num_envs, envs.task.body)
    truth = rules.maze, rules.target, rules.pose, envs.velocity()
    found = _experts[envs].costs(*truth, rules.steps, rules.schedules())
    return found if costs else found.argmin(axis=1)


class Expert:
    """Costs of actions in B environments; the ways to a goal are computed once for each leg."""

    def __init__(self, mazes: StandingMazes, num_envs: int, body: Body):
        """Knows `mazes`, which have one size and one cell size, and the body that drives in them.

        Raises:
          InputError: if the body does not slide.
        """
        self._mazes, self._motion, self._body = mazes, Motion.of(body), body
        self._courses: list[Any] = [None] * num_envs  # what each course depends on
        self._arrays: tuple[np.ndarray, ...] = ()  # walls, ways left and goals of the courses
        self._doors: list[tuple[Schedule, MovingDoors, np.ndarray] | None] = [None] * num_envs
        self._last: tuple[list[np.ndarray], np.ndarray] | None = None  # the last arguments of `costs`, and the answer

    def costs(
        self,
        maze: np.ndarray,
        goal: np.ndarray,
        pose: np.ndarray,
        velocity: np.ndarray,
        step: np.ndarray | None = None,
        doors: Sequence[Schedule | None] = (),
    ) -> np.ndarray:
        """Returns the costs `[B, 6]` of the actions, in metres of way left; less is better.

        Where doors move, the way is that of earliest arrival. In the cell before a door that it waits for, turns on the
        spot are best.

        Args:
          maze: `[B]` int, index of the maze of each environment.
          goal: `[B]` int, its goal as row * N + column.
          pose: `[B, 3]` float, true x and y (m) and yaw (rad).
          velocity: `[B, 2]` float, on the map, m/s.
          step: `[B]` int, the steps since the episode began.
          doors: B schedules of doors; None where no door moves, and empty if none does.
        """
        steps = np.zeros(len(goal), dtype=np.int64) if step is None else step
        asked = [maze, goal, pose, velocity, steps]
        if self._last is not None and all(map(np.array_equal, asked, self._last[0])):
            return self._last[1].copy()
        cell_size, waits = self._mazes[0].cell_size, np.zeros(len(goal), dtype=bool)
        for slot, (number, aim, schedule) in enumerate(
            zip(maze.tolist(), goal.tolist(), doors or [None] * len(goal), strict=True)
        ):
            built = self._mazes[number]
            walls, place, key = built.walls, divmod(aim, built.size), (number, aim)
            if schedule is not None:
                cell = built.cell_at(*pose[slot, :2].tolist())
                walls, place, waits[slot], key = self._through_doors(
                    slot, number, schedule, cell, place, int(steps[slot])
                )
            if self._courses[slot] != key:
                self._courses[slot] = key
                made = make_course(self._body, walls, cell_size, place)
                of_course = made.walls, made.way_left, np.array([made.goal_x, made.goal_y])
                if not self._arrays:
                    self._arrays = tuple(np.zeros((len(goal), *array.shape), array.dtype) for array in of_course)
                for arrays, array in zip(self._arrays, of_course, strict=True):
                    arrays[slot] = array
        walls, way_left, goals = self._arrays
        costs = costs_of_actions(self._motion, walls, way_left, goals, cell_size, pose, velocity)
        costs[waits] = _OF_WAITING
        self._last = [array.copy() for array in asked], costs
        return costs.copy()

    def _through_doors(
        self, slot: int, number: int, schedule: Schedule, cell: Cell, goal: Cell, step: int
    ) -> tuple[np.ndarray, Cell, bool, Any]:
        """Returns the walls around the way of earliest arrival, where it leads to now, and whether the body waits.

        The last value tells such courses apart. A door is open if the way leads through it before the first wait.
        """
        if (known := self._doors[slot]) is None or known[0] is not schedule:
            moving, walls = MovingDoors.of(schedule, self._mazes[0].size), self._mazes[number].as_built.walls.copy()
            walls[moving.door >= 0] = False
            known = self._doors[slot] = schedule, moving, walls
        _, moving, walls = known
        way, _, end = earliest_way(walls, moving, cell, goal, step, self._mazes[0].cell_size)
        if not way:  # closed in for good, as a learner may be that strayed: the way as if all doors were open
            return walls, goal, False, (number % len(self._mazes), goal, "open")
        on_way = sorted({int(moving.door[each]) for each in way[: end + 1]} - {-1})
        closed = walls | ((moving.door >= 0) & ~np.isin(moving.door, on_way))
        return closed, way[end], end == 0 and way[end] != goal, (number % len(self._mazes), way[end], *on_way)
