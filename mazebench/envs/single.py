"""A task in one simulation, as the Gymnasium and the dm_control environment share it."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.maze import Maze
from mazebench.tasks.actions import Actions
from mazebench.tasks.arguments import Arguments, require_task
from mazebench.tasks.episode import Episode, check_episode, sample_episode
from mazebench.tasks.route import Route
from mazebench.tasks.rules import Rules
from mazebench.tasks.task import Task
from mazebench.world.simulation import Simulation

_Value = TypeVar("_Value")

_RUNNING = np.ones(1, dtype=bool)
_NO_STATE = ("task", "_sensors", "_shows_goal")  # attributes of the rules that no step changes
_SHARED = ("episodes", "shown", "_ways")  # attributes whose values never change


class TaskRunner:
    """The rules of one environment, its stream of episodes, and what they do to its simulation.

    Its methods are those of a dm_control task. An environment calls them with the simulation that it steps.
    """

    def __init__(self, task: Task, seed: int | None = None, *, shows_goal: bool = True):
        """`seed` is that of the stream from which episodes are drawn; `shows_goal` says if cameras see the goal's disc.

        Raises:
          InputError: if `seed` is not a natural number, or `task` not a `Task`.
        """
        require_task(task)
        self.maze_task = task
        self._body, self._actions = task.body, Actions(task.actions, task.body)
        self.rules = Rules(task, num_envs=1, shows_goal=shows_goal)
        self.rng = np.random.default_rng()
        self._next_episode: Episode | None = None
        self.choose_episode(seed)

    def choose_episode(self, seed: int | None = None, episode: Episode | None = None) -> None:
        """Makes the next reset begin the stream of episodes of `seed`, or play `episode` instead of a drawn one.

        Raises:
          InputError: if `seed` is not a natural number, or the episode can't be played in this task's mazes.
        """
        if seed is not None:
            self.rng = np.random.default_rng(Arguments(seed=seed).seed)
        if episode is not None:
            self._next_episode = check_episode(self.maze_task, episode)

    def draw_distances(self, distances: Sequence[int]) -> None:
        """Draws episodes with goals at these distances (cells) from now on; see `mazebench.Task.at_distances`."""
        self.maze_task = self.maze_task.at_distances(distances)

    @property
    def episode(self) -> Episode:
        """The running episode, or the one that ended last."""
        return _only(self.rules.episodes)

    @property
    def route(self) -> Route:
        """The cells that the agent is sent to in the episode."""
        return _only(self.rules.routes)

    @property
    def success(self) -> bool:
        """True if the goal has been reached."""
        return self.rules.reached.item()

    @property
    def steps(self) -> int:
        """The agent steps since the start of the episode."""
        return self.rules.steps.item()

    @property
    def path_length(self) -> float:
        """The metres driven since the start of the episode."""
        return self.rules.path_length.item()

    def initialize_episode(self, simulation: Simulation) -> None:
        """Draws an episode, or takes the chosen one, and places body and goal; call it within `reset_context()`."""
        episode = self._next_episode or sample_episode(self.maze_task, self.rng)
        self._next_episode = None
        self.rules.begin(0, episode)
        simulation.surround(episode.maze, self.rules.cell.item())
        simulation.place_agent(self.rules.pose[0, :2], episode.yaw)
        simulation.place_goal(self.rules.marker[0, :2])

    def before_step(self, action: int | np.ndarray, simulation: Simulation) -> None:
        """Sets the controls of an action.

        Raises:
          InputError: if there is no such action.
        """
        simulation.surround(self.rules.maze.item(), self.rules.cell.item())
        simulation.set_controls(self._actions.controls_of_one(action))

    def after_step(self, simulation: Simulation) -> None:
        """Takes note of what the action led to."""
        if self.rules.advance(simulation.data.qpos[None], _RUNNING):  # other walls around the same body
            state = simulation.full_state()
            simulation.surround(self.rules.maze.item(), self.rules.cell.item())
            simulation.set_full_state(state)
        if self.rules.is_first.item():
            simulation.place_goal(self.rules.marker[0, :2])

    def get_observation(self, simulation: Simulation) -> dict[str, np.ndarray]:
        """Returns the observation of the present moment; each call draws new noise."""
        observed = self.rules.observe(self._body.state(simulation.data.sensordata)[None])
        found = {"state": observed.pop("state")[0], "context": self.rules.context[0].copy()}
        return found | {name: values[0] for name, values in observed.items()}

    def get_state(self, simulation: Simulation) -> EnvironmentState:
        """Returns all that the future of the task and its simulation depends on."""
        changing = {name: value for name, value in vars(self.rules).items() if name not in _NO_STATE}
        return EnvironmentState(
            maze=self.maze_task.standing[self.rules.maze.item()].as_built,
            simulation=simulation.full_state(),
            distances=self.maze_task.distances,
            rng=self.rng.bit_generator.state,
            rules=_copied(changing),
        )

    def set_state(self, state: EnvironmentState, simulation: Simulation) -> None:
        """Goes back to a state.

        Raises:
          InputError: if it is of an environment with other mazes.
        """
        index = state.rules["maze"].item()
        if not self.maze_task.arena.has(index) or self.maze_task.standing[index].as_built != state.maze:
            raise InputError(f"expected a state of an environment with the same mazes, found one of {state.maze.name}")
        if state.distances != self.maze_task.distances:
            self.draw_distances(state.distances)
        simulation.surround(index, state.rules["cell"].item())
        simulation.set_full_state(state.simulation)
        self.rng.bit_generator.state = state.rng
        vars(self.rules).update(_copied(state.rules))


class EnvironmentState(NamedTuple):
    """A moment of an environment. Its content is the environment's own matter; it can be pickled."""

    maze: Maze
    simulation: np.ndarray  # [S], see `Simulation.full_state`
    distances: tuple[int, ...]  # cells, of the episodes that follow
    rng: Mapping[str, Any]  # of NumPy's bit generator that draws episodes
    rules: dict[str, Any]  # attributes of the `Rules`
    needs_reset: bool = False


def _only(values: list[_Value | None]) -> _Value:
    """Returns the value of the one environment, which has an episode."""
    (value,) = values
    assert value is not None
    return value


def _copied(attributes: dict[str, Any]) -> dict[str, Any]:
    """Returns a copy of attributes of `Rules`, with the same episodes, shown maps and ways."""
    shared = {id(value): value for name in _SHARED for value in attributes[name]}
    return copy.deepcopy(attributes, shared)
