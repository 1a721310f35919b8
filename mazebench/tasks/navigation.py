"""The navigation task and its environment on dm_control."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import dm_env
import numpy as np
from dm_control.rl import control
from dm_env import specs

from mazebench.errors import InputError
from mazebench.maps.maze import Maze
from mazebench.tasks.actions import VELOCITY_SIZE, controls_of_action, controls_of_velocities
from mazebench.tasks.arguments import Arguments, require_task_spec
from mazebench.tasks.episode import Episode, check_episode, sample_episode
from mazebench.tasks.observation import OpenSensors, observation_specs, state_errors
from mazebench.tasks.route import Event, plan_route
from mazebench.tasks.sensors.base import Worlds
from mazebench.tasks.shown_map import leg_context, show_map
from mazebench.tasks.spec import TaskSpec
from mazebench.world.mjcf import ACTIONS, STEPS_PER_ACTION
from mazebench.world.models import models_of
from mazebench.world.physics import Physics

# Attributes of a `Navigation` that are not part of its state, and others that are replaced but never changed. Copying
# the generator takes as long as copying all the rest, so its state is kept instead.
_NO_STATE = ("spec", "rng", "_models", "_sensors")
_REPLACED = ("episode", "shown_map", "_context")


class Navigation(control.Task):
    """Drive to the goal cell of a maze that was never seen before, with a map of it.

    Actions: one of six, 0.16 s each: forward, backward, strafe_left, strafe_right, look_left, look_right. With
    `continuous`, `[3]` velocities for 0.16 s, each in [-1, 1]: forward and left as shares of the top speed (together no
    faster than it), turning to the left as a share of the turn rate.

    Observations:

    - state: `[12]` float32: x, y, z (m); roll, pitch, yaw (rad, yaw in [-pi, pi)); velocity forward, left, up (m/s);
      angular velocity about the body's x, y, z (rad/s). With `position_noise`, x and y are noisy.
    - context: `[4, M, M]` float32, constant until the next landmark: the map, the map around the start, goal, start.
    - is_first: bool, only if episodes may have several legs: whether this context is new.
    - egocentric, top, chase: `[H, H, 3]` uint8, if `sensors` names them: pictures of the true world, with a marker at
      the goal.
    - lidar: `[32]` float32, if `sensors` names it: metres from the body's centre to the nearest wall of the true maze,
      at most 5, along horizontal rays; the first straight ahead, then counter-clockwise every 360 / 32 degrees.

    Reward: -1 for each step, 0 for the step that reaches the goal cell; there is no discount on the way.

    Termination: when the body's centre is in the goal cell after a step (discount 0). Otherwise the episode is
    truncated (discount 1) after `time_limit` steps, in the hierarchical task of the last leg. A goal that is
    entered on the last step is reached.
    """

    def __init__(self, spec: TaskSpec, rng: np.random.Generator):
        self.spec = spec
        self.rng = rng
        self.path_length = 0.0  # m, driven since the start of the episode
        self.steps = 0  # agent steps since the start of the episode
        self._next_episode: Episode | None = None
        self._maze = 0  # index of the maze that the physics has
        self._event = Event.NONE
        self._models = models_of(spec.mazes)
        self._sensors = OpenSensors(spec)

    def set_next_episode(self, episode: Episode) -> None:
        """Makes the next reset play `episode` instead of a drawn one.

        Raises:
          InputError: if it can't be played in this task's mazes.
        """
        self._next_episode = check_episode(self.spec, episode)

    @property
    def success(self) -> bool:
        """Whether the goal has been reached."""
        return self._event is Event.REACHED

    @property
    def maze(self) -> int:
        """The index of the maze that the physics has, among the task's mazes."""
        return self._maze

    @property
    def is_first(self) -> bool:
        """Whether the context is new, which it is when an episode or a leg begins."""
        return self._is_first

    def initialize_episode(self, physics: Physics) -> None:
        self.episode = self._next_episode or sample_episode(self.spec, self.rng)
        self._next_episode = None
        episode = self.episode
        self._load_maze(physics, episode.maze)
        start = self.spec.mazes[episode.maze].point(episode.start)
        self._position: tuple[float, float] = (float(start[0]), float(start[1]))
        physics.place_agent(start, episode.yaw)
        self.shown_map = show_map(self.spec, episode)
        self.route = plan_route(self.spec, episode, self.shown_map)
        self._state_errors = state_errors(self.spec, episode)
        self.path_length, self.steps, self._event = 0.0, 0, Event.NONE
        self._begin_leg(physics)

    def _load_maze(self, physics: Physics, index: int) -> None:
        physics.load_maze(self._models[index])
        self._maze = index

    def before_step(self, action: int | np.ndarray, physics: Physics) -> None:
        if self.spec.continuous:
            physics.set_controls(controls_of_velocities(np.asarray(action), (VELOCITY_SIZE,)))
        else:
            physics.set_controls(controls_of_action(action))  # type: ignore[arg-type]

    def after_step(self, physics: Physics) -> None:
        x, y = physics.position().tolist()
        moved_x, moved_y = x - self._position[0], y - self._position[1]
        self.path_length += math.sqrt(moved_x * moved_x + moved_y * moved_y)
        self._position = (x, y)
        self.steps += 1
        self._event = self.route.advance(self.spec.mazes[self._maze].cell_at(x, y), self.steps)
        self._is_first = False
        if self._event is Event.LANDMARK:
            self._begin_leg(physics)

    def _begin_leg(self, physics: Physics) -> None:
        self._context = leg_context(self.spec, self.shown_map, self.route.start, self.route.target)
        self._is_first = True
        physics.place_goal(self.spec.mazes[self._maze].point(self.route.goal))

    def get_observation(self, physics: Physics) -> dict[str, np.ndarray]:
        state = physics.state()
        for add_error in self._state_errors:
            add_error(state)
        observation = {"state": state.astype(np.float32), "context": self._context.copy()}
        if self.spec.has_legs:
            observation["is_first"] = np.array(self._is_first)
        if self.spec.sensors:
            world = Worlds(np.array([self.episode.maze]), physics.data.qpos[None], physics.data.mocap_pos)
            observation |= {name: values[0] for name, values in self._sensors.read(world).items()}
        return observation

    def get_reward(self, physics: Physics) -> float:
        return 0.0 if self.success else -1.0

    def get_termination(self, physics: Physics) -> float | None:
        return {Event.REACHED: 0.0, Event.TIMEOUT: 1.0}.get(self._event)

    def action_spec(self, physics: Physics) -> specs.DiscreteArray | specs.BoundedArray:
        if self.spec.continuous:
            return specs.BoundedArray((VELOCITY_SIZE,), np.float32, -1.0, 1.0, name="action")
        return specs.DiscreteArray(len(ACTIONS), name="action")

    def observation_spec(self, physics: Physics) -> dict[str, specs.Array]:
        result = observation_specs(self.spec)
        if self.spec.has_legs:
            result["is_first"] = specs.Array((), bool, name="is_first")
        return result

    def get_state(self, physics: Physics) -> EnvironmentState:
        """Returns all that the future of the task and its physics depends on."""
        changing = {name: value for name, value in vars(self).items() if name not in _NO_STATE}
        maze, rng_state = self.spec.mazes[self._maze], self.rng.bit_generator.state
        return EnvironmentState(maze, physics.full_state(), rng_state, _copied(changing))

    def set_state(self, state: EnvironmentState, physics: Physics) -> None:
        """Goes back to a state.

        Raises:
          InputError: if it is of an environment with other mazes.
        """
        index = state.task["_maze"]
        if self.spec.mazes[index : index + 1] != (state.maze,):
            raise InputError(f"expected a state of an environment with the same mazes, found one of {state.maze.name}")
        self._load_maze(physics, index)
        physics.set_full_state(state.physics)
        self.rng.bit_generator.state = state.rng
        self.__dict__.update(_copied(state.task))

    def close(self) -> None:
        """Closes the sensors."""
        self._sensors.close()


