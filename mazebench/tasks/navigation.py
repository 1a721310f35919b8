"""The navigation task: how an episode begins, what a step leads to, and what is observed."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from dm_env import specs

from mazebench.constants import ACTIONS
from mazebench.errors import InputError
from mazebench.maps.maze import Maze
from mazebench.tasks.actions import VELOCITY_SIZE, controls_of_action, controls_of_velocities
from mazebench.tasks.arguments import Arguments, require_task_spec
from mazebench.tasks.episode import Episode, check_episode, sample_episode
from mazebench.tasks.observation import OpenSensors, lidar_noise, observation_specs, state_errors
from mazebench.tasks.perturbations.perturbation import ShownMap, StateError
from mazebench.tasks.route import Event, Route, plan_route
from mazebench.tasks.sensors.sensor import Worlds
from mazebench.tasks.shown_map import leg_context, show_map
from mazebench.tasks.task import Task
from mazebench.world.models import models_of
from mazebench.world.simulation import Simulation

_DISCOUNTS = {Event.REACHED: 0.0, Event.TIMEOUT: 1.0}
# Attributes of a `Navigation` that are not part of its state. Copying the generator takes as long as copying all the
# rest, so a state has the generator's state instead.
_NO_STATE = ("spec", "rng", "_models", "_sensors")
# Attributes whose values are never changed in place, so that copies share them.
_SHARED = ("episode", "shown_map", "_context")


class Navigation:
    """Drive to the goal cell of a maze that was never seen before, with a map of it.

    Its methods are those of a dm_control task. An environment calls them with the simulation that it steps.

    Actions: one of six, 0.16 s each: forward, backward, strafe_left, strafe_right, look_left, look_right. With
    `continuous`, `[3]` velocities for 0.16 s, each in [-1, 1]: forward and left as shares of the top speed (together no
    faster than it), turning to the left as a share of the turn rate.

    Observations:

    - state: `[12]` float32: x, y, z (m); roll, pitch, yaw (rad, yaw in [-pi, pi)); velocity forward, left, up (m/s);
      angular velocity about the body's x, y, z (rad/s). With `position_noise`, x and y are noisy; with
      `odometry_noise`, the pose and the velocities are.
    - context: `[4, M, M]` float32, constant until the next landmark: the map, the map around the start, goal, start.
    - is_first: bool, only if episodes may have several legs: whether this context is new.
    - egocentric, top, chase: `[H, H, 3]` uint8, if `sensors` names them: pictures of the true world, with a marker at
      the goal.
    - lidar: `[32]` float32, if `sensors` names it: metres from the body's centre to the nearest wall of the true maze,
      at most 5, along horizontal rays; the first straight ahead, then counter-clockwise every 360 / 32 degrees. With
      `lidar_noise`, they are noisy, and may reach less far.

    Reward: -1 for each step, 0 for the step that reaches the goal cell; there is no discount on the way.

    Termination: when the body's centre is in the goal cell after a step (discount 0). Otherwise the episode is
    truncated (discount 1) after `time_limit` steps, in the hierarchical task of the last leg. A goal that is
    entered on the last step is reached.
    """

    # Of the running episode, from the first `initialize_episode` on.
    episode: Episode
    shown_map: ShownMap
    route: Route
    _state_errors: list[StateError]
    _lidar_noise: np.random.Generator | None
    _position: tuple[float, float]  # x, y (m) of the body after the last step
    _context: np.ndarray  # of the current leg
    _is_first: bool

    def __init__(self, spec: Task, seed: int | None = None):
        """`seed` is that of the stream from which episodes are drawn.

        Raises:
          InputError: if `seed` is not a natural number, or `spec` not a `Task`.
        """
        require_task_spec(spec)
        self.spec = spec
        self.rng = np.random.default_rng(Arguments(seed=seed).seed)
        self.path_length = 0.0  # m, driven since the start of the episode
        self.steps = 0  # agent steps since the start of the episode
        self._next_episode: Episode | None = None
        self._maze = 0  # index of the maze that the simulation has
        self._event = Event.NONE
        self._models = models_of(spec.all_mazes)
        self._sensors = OpenSensors(spec)

    def choose_episode(self, seed: int | None = None, episode: Episode | None = None) -> None:
        """Makes the next reset begin the stream of episodes of `seed`, or play `episode` instead of a drawn one.

        Raises:
          InputError: if `seed` is not a natural number, or the episode can't be played in this task's mazes.
        """
        if seed is not None:
            self.rng = np.random.default_rng(Arguments(seed=seed).seed)
        if episode is not None:
            self._next_episode = check_episode(self.spec, episode)

    @property
    def success(self) -> bool:
        """True if the goal has been reached."""
        return self._event is Event.REACHED

    @property
    def maze(self) -> int:
        """The index of the maze that the simulation has, among the task's mazes."""
        return self._maze

    @property
    def is_first(self) -> bool:
        """True if the context is new, which it is when an episode or a leg begins."""
        return self._is_first

    def initialize_episode(self, simulation: Simulation) -> None:
        """Draws an episode, or takes the chosen one, and places body and goal; call it within `reset_context()`."""
        episode = self._next_episode or sample_episode(self.spec, self.rng)
        self._next_episode = None
        self.episode = episode

        # The body in its maze.
        self._load_maze(simulation, episode.maze)
        start = self.spec.all_mazes[episode.maze].point(episode.start)
        simulation.place_agent(start, episode.yaw)

        # What the agent is shown, and where it is sent.
        self.shown_map = show_map(self.spec, episode)
        self.route = plan_route(self.spec, episode, self.shown_map)
        self._state_errors = state_errors(self.spec, episode)
        self._lidar_noise = lidar_noise(self.spec, episode)

        # What steps add to.
        self._position = (float(start[0]), float(start[1]))
        self.path_length = 0.0
        self.steps = 0
        self._event = Event.NONE
        self._begin_leg(simulation)

    def _load_maze(self, simulation: Simulation, index: int) -> None:
        simulation.load_maze(self._models, index)
        self._maze = index

    def before_step(self, action: int | np.ndarray, simulation: Simulation) -> None:
        """Sets the controls of an action.

        Raises:
          InputError: if there is no such action.
        """
        if self.spec.continuous:
            simulation.set_controls(controls_of_velocities(np.asarray(action), (VELOCITY_SIZE,)))
        else:
            simulation.set_controls(controls_of_action(action))  # type: ignore[arg-type]

    def after_step(self, simulation: Simulation) -> None:
        """Takes note of what the action led to."""
        x, y = simulation.position().tolist()
        last_x, last_y = self._position
        moved_x, moved_y = x - last_x, y - last_y
        self.path_length += math.sqrt(moved_x * moved_x + moved_y * moved_y)
        self._position = (x, y)
        self.steps += 1

        self._event = self.route.advance(self.spec.all_mazes[self._maze].cell_at(x, y), self.steps)
        self._is_first = False
        if self._event is Event.LANDMARK:
            self._begin_leg(simulation)

    def _begin_leg(self, simulation: Simulation) -> None:
        self._context = leg_context(self.spec, self.shown_map, self.route.start, self.route.target)
        self._is_first = True
        simulation.place_goal(self.spec.all_mazes[self._maze].point(self.route.goal))

    def get_observation(self, simulation: Simulation) -> dict[str, np.ndarray]:
        """Returns the observation of the present moment; noise is drawn anew with each call."""
        state = simulation.state()
        for add_error in self._state_errors:
            add_error(state)
        observation = {"state": state.astype(np.float32), "context": self._context.copy()}
        if self.spec.has_legs:
            observation["is_first"] = np.array(self._is_first)
        if self.spec.sensors:
            world = Worlds(
                maze=np.array([self.episode.maze]),
                pose=simulation.data.qpos[None],
                marker=simulation.data.mocap_pos,
                noise=[self._lidar_noise],
            )
            observation |= {name: values[0] for name, values in self._sensors.read(world).items()}
        return observation

    def get_reward(self, simulation: Simulation) -> float:
        """Returns 0 if the goal has been reached, else -1."""
        return 0.0 if self.success else -1.0

    def get_termination(self, simulation: Simulation) -> float | None:
        """Returns the last discount, 0 at the goal and 1 at the end of the time, or None if the episode goes on."""
        return _DISCOUNTS.get(self._event)

    def action_spec(self, simulation: Simulation) -> specs.DiscreteArray | specs.BoundedArray:
        """Returns which actions there are."""
        if self.spec.continuous:
            return specs.BoundedArray((VELOCITY_SIZE,), np.float32, -1.0, 1.0, name="action")
        return specs.DiscreteArray(len(ACTIONS), name="action")

    def observation_spec(self, simulation: Simulation) -> dict[str, specs.Array]:
        """Returns shape, type and range of each observation by name."""
        result = observation_specs(self.spec)
        if self.spec.has_legs:
            result["is_first"] = specs.Array((), bool, name="is_first")
        return result

    def get_state(self, simulation: Simulation) -> EnvironmentState:
        """Returns all that the future of the task and its simulation depends on."""
        changing = {name: value for name, value in vars(self).items() if name not in _NO_STATE}
        return EnvironmentState(
            maze=self.spec.all_mazes[self._maze],
            simulation=simulation.full_state(),
            rng=self.rng.bit_generator.state,
            task=_copied(changing),
        )

    def set_state(self, state: EnvironmentState, simulation: Simulation) -> None:
        """Goes back to a state.

        Raises:
          InputError: if it is of an environment with other mazes.
        """
        index = state.task["_maze"]
        if index >= len(self.spec.all_mazes) or self.spec.all_mazes[index] != state.maze:
            raise InputError(f"expected a state of an environment with the same mazes, found one of {state.maze.name}")
        self._load_maze(simulation, index)
        simulation.set_full_state(state.simulation)
        self.rng.bit_generator.state = state.rng
        self.__dict__.update(_copied(state.task))

    def close(self) -> None:
        """Closes the sensors."""
        self._sensors.close()


class EnvironmentState(NamedTuple):
    """A moment of an environment. Its content is the environment's own matter; it can be pickled."""

    maze: Maze
    simulation: np.ndarray  # [S], see `Simulation.full_state`
    rng: Mapping[str, Any]  # of NumPy's bit generator that draws episodes
    task: dict[str, Any]  # attributes of the `Navigation`
    needs_reset: bool = False


def _copied(attributes: dict[str, Any]) -> dict[str, Any]:
    """Returns a copy of attributes of a `Navigation`, in which the values of `_SHARED` are the same objects."""
    shared = {id(attributes[name]): attributes[name] for name in _SHARED if name in attributes}
    return copy.deepcopy(attributes, shared)
