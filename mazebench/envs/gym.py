"""A navigation task as a Gymnasium environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np

from mazebench.constants import RENDERING, STEPS_PER_ACTION
from mazebench.envs import spaces
from mazebench.envs.env_spec import JsonSpec
from mazebench.envs.single import EnvironmentState, TaskRunner
from mazebench.errors import InputError
from mazebench.tasks.arguments import Arguments, reset_options
from mazebench.tasks.episode import Episode
from mazebench.tasks.task import Task
from mazebench.world.near_walls import near_walls_of
from mazebench.world.rendering import Cameras
from mazebench.world.simulation import MujocoSimulation


class MazeEnv(JsonSpec, gymnasium.Env):
    """One environment; observations, rewards and endings are those of `mazebench.tasks.rules.Rules`.

    `info` has what `Rules.infos` returns, for training and records; agents must not use it in an evaluation.
    """

    metadata = RENDERING
    _shows_goal: ClassVar[bool] = True  # to the agent's cameras

    def __init__(self, task: Task, seed: int | None = None, render_mode: str | None = None, camera: str = "top"):
        """Opens the environment.

        Args:
          task: the task.
          seed: of the first reset.
          render_mode: None or "rgb_array".
          camera: of `render`: "top", "chase" or "egocentric".

        Raises:
          InputError: if an argument is not allowed.
        """
        arguments = Arguments(render_mode=render_mode, camera=camera)
        self.runner = TaskRunner(task, seed, shows_goal=self._shows_goal)
        self.task = task
        walls = near_walls_of(task.standing, 1, task.body)
        self.simulation = MujocoSimulation(walls.model, walls)
        self._needs_reset = True
        self.render_mode = render_mode
        self.observation_space = spaces.observation_space(task)
        self.action_space = spaces.action_space(task)
        self._camera = arguments.camera
        self._cameras: Cameras | None = None  # of `render`

    def draw_distances(self, distances: Sequence[int]) -> None:
        """Draws episodes with goals at these distances (cells) from now on; see `mazebench.Task.at_distances`."""
        self.runner.draw_distances(distances)
        self.task = self.runner.maze_task

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Starts an episode, the same for the same `seed`, or the one of `options={"episode": Episode(...)}`.

        `options={"distances": range(1, 4)}` calls `draw_distances` before.

        Raises:
          gymnasium.error.Error: if `seed` is not a natural number.
          InputError: if there is no such option, or its value is not allowed.
        """
        chosen = reset_options(options, "episode", "distances")
        episode = chosen.get("episode")
        if not isinstance(episode, Episode | None):
            raise InputError(f"expected options['episode'] to be an Episode, found {type(episode).__name__}")
        if "distances" in chosen:
            self.draw_distances(chosen["distances"])
        super().reset(seed=seed)
        self.runner.choose_episode(seed, episode)
        with self.simulation.reset_context():
            self.runner.initialize_episode(self.simulation)
        self._needs_reset = False
        return self._observation(), self.runner.rules.info(0)

    def step(self, action: int | np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Takes one agent step of 0.16 s.

        Raises:
          gymnasium.error.ResetNeeded: before the first reset and after the end of an episode.
          InputError: if there is no such action.
        """
        if self._needs_reset:
            raise gymnasium.error.ResetNeeded("expected a call to reset() before this step()")
        runner, simulation = self.runner, self.simulation
        runner.before_step(action, simulation)
        simulation.step(STEPS_PER_ACTION)
        runner.after_step(simulation)
        reached, timed_out = runner.rules.reached.item(), runner.rules.timed_out.item()
        self._needs_reset = reached or timed_out
        return self._observation(), runner.rules.reward(0), reached, timed_out, runner.rules.info(0)

    def render(self) -> np.ndarray | None:
        """Returns `[480, 480, 3]` uint8 of the current state if `render_mode` is "rgb_array", else None."""
        if self.render_mode is None:
            return None
        if self._cameras is None:
            self._cameras = Cameras(self.task.standing, (self._camera,), body=self.task.body)
        data = self.simulation.data
        return self._cameras.take(self.runner.rules.maze.item(), data.qpos, data.mocap_pos[0])[self._camera]

    def close(self) -> None:
        if self._cameras is not None:
            self._cameras.close()

    def get_state(self) -> EnvironmentState:
        """Returns this moment of the environment, to go back to with `set_state` as often as you like."""
        return self.runner.get_state(self.simulation)._replace(needs_reset=self._needs_reset)

    def set_state(self, state: EnvironmentState) -> None:
        """Goes back to a state of this environment, or of another one of the same task.

        From there, the same actions lead to the same steps bit for bit, and so do the episodes that follow.

        Raises:
          InputError: if it is a state of an environment with other mazes.
        """
        self.runner.set_state(state, self.simulation)
        self.task = self.runner.maze_task
        self._needs_reset = state.needs_reset

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_cameras": None}  # a copy opens some of its own

    def _observation(self) -> dict[str, np.ndarray]:
        return self.runner.get_observation(self.simulation)