class EnvironmentState(NamedTuple):
    """A moment of an environment. Its content is the environment's own matter; it can be pickled."""

    maze: Maze
    physics: np.ndarray  # [S], see `Physics.full_state`
    rng: Mapping[str, Any]  # of NumPy's bit generator that draws episodes
    task: dict[str, Any]  # attributes of the `Navigation`
    needs_reset: bool = False


def _copied(attributes: dict[str, Any]) -> dict[str, Any]:
    """Returns a copy of attributes of a `Navigation` that shares what is never changed."""
    shared = {id(attributes[name]): attributes[name] for name in _REPLACED if name in attributes}
    return copy.deepcopy(attributes, shared)


class Environment(control.Environment):
    """A dm_control Environment whose `reset` also takes a seed, or the episode to play."""

    physics: Physics
    task: Navigation

    def __init__(self, spec: TaskSpec, seed: int | None = None):
        """Opens the environment; `seed` is that of the first reset.

        Raises:
          InputError: if `seed` is not a natural number, or `spec` not a `TaskSpec`.
        """
        require_task_spec(spec)
        task = Navigation(spec, np.random.default_rng(Arguments(seed=seed).seed))
        # The task judges the time limit itself, so that a goal reached on the last step is a termination.
        super().__init__(Physics.of_maze(models_of(spec.mazes)[0]), task, n_sub_steps=STEPS_PER_ACTION)

    def reset(self, seed: int | None = None, episode: Episode | None = None) -> dm_env.TimeStep:
        """Starts an episode: the next one of the environment's stream, the first one of `seed`'s, or `episode`."""
        if seed is not None:
            self.task.rng = np.random.default_rng(Arguments(seed=seed).seed)
        if episode is not None:
            self.task.set_next_episode(episode)
        return super().reset()

    @property
    def needs_reset(self) -> bool:
        """Whether no episode is under way; `step` would then start one."""
        return self._reset_next_step

    def get_state(self) -> EnvironmentState:
        """Returns this moment of the environment, to go back to with `set_state` as often as you like."""
        return self.task.get_state(self.physics)._replace(needs_reset=self.needs_reset)

    def set_state(self, state: EnvironmentState) -> None:
        """Goes back to a state of this environment, or of another one of the same task.

        From there, the same actions lead to the same time steps bit for bit, and so do the episodes that follow. The
        observation at the state itself is the one that was returned before `get_state`.

        Raises:
          InputError: if it is a state of an environment with other mazes.
        """
        self.task.set_state(state, self.physics)
        self._reset_next_step = state.needs_reset

    def close(self) -> None:
        self.task.close()

    def reward_spec(self) -> specs.BoundedArray:
        return specs.BoundedArray((), float, -1.0, 0.0, name="reward")
