"""Many environments side by side on MuJoCo's native thread pool, each in a maze of its own.

`B` is the number of environments, `M` the side of the context.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from mazebench.constants import STEP_TIME, STEPS_PER_ACTION
from mazebench.envs import spaces
from mazebench.envs.env_spec import JsonSpec
from mazebench.errors import InputError, unknown
from mazebench.maps.maze import Cell
from mazebench.tasks.actions import VELOCITY_SIZE, controls_of_actions, controls_of_velocities
from mazebench.tasks.arguments import Arguments, require_task_spec
from mazebench.tasks.context import NUM_PLANES
from mazebench.tasks.episode import Episode, sample_episode
from mazebench.tasks.observation import OpenSensors, lidar_noise, observation_specs, state_errors
from mazebench.tasks.perturbations.perturbation import ShownMap, StateError
from mazebench.tasks.route import Event, Route, plan_route
from mazebench.tasks.sensors.sensor import Worlds
from mazebench.tasks.shown_map import leg_context, show_map
from mazebench.tasks.task import Task
from mazebench.world.angles import wrap_angle
from mazebench.world.batch import open_batch
from mazebench.world.models import models_of
from mazebench.world.rendering import Cameras
from mazebench.world.simulation import STATE_SIZE, states_from_sensors

# Returns the next episode of environment i; None ends the environment, which is not stepped any more.
EpisodeSource = Callable[[int], Episode | None]
Seeds = int | Sequence[int | None] | None

_VELOCITY_STAGE = int(mujoco.mjtStage.mjSTAGE_VEL)  # makes the sensors current at the new state


class MazeVectorEnv(JsonSpec, gymnasium.vector.VectorEnv):
    """B environments of one task; the same seed gives the same episode as in the dm_env and Gymnasium environments.

    `autoreset_mode` says what follows the end of an episode, as Gymnasium defines it:

    - SAME_STEP: `step` returns the first observation of the next episode, and `info["final_obs"]` and
      `info["final_info"]` hold the last ones of the ended episode.
    - NEXT_STEP: `step` returns the last observation; the next `step` ignores the action there, begins the next episode
      and returns its first observation with reward 0.
    - DISABLED: `step` returns the last observation; `reset(options={"reset_mask": mask})` must come before the next
      `step`.

    The episodes are the same in all three. `info` has arrays `[B]`: `is_first` (whether the context is new: an episode
    or the leg to the next landmark began), `success`, `steps`, `path_length` (m), `position` (`[B, 2]` m) and `yaw`
    (rad; both are the true ones, for records and hindsight; agents must not use them), `maze` (index among the task's
    mazes) and `landmark` (number of legs done).

    `close` ends the threads. A process that is forked meanwhile can't use the environment, but can make its own.
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP, "render_modes": ["rgb_array"], "render_fps": 1 / STEP_TIME}  # noqa: RUF012

    def __init__(
        self,
        task_spec: Task,
        num_envs: int,
        seed: Seeds = None,
        num_threads: int = 0,
        render_mode: str | None = None,
        episode_source: EpisodeSource | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
    ):
        """Opens the environments.

        Args:
          task_spec: the task.
          num_envs: B.
          seed: of the first reset, as in `reset`.
          num_threads: of the simulation; 0 uses all cores.
          render_mode: None or "rgb_array", for Gymnasium's wrappers.
          episode_source: returns the next episode of an environment; by default each draws from a stream of its own.
          autoreset_mode: one of Gymnasium's three, or its value: "SameStep", "NextStep" or "Disabled".

        Raises:
          InputError: if an argument is not allowed.
        """
        require_task_spec(task_spec)
        arguments = Arguments(num_envs=num_envs, num_threads=num_threads, render_mode=render_mode)
        self.task_spec = task_spec
        self.num_envs = num_envs = arguments.num_envs

        # What Gymnasium expects of a vector environment.
        self.render_mode = render_mode
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError as error:
            raise unknown("autoreset_mode", autoreset_mode, [mode.value for mode in AutoresetMode]) from error
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        self.single_observation_space = spaces.observation_space(task_spec)
        self.single_action_space = spaces.action_space(task_spec)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

        # The episodes, and where each of them is.
        self._episode_source = episode_source
        self._rngs = [np.random.default_rng(value) for value in _seeds(seed, num_envs)]
        self._was_reset = False
        self._allocate()

        # The simulation, with views of its arrays, and the sensors.
        self._maze_models = models_of(task_spec.all_mazes)
        self._models = self._maze_models.first_models(num_envs)
        self._process = os.getpid()
        self._batch = open_batch(self._maze_models[0], num_envs, arguments.num_threads)
        self._sensordata = self._batch.bind("sensordata")
        self._qpos = self._batch.bind("qpos")
        self._ctrl = self._batch.bind("ctrl")
        self._marker = self._batch.bind("mocap_pos")
        self._sensors = OpenSensors(task_spec)
        self._top_camera: Cameras | None = None  # of `render`

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError(
            f"{type(self).__name__} can't be copied or pickled; copy dm_env or Gymnasium environments, or make another "
            "one with the same task_spec and seed"
        )

    def _allocate(self) -> None:
        num_envs, size = self.num_envs, self.task_spec.context_size
        self.episodes: list[Episode | None] = [None] * num_envs
        self._routes: list[Route | None] = [None] * num_envs
        self._shown: list[ShownMap | None] = [None] * num_envs
        self._state_errors: list[list[StateError]] = [[] for _ in range(num_envs)]
        self._lidar_noise: list[np.random.Generator | None] = [None] * num_envs
        self._context = np.zeros((num_envs, NUM_PLANES, size, size), dtype=np.float32)
        self._positions = np.zeros((num_envs, 2))
        self._path_length = np.zeros(num_envs)
        self._steps = np.zeros(num_envs, dtype=np.int64)
        # What each step is checked against: cells as row * N + column, and the step at which the leg times out.
        self._start = np.zeros(num_envs, dtype=np.int64)
        self._target = np.zeros(num_envs, dtype=np.int64)
        self._goal = np.zeros(num_envs, dtype=np.int64)
        self._deadline = np.zeros(num_envs, dtype=np.int64)
        self._landmark = np.zeros(num_envs, dtype=np.int64)
        self._maze = np.zeros(num_envs, dtype=np.int64)
        self._active = np.zeros(num_envs, dtype=bool)  # whether the environment has an episode
        self._ended = np.zeros(num_envs, dtype=bool)  # whether the episode is over and the next one has yet to begin
        # As observed last: the states, and [B, ...] by sensor.
        self._states = np.zeros((num_envs, STATE_SIZE), dtype=np.float32)
        specs = observation_specs(self.task_spec)
        self._sensed = {
            name: np.zeros((num_envs, *specs[name].shape), specs[name].dtype) for name in self.task_spec.sensors
        }

    def reset(
        self, *, seed: Seeds = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Starts an episode in each environment, or in those of a mask.

        Args:
          seed: one seed for each environment, or an integer s for s, s + 1, ...; with None, an environment's stream of
            episodes goes on.
          options: `{"reset_mask": mask}` with `mask` `[B]` bool resets only where it is True. The other environments
            stay as they are, and `info` says nothing of them.

        Raises:
          InputError: if an argument is not allowed.
          gymnasium.error.ResetNeeded: if the mask leaves out environments that were never reset.
          gymnasium.error.ClosedEnvironmentError: after `close`, and in a forked process.
        """
        self._require_open()
        mask = self._reset_mask(options)
        if not (self._was_reset or mask.all()):
            raise gymnasium.error.ResetNeeded("expected a call to reset() of all environments before this one of some")
        for i, value in enumerate(_seeds(seed, self.num_envs)):
            if value is not None and mask[i]:
                self._rngs[i] = np.random.default_rng(value)
        self._was_reset = True
        indices = np.flatnonzero(mask)
        self._begin_episodes(indices)
        self._observe(indices)
        infos = self._infos(is_first=mask.copy(), success=np.zeros(self.num_envs, dtype=bool), mask=mask)
        return self._observations(), infos

    def _reset_mask(self, options: dict[str, Any] | None) -> np.ndarray:
        """Returns `[B]` bool: which environments `options` say to reset."""
        if not isinstance(options, Mapping | None):
            raise InputError(f"expected options as a dict, found {type(options).__name__}")
        for name in options or {}:
            if name != "reset_mask":
                raise unknown("option", name, ("reset_mask",))
        mask = (options or {}).get("reset_mask", np.ones(self.num_envs, dtype=bool))
        if not (isinstance(mask, np.ndarray) and mask.dtype == bool and mask.shape == (self.num_envs,) and mask.any()):
            raise InputError(
                f"expected reset_mask, an array of {self.num_envs} bool, not all False, found {mask!r}"[:200]
            )
        return mask

    def step(
        self, actions: np.ndarray
    ) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Takes one agent step (0.16 s) in each environment; `actions` is `[B]` int, or `[B, 3]` float if continuous.

        Raises:
          gymnasium.error.ResetNeeded: before the first reset; with autoreset disabled, where an episode has ended.
          gymnasium.error.ClosedEnvironmentError: after `close`, and in a forked process.
          InputError: if `actions` are not B legal actions.
        """
        self._require_open()
        self._require_reset()
        if self.task_spec.continuous:
            self._ctrl[:] = controls_of_velocities(actions, (self.num_envs, VELOCITY_SIZE))
        else:
            self._ctrl[:] = controls_of_actions(actions, self.num_envs)

        # Simulate the environments whose episode is under way.
        running = self._active & ~self._ended
        all_run = running.all()
        self._batch.step(None if all_run else np.flatnonzero(running), nstep=STEPS_PER_ACTION, stage=_VELOCITY_STAGE)

        # Take over how far the bodies moved.
        moved = self._qpos[:, :2] - self._positions
        self._positions += moved
        self._path_length += np.sqrt(moved[:, 0] * moved[:, 0] + moved[:, 1] * moved[:, 1])
        self._steps += running

        # Apply the rules of the task.
        is_first, terminated, truncated = self._advance(running)
        rewards = np.where(terminated, 0.0, -1.0)
        rewards[~running] = 0.0

        # With NEXT_STEP, begin the episodes that follow those that ended in the step before.
        if self._ended.any():
            is_first[self._begin_episodes(np.flatnonzero(self._ended))] = True
        self._observe(slice(None))
        infos = self._infos(is_first, success=terminated)

        # With SAME_STEP, begin those that follow the ones that ended in this step.
        ended = terminated | truncated
        if self.autoreset_mode is not AutoresetMode.SAME_STEP:
            self._ended = ended
        elif ended.any():
            infos = self._autoreset(ended, infos)
        return self._observations(), rewards, terminated, truncated, infos

    def _require_open(self) -> None:
        if self.closed:
            raise gymnasium.error.ClosedEnvironmentError("expected an open environment, found one after close()")
        if os.getpid() != self._process:
            raise gymnasium.error.ClosedEnvironmentError(
                "expected a vector environment that this process made, found one of the process that forked it; make "
                "another one with the same task_spec and seed"
            )

    def _require_reset(self) -> None:
        if not self._was_reset:
            raise gymnasium.error.ResetNeeded("expected a call to reset() before this step()")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._ended.any():
            raise gymnasium.error.ResetNeeded(
                "expected a call to reset(options={'reset_mask': mask}) before this step(): the episodes ended in "
                f"environments {', '.join(map(str, np.flatnonzero(self._ended)))}"[:200]
            )

    def _advance(self, running: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns three `[B]` bool: where a new leg began, where the goal was reached, where the time ran out."""
        size = self.task_spec.size
        is_first, terminated, truncated = np.zeros((3, self.num_envs), dtype=bool)
        cells = self.cells()

        # Nothing happens to a route unless one of these holds; then the route's own rules decide.
        due = (cells == self._target) | (cells == self._goal) | (self._steps >= self._deadline)
        for i in np.flatnonzero(due & running).tolist():
            event = self._route(i).advance(divmod(int(cells[i]), size), int(self._steps[i]))
            if event is Event.LANDMARK:
                self._begin_leg(i)
                is_first[i] = True
            terminated[i] = event is Event.REACHED
            truncated[i] = event is Event.TIMEOUT
        return is_first, terminated, truncated

    def _autoreset(self, ended: np.ndarray, infos: dict[str, Any]) -> dict[str, Any]:
        """Begins the next episodes where one `ended`, and returns the infos with the ended ones' last observations."""
        # What was observed last, and the infos of then: those of the ended environments only.
        indices = np.flatnonzero(ended)
        final_obs = np.full(self.num_envs, None, dtype=object)
        for i in indices:
            final_obs[i] = {name: values[i].copy() for name, values in self._observed().items()}
        final_info = {key: value if key.startswith("_") else value.copy() for key, value in infos.items()}
        final_info.update({key: ended for key in infos if key.startswith("_")})

        # The next episodes, and the infos of now.
        began = self._begin_episodes(indices)
        if len(began):
            self._observe(began)
        is_first = infos["is_first"]
        is_first[began] = True
        infos = self._infos(is_first, success=infos["success"] & ~ended)
        return infos | {"final_obs": final_obs, "_final_obs": ended, "final_info": final_info, "_final_info": ended}

    def _begin_episodes(self, indices: np.ndarray) -> np.ndarray:
        """Begins the next episodes of the environments `indices`; returns those of them that have one."""
        for i in indices.tolist():
            if self._episode_source:
                self.episodes[i] = self._episode_source(i)
            else:
                self.episodes[i] = sample_episode(self.task_spec, self._rngs[i])
            self._active[i] = self.episodes[i] is not None
        self._ended[indices] = False
        began = indices[self._active[indices]]
        if not len(began):
            return began

        # Change the mazes, reset the simulations, place the bodies, and compute what follows from that.
        for i in began:
            self._models[i] = self._maze_models.replaced(self._models[i], self._episode(i).maze)
        self._batch.set_models(self._models)
        self._batch.reset(began, stage=int(mujoco.mjtStage.mjSTAGE_NONE))
        for i in began:
            self._begin_episode(i)
        self._batch.forward(began, stage=_VELOCITY_STAGE)
        return began

    def _begin_episode(self, i: int) -> None:
        spec, episode = self.task_spec, self._episode(i)
        shown = show_map(spec, episode)
        self._shown[i] = shown
        self._routes[i] = plan_route(spec, episode, shown)
        self._state_errors[i] = state_errors(spec, episode)
        self._lidar_noise[i] = lidar_noise(spec, episode)
        self._maze[i] = episode.maze
        self._positions[i] = spec.all_mazes[episode.maze].point(episode.start)
        self._qpos[i] = (*self._positions[i], episode.yaw)
        self._path_length[i] = 0.0
        self._steps[i] = 0
        self._begin_leg(i)

    def _begin_leg(self, i: int) -> None:
        route, shown = self._route(i), self._shown[i]
        assert shown is not None
        self._context[i] = leg_context(self.task_spec, shown, route.start, route.target)
        self._start[i] = self._cell_index(route.start)
        self._target[i] = self._cell_index(route.target)
        self._goal[i] = self._cell_index(route.goal)
        self._deadline[i] = route.deadline
        self._landmark[i] = route.leg
        self._marker[i, 0] = (*self.task_spec.all_mazes[self._maze[i]].point(route.goal), 0.0)

    def _cell_index(self, cell: Cell) -> int:
        return cell[0] * self.task_spec.size + cell[1]

    def _observe(self, indices: np.ndarray | slice) -> None:
        """Takes over what the agents of the environments `indices` observe; noise is drawn anew with each call."""
        states = states_from_sensors(self._sensordata[indices])
        if any(self._state_errors):
            for state, i in zip(states, np.arange(self.num_envs)[indices], strict=True):
                for add_error in self._state_errors[i] if self._active[i] else ():
                    add_error(state)
        self._states[indices] = states

        # What the sensors read.
        slots = np.arange(self.num_envs)[indices].tolist()
        worlds = Worlds(
            maze=self._maze[indices],
            pose=self._qpos[indices],
            marker=self._marker[indices, 0],
            noise=[self._lidar_noise[i] if self._active[i] else None for i in slots],
        )
        for name, values in self._sensors.read(worlds).items():
            self._sensed[name][indices] = values

    def _observed(self) -> dict[str, np.ndarray]:
        """Returns `[B, ...]` by name: what was observed last, not copied."""
        return {"state": self._states, "context": self._context, **self._sensed}

    def _observations(self) -> dict[str, np.ndarray]:
        return {name: values.copy() for name, values in self._observed().items()}

    def _infos(self, is_first: np.ndarray, success: np.ndarray, mask: np.ndarray | None = None) -> dict[str, Any]:
        """Returns the infos; `mask` (`[B]` bool) says of which environments they are, of all by default."""
        infos = {
            "is_first": is_first,
            "success": success.copy(),
            "steps": self._steps.copy(),
            "path_length": self._path_length.copy(),
            "position": self._positions.copy(),
            "yaw": wrap_angle(self._qpos[:, 2]),
            "maze": self._maze.copy(),
            "landmark": self._landmark.copy(),
        }
        mask = np.ones(self.num_envs, dtype=bool) if mask is None else mask.copy()
        return infos | {f"_{key}": mask for key in infos}

    def _episode(self, i: int) -> Episode:
        episode = self.episodes[i]
        assert episode is not None
        return episode

    def _route(self, i: int) -> Route:
        route = self._routes[i]
        assert route is not None
        return route

    def cells(self) -> np.ndarray:
        """Returns `[B]` int: the true cells of the bodies, as row * N + column; agents must not use them."""
        # All mazes have one size and one cell size, so the first one converts the points of all.
        return self.task_spec.all_mazes[0].cell(self._positions) @ (self.task_spec.size, 1)

    def legs(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns two `[B]` int: the start cells and target cells of the current legs, as row * N + column."""
        return self._start.copy(), self._target.copy()

    def render(self) -> tuple[np.ndarray, ...]:
        """Returns a picture `[480, 480, 3]` uint8 of each environment, seen from above."""
        self._require_open()
        if self._top_camera is None:
            self._top_camera = Cameras(models_of(self.task_spec.all_mazes, self.task_spec.textures), ("top",))
        worlds = zip(self._maze.tolist(), self._qpos, self._marker[:, 0], strict=True)
        return tuple(self._top_camera.take(*world)["top"] for world in worlds)

    def close_extras(self, **kwargs: Any) -> None:
        self._sensors.close()
        if self._top_camera is not None:
            self._top_camera.close()
        del self._batch, self._sensordata, self._qpos, self._ctrl, self._marker  # which ends the threads


def _seeds(seed: Seeds, num_envs: int) -> list[int | None]:
    """Returns the seed of each environment.

    Raises:
      InputError: unless `seed` is None, a natural number, or one of either for each environment.
    """
    if isinstance(seed, Sequence | np.ndarray) and not isinstance(seed, str):
        if len(seed) != num_envs:
            raise InputError(f"expected {num_envs} seeds, found {len(seed)}")
        return [Arguments(seed=value).seed for value in seed]
    first = Arguments(seed=seed).seed
    return [None if first is None else first + i for i in range(num_envs)]
