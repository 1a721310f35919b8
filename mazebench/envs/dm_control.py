"""A navigation task as a dm_control environment. Only this module imports dm_control."""

from __future__ import annotations

import copy
import warnings
from typing import Any

import dm_env
import mujoco
import numpy as np
from dm_env import specs

from mazebench.constants import STEPS_PER_ACTION
from mazebench.envs.single import EnvironmentState, TaskRunner
from mazebench.tasks.actions import action_spec
from mazebench.tasks.arguments import require_task
from mazebench.tasks.episode import Episode
from mazebench.tasks.observation import observation_specs
from mazebench.tasks.task import Task as MazeTask
from mazebench.tasks.task_options import PROGRESS
from mazebench.world.models import MazeModels, models_of
from mazebench.world.profiler import stop_profiler
from mazebench.world.rendering import opening_context
from mazebench.world.simulation import FULL_STATE, Simulation

with warnings.catch_warnings():
    # dm_control tries every rendering backend when imported, and GLFW warns if there is no display.
    warnings.filterwarnings("ignore", message=".*GLFWError.*|.*DISPLAY.*")
    from dm_control.mujoco import engine, wrapper
    from dm_control.rl import control


# What dm_control makes of a model, in 5 ms.
_OF_MODEL = ("_data", "_warnings", "_warnings_before", "_new_warnings", "_named")
_MOST_KEPT = 64  # mazes


class Physics(Simulation, engine.Physics):
    """A whole maze and the body in it; another maze is another model and other data, and those used last are kept."""

    models: MazeModels
    _maze = 0  # index of the maze
    _others: dict[int, dict[str, Any]]  # by index of the maze: the attributes `_OF_MODEL` that it had

    @classmethod
    def of_mazes(cls, models: MazeModels) -> Physics:
        """Returns a simulation of the first of some mazes, with the body in its first free cell."""
        stop_profiler()
        physics = cls.from_model(wrapper.MjModel(copy.copy(models[0])))
        physics.models, physics._others = models, {}
        with physics.reset_context():
            physics.data.qpos[:] = physics.model.key_qpos[0]
        return physics

    def __getstate__(self) -> Any:
        return super().__getstate__(), self.models, self._maze

    def __setstate__(self, state: Any) -> None:
        inner, self.models, self._maze = state
        self._others = {}
        super().__setstate__(inner)

    def surround(self, maze: int, cell: int) -> None:
        if maze == self._maze:
            return
        if len(self._others) >= _MOST_KEPT:
            self._others.pop(next(iter(self._others)))
        self._others[self._maze] = {name: getattr(self, name) for name in _OF_MODEL}
        self._maze = maze
        if (kept := self._others.pop(maze, None)) is None:
            self._reload_from_model(wrapper.MjModel(copy.copy(self.models[maze])))
            return
        if self._contexts:  # they are of the model
            self._free_rendering_contexts()
        self.__dict__.update(kept)
        mujoco.mj_resetData(self.model.ptr, self.data.ptr)

    def after_reset(self) -> None:
        """Computes what follows from positions and velocities, after a reset and in a new copy."""
        super().after_reset()
        self._update()  # dm_control leaves the actuators' velocities at 0, which is wrong in a copy of a moving body

    def _make_rendering_contexts(self) -> None:
        with opening_context():
            super()._make_rendering_contexts()

    def full_state(self) -> np.ndarray:
        return self.get_state(FULL_STATE)

    def set_full_state(self, state: np.ndarray) -> None:
        self.set_state(state, FULL_STATE)
        self._update()

    def _update(self) -> None:
        """Computes what follows from positions and velocities, as dm_control does at the end of a step."""
        mujoco.mj_step1(self.model.ptr, self.data.ptr)


class Task(TaskRunner, control.Task):
    """The task as dm_control asks for it; `mazebench.tasks.rules.Rules` describes it."""

    def __init__(self, task: MazeTask, seed: int | None = None):
        self._generator = np.random.RandomState()
        super().__init__(task, seed)

    def choose_episode(self, seed: int | None = None, episode: Episode | None = None) -> None:
        super().choose_episode(seed, episode)
        if seed is not None:
            self._generator = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed)))

    @property
    def random(self) -> np.random.RandomState:
        """The generator of dm_control's wrappers, from which no episode draws; one that is set seeds the episodes."""
        return self._generator

    @random.setter
    def random(self, generator: np.random.RandomState) -> None:
        self._generator = generator
        self.rng = np.random.default_rng(generator.randint(2**31))

    _random = random  # which others set to seed the suite's tasks

    def get_observation(self, simulation: Simulation) -> dict[str, np.ndarray]:
        observation = super().get_observation(simulation)
        if self.maze_task.has_legs:
            observation["is_first"] = np.array(self.rules.is_first.item())
        return observation

    def get_reward(self, simulation: Simulation) -> float:
        """Returns 0 if the goal has been reached, else -1; and the progress, if it is rewarded."""
        return self.rules.reward(0)

    def get_termination(self, simulation: Simulation) -> float | None:
        """Returns the last discount, 0 at the goal and 1 at the end of the time, or None if the episode goes on."""
        if self.success:
            return 0.0
        return 1.0 if self.rules.timed_out.item() else None

    def action_spec(self, simulation: Simulation) -> specs.DiscreteArray | specs.BoundedArray:
        """Returns which actions there are."""
        return action_spec(self.maze_task.actions)

    def observation_spec(self, simulation: Simulation) -> dict[str, specs.Array]:
        """Returns shape, type and range of each observation by name."""
        result = observation_specs(self.maze_task)
        if self.maze_task.has_legs:
            result["is_first"] = specs.Array((), bool, name="is_first")
        return result


class Environment(control.Environment):
    """A dm_control Environment whose `reset` also takes a seed, or the episode to play."""

    physics: Physics
    task: Task

    def __init__(self, task: MazeTask, seed: int | None = None):
        """Opens the environment; `seed` is that of the first reset.

        Raises:
          InputError: if `seed` is not a natural number, or `task` not a `Task`.
        """
        require_task(task)
        # The task judges the time limit itself, so that a goal reached on the last step is a termination.
        super().__init__(
            Physics.of_mazes(models_of(task.standing, task.body)), Task(task, seed), n_sub_steps=STEPS_PER_ACTION
        )

    @property
    def maze_task(self) -> MazeTask:
        """The task that is played, with the distances of the episodes that follow (`task.draw_distances`)."""
        return self.task.maze_task

    def reset(self, seed: int | None = None, episode: Episode | None = None) -> dm_env.TimeStep:
        """Starts an episode: the next one of the environment's stream, the first one of `seed`'s, or `episode`."""
        self.task.choose_episode(seed, episode)
        return super().reset()

    @property
    def needs_reset(self) -> bool:
        """True if no episode is under way; `step` would then start one."""
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

    def reward_spec(self) -> specs.Array:
        if self.maze_task.options.reward == PROGRESS:
            return specs.Array((), float, name="reward")
        return specs.BoundedArray((), float, -1.0, 0.0, name="reward")
