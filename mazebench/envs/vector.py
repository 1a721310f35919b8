"""Many environments side by side on MuJoCo's native thread pool, each in a maze of its own.

`B` is the number of environments, `M` the side of the context.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import mujoco
import mujoco.batch
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from mazebench.envs import spaces
from mazebench.maps.maze import cell_to_point, point_to_cell
from mazebench.tasks.actions import VELOCITY_SIZE, controls_of_actions, controls_of_velocities
from mazebench.tasks.context import NUM_PLANES
from mazebench.tasks.episode import Episode, sample_episode
from mazebench.tasks.observation import OpenSensors, state_errors
from mazebench.tasks.perturbations.base import ShownMap, StateError
from mazebench.tasks.route import Event, Route, plan_route
from mazebench.tasks.sensors.base import Worlds
from mazebench.tasks.shown_map import leg_context, show_map
from mazebench.tasks.spec import TaskSpec
from mazebench.world.angles import wrap_angle
from mazebench.world.mjcf import STEPS_PER_ACTION
from mazebench.world.models import models_of
from mazebench.world.physics import states_from_sensors
from mazebench.world.rendering import Cameras

# Returns the next episode of environment i, or None: then the environment rests, which means that it is not stepped any
# more.
EpisodeSource = Callable[[int], Episode | None]

_PICTURE_SIZE = 480  # pixels a side of what `render` returns
_VELOCITY_STAGE = int(mujoco.mjtStage.mjSTAGE_VEL)  # makes the sensors current at the new state


class MazeVectorEnv(gymnasium.vector.VectorEnv):
    """B environments of one task; the same seed gives the same episode as in the dm_env and Gymnasium environments.

    Autoreset is SAME_STEP: where an episode ends, `step` returns the first observation of the next episode, and
    `info["final_obs"]` and `info["final_info"]` hold the last ones of the ended episode. `info` has arrays `[B]`:
    `is_first` (whether the context is new: an episode or the leg to the next landmark began), `success`, `steps`,
    `path_length` (m), `position` (`[B, 2]` m) and `yaw` (rad; both are the true ones, for records and hindsight; agents
    must not use them), `maze` (index among the task's mazes) and `landmark` (number of legs done).
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP, "render_modes": ["rgb_array"], "render_fps": 6.25}  # noqa: RUF012

    def __init__(
        self,
        task_spec: TaskSpec,
        num_envs: int,
        seed: int | None = None,
        num_threads: int = 0,
        render_mode: str | None = None,
        episode_source: EpisodeSource | None = None,
    ):
        """Opens the environments.

        Args:
          task_spec: the task.
          num_envs: B.
          seed: of the first reset, as in `reset`.
          num_threads: of the simulation; 0 uses all cores.
          render_mode: None or "rgb_array", for Gymnasium's wrappers.
          episode_source: returns the next episode of an environment; by default each draws from a stream of its own.
        """
        if num_envs < 1:
            raise ValueError(f"expected at least one environment, found num_envs={num_envs}")
        self.task_spec = task_spec
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.single_observation_space = spaces.observation_space(task_spec)
        self.single_action_space = spaces.action_space(task_spec)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._episode_source = episode_source or self._draw_episode
        self._rngs = _streams(seed, num_envs)
        self._was_reset = False
        self._allocate()
        self._maze_models = models_of(task_spec.mazes)
        self._models = [self._maze_models[0]] * num_envs
        self._batch = mujoco.batch.Batch(self._maze_models[0], num_envs, num_threads)
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
        self._active = np.zeros(num_envs, dtype=bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Starts an episode in each environment.

        Args:
          seed: one seed for each environment, or an integer s for s, s + 1, ...; with None, an environment's stream of
            episodes goes on.
          options: ignored.
        """
        if options:
            raise ValueError(f"expected no options, found {', '.join(options)}")
        if seed is not None:
            fresh = _streams(seed, self.num_envs)
            keep = isinstance(seed, Sequence)
            self._rngs = [
                old if keep and seed[i] is None else new  # type: ignore[index]
                for i, (old, new) in enumerate(zip(self._rngs, fresh, strict=True))
            ]
        self._was_reset = True
        self._active[:] = True
        self._begin_episodes(range(self.num_envs))
        is_first = np.ones(self.num_envs, dtype=bool)
        return self._observations(self._observed_states()), self._infos(is_first, np.zeros(self.num_envs, dtype=bool))

    def step(
        self, actions: np.ndarray
    ) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Takes one agent step (0.16 s) in each environment; `actions` is `[B]` int, or `[B, 3]` float if continuous.

        Raises:
          gymnasium.error.ResetNeeded: before the first reset.
          ValueError: if `actions` are not B legal actions.
        """
        if not self._was_reset:
            raise gymnasium.error.ResetNeeded("expected a call to reset() before this step()")
        self._ctrl[:] = self._controls(actions)
        resting = not self._active.all()
        ids = np.flatnonzero(self._active) if resting else None
        self._batch.step(ids, nstep=STEPS_PER_ACTION, stage=_VELOCITY_STAGE)
        moved = self._qpos[:, :2] - self._positions
        self._positions += moved
        self._path_length += np.sqrt(moved[:, 0] * moved[:, 0] + moved[:, 1] * moved[:, 1])
        self._steps += self._active
        is_first, terminated, truncated = self._advance()
        rewards = np.where(terminated, 0.0, -1.0)
        if resting:
            rewards[~self._active] = 0.0
        infos = self._infos(is_first, terminated)
        states = self._observed_states()
        ended = np.flatnonzero(terminated | truncated)
        if len(ended):
            infos = self._autoreset(ended, states, infos)
        return self._observations(states), rewards, terminated, truncated, infos

    def _controls(self, actions: np.ndarray) -> np.ndarray:
        if self.task_spec.continuous:
            return controls_of_velocities(actions, (self.num_envs, VELOCITY_SIZE))
        return controls_of_actions(actions, self.num_envs)

    def _advance(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns three `[B]` bool: where a new leg began, where the goal was reached, where the time ran out."""
        size = self.task_spec.size
        is_first, terminated, truncated = np.zeros((3, self.num_envs), dtype=bool)
        cells = self.cells()
        # Nothing happens to a route unless one of these holds; then the route's own rules decide.
        due = (cells == self._target) | (cells == self._goal) | (self._steps >= self._deadline)
        for i in np.flatnonzero(due & self._active).tolist():
            event = self._route(i).advance(divmod(int(cells[i]), size), int(self._steps[i]))
            if event is Event.LANDMARK:
                self._begin_leg(i)
                is_first[i] = True
            terminated[i] = event is Event.REACHED
            truncated[i] = event is Event.TIMEOUT
        return is_first, terminated, truncated

    def _autoreset(self, ended: np.ndarray, states: np.ndarray, infos: dict[str, Any]) -> dict[str, Any]:
        """Begins the next episodes, writes their states into `states`, and adds the ended ones' infos to `infos`."""
        final_obs = np.full(self.num_envs, None, dtype=object)
        mask = np.zeros(self.num_envs, dtype=bool)
        mask[ended] = True
        sensed = self._sense(ended)
        for index, i in enumerate(ended):
            final_obs[i] = {"state": states[i].copy(), "context": self._context[i].copy()}
            final_obs[i] |= {name: values[index] for name, values in sensed.items()}
        final_info = {key: value if key.startswith("_") else value.copy() for key, value in infos.items()}
        final_info.update({key: mask for key in infos if key.startswith("_")})
        began = self._begin_episodes(ended)
        states[began] = self._observed_states(began)
        is_first = infos["is_first"]
        is_first[began] = True
        infos = self._infos(is_first, infos["success"] & ~mask)
        return infos | {"final_obs": final_obs, "_final_obs": mask, "final_info": final_info, "_final_info": mask}

    def _begin_episodes(self, indices: Sequence[int] | np.ndarray | range) -> np.ndarray:
        """Begins the next episodes of the environments `indices`; returns those that have one, the others rest."""
        for i in indices:
            self.episodes[i] = self._episode_source(int(i))
            self._active[i] = self.episodes[i] is not None
        began = np.array([i for i in indices if self._active[i]], dtype=np.int64)
        if not len(began):
            return began
        for i in began:
            self._models[i] = self._maze_models[self._episode(i).maze]
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
        self._positions[i] = cell_to_point(episode.start, spec.size)
        self._qpos[i] = (*self._positions[i], episode.yaw)
        self._path_length[i], self._steps[i], self._maze[i] = 0.0, 0, episode.maze
        self._begin_leg(i)

    def _begin_leg(self, i: int) -> None:
        route, shown = self._route(i), self._shown[i]
        assert shown is not None
        self._context[i] = leg_context(self.task_spec, shown, route.start, route.target)
        self._start[i], self._target[i], self._goal[i] = (
            row * self.task_spec.size + column for row, column in (route.start, route.target, route.goal)
        )
        self._marker[i, 0] = (*cell_to_point(route.goal, self.task_spec.size), 0.0)
        self._deadline[i], self._landmark[i] = route.deadline, route.leg

    def _observed_states(self, indices: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Returns `[K, 12]` float32: the states of the environments `indices`, as their agents observe them."""
        states = states_from_sensors(self._sensordata[indices])
        if any(self._state_errors):
            for state, i in zip(states, np.arange(self.num_envs)[indices], strict=True):
                for add_error in self._state_errors[i] if self._active[i] else ():
                    add_error(state)
        return states.astype(np.float32)

    def _observations(self, states: np.ndarray) -> dict[str, np.ndarray]:
        return {"state": states, "context": self._context.copy(), **self._sense(slice(None))}

    def _sense(self, indices: np.ndarray | slice) -> dict[str, np.ndarray]:
        """Returns `[K, ...]` by sensor: what the environments `indices` observe with it."""
        return self._sensors.read(Worlds(self._maze[indices], self._qpos[indices], self._marker[indices, 0]))

    def _infos(self, is_first: np.ndarray, success: np.ndarray) -> dict[str, Any]:
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
        everywhere = np.ones(self.num_envs, dtype=bool)
        return infos | {f"_{key}": everywhere for key in infos}

    def _draw_episode(self, i: int) -> Episode:
        return sample_episode(self.task_spec, self._rngs[i])

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
        return point_to_cell(self._positions, self.task_spec.size) @ (self.task_spec.size, 1)

    def legs(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns two `[B]` int: the start cells and target cells of the current legs, as row * N + column."""
        return self._start.copy(), self._target.copy()

    def render(self) -> tuple[np.ndarray, ...]:
        """Returns a picture `[480, 480, 3]` uint8 of each environment, seen from above."""
        if self._top_camera is None:
            self._top_camera = Cameras(self._models[0], ("top",), _PICTURE_SIZE, smooth=True)
        worlds = zip(self._models, self._qpos, self._marker[:, 0], strict=True)
        return tuple(self._top_camera.take(*world)["top"] for world in worlds)

    def close_extras(self, **kwargs: Any) -> None:
        self._sensors.close()
        if self._top_camera is not None:
            self._top_camera.close()


def _streams(seed: int | Sequence[int | None] | None, num_envs: int) -> list[np.random.Generator]:
    if seed is None or isinstance(seed, (int, np.integer)):
        seed = [None if seed is None else int(seed) + i for i in range(num_envs)]
    if len(seed) != num_envs:
        raise ValueError(f"expected {num_envs} seeds, found {len(seed)}")
    return [np.random.default_rng(value) for value in seed]
