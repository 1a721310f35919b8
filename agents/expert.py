"""The expert: what each action is worth by the oracle's look-ahead, from the true state of training environments.

Labels are made of the truth, which agents are not shown: they are for training, not for evaluations. `B` is the number
of environments.
"""

from __future__ import annotations

import weakref

import numpy as np

from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.maps.drawn import Mazes
from mazebench.world.bodies import Body

from .robot.motion import Motion
from .robot.quickest import costs_of_actions, make_course

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
        _experts[envs] = Expert(envs.task.mazes, envs.num_envs, envs.task.body)
    found = _experts[envs].costs(rules.maze, rules.target, rules.pose, envs.velocity())
    return found if costs else found.argmin(axis=1)


class Expert:
    """Costs of actions in B environments; the ways to a goal are computed once for each leg."""

    def __init__(self, mazes: Mazes, num_envs: int, body: Body):
        """Knows `mazes`, which have one size and one cell size, and the body that drives in them.

        Raises:
          InputError: if the body does not slide.
        """
        self._mazes, self._motion, self._body = mazes, Motion.of(body), body
        self._courses: list[tuple[int, int] | None] = [None] * num_envs  # maze and goal of each course
        self._arrays: tuple[np.ndarray, ...] = ()  # walls, ways left and goals of the courses
        self._last: tuple[list[np.ndarray], np.ndarray] | None = None  # the last arguments of `costs`, and the answer

    def costs(self, maze: np.ndarray, goal: np.ndarray, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Returns the costs `[B, 6]` of the actions, in metres of way left; less is better.

        Args:
          maze: `[B]` int, index of the maze of each environment.
          goal: `[B]` int, its goal as row * N + column.
          pose: `[B, 3]` float, true x and y (m) and yaw (rad).
          velocity: `[B, 2]` float, on the map, m/s.
        """
        asked = [maze, goal, pose, velocity]
        if self._last is not None and all(map(np.array_equal, asked, self._last[0])):
            return self._last[1].copy()
        for slot, course in enumerate(zip(maze.tolist(), goal.tolist(), strict=True)):
            if self._courses[slot] != course:
                self._courses[slot] = course
                walls = np.asarray(self._mazes[course[0]].walls)
                made = make_course(self._body, walls, self._mazes[course[0]].cell_size, divmod(course[1], len(walls)))
                of_course = made.walls, made.way_left, np.array([made.goal_x, made.goal_y])
                if not self._arrays:
                    self._arrays = tuple(np.zeros((len(goal), *array.shape), array.dtype) for array in of_course)
                for arrays, array in zip(self._arrays, of_course, strict=True):
                    arrays[slot] = array
        walls, way_left, goals = self._arrays
        cell_size = self._mazes[0].cell_size
        costs = costs_of_actions(self._motion, walls, way_left, goals, cell_size, pose, velocity)
        self._last = [array.copy() for array in asked], costs
        return costs.copy()
