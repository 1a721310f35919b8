"""Many environments side by side on MuJoCo's native thread pool, each in a maze of its own.

`B` is the number of environments, `M` the side of the context.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from mazebench.constants import RENDERING, STEPS_PER_ACTION
from mazebench.envs import spaces
from mazebench.envs.env_spec import JsonSpec
from mazebench.errors import InputError, unknown
from mazebench.tasks.actions import Actions
from mazebench.tasks.arguments import Arguments, require_task, reset_options
from mazebench.tasks.episode import Episode, sample_episode
from mazebench.tasks.observation import observation_specs
from mazebench.tasks.rules import Rules
from mazebench.tasks.task import Task
from mazebench.world.batch import open_batch
from mazebench.world.near_walls import WallGeoms, near_walls_of
from mazebench.world.rendering import Cameras

# Returns the next episode of environment i; None ends the environment, which is not stepped any more.
EpisodeSource = Callable[[int], Episode | None]
Seeds = int | Sequence[int | None] | None

_VELOCITY_STAGE = int(mujoco.mjtStage.mjSTAGE_VEL)  # makes the sensors current at the new state


class MazeVectorEnv(JsonSpec, gymnasium.vector.VectorEnv):
    """B environments of a task; the same seed gives the same episode as in the dm_env and Gymnasium environments.

    Of several tasks (`tasks_of_tracks`), each episode first draws one.

    `autoreset_mode` says what follows the end of an episode, as Gymnasium defines it:

    - SAME_STEP: `step` returns the first observation of the next episode, and `info["final_obs"]` and
      `info["final_info"]` hold the last ones of the ended episode.
    - NEXT_STEP: `step` returns the last observation; the next `step` ignores the action there, begins the next episode
      and returns its first observation with reward 0.
    - DISABLED: `step` returns the last observation; `reset(options={"reset_mask": mask})` must come before the next
      `step`.

    The episodes are the same in all three. `info` has what `Rules.infos` returns, for training and records; agents must
    not use it in an evaluation.

    `close` ends the threads. A process that is forked meanwhile can't use the environment, but can make its own.
    """

    metadata = RENDERING | {"autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self,
        task: Task | Sequence[Task],
        num_envs: int,
        seed: Seeds = None,
        num_threads: int = 0,
        render_mode: str | None = None,
        episode_source: EpisodeSource | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
    ):
        """Opens the environments.

        Args:
          task: the task, or those of several tracks; the attribute of this name is the first one.
          num_envs: B.
          seed: of the first reset, as in `reset`.
          num_threads: of the simulation and the cameras; 0 uses all cores.
          render_mode: None or "rgb_array", for Gymnasium's wrappers.
          episode_source: returns the next episode of an environment; by default each draws from a stream of its own.
          autoreset_mode: one of Gymnasium's three, or its value: "SameStep", "NextStep" or "Disabled".

        Raises:
          InputError: if an argument is not allowed.
        """
        tasks = (task,) if isinstance(task, Task) else tuple(task)
        self.task = task = tasks[0]
        require_task(task)
        arguments = Arguments(num_envs=num_envs, num_threads=num_threads, render_mode=render_mode)
        self.num_envs = num_envs = arguments.num_envs

        # What Gymnasium expects of a vector environment.
        self.render_mode = render_mode
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except ValueError as error:
            raise unknown("autoreset_mode", autoreset_mode, [mode.value for mode in AutoresetMode]) from error
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        self.single_observation_space = spaces.observation_space(task)
        self.single_action_space = spaces.action_space(task)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

        # The episodes, and what was observed of them last: [B, ...] by name.
        self._episode_source = episode_source
        self._tasks = tasks  # of which each episode draws one
        self._rngs = [np.random.default_rng(value) for value in _seeds(seed, num_envs)]
        self.rules = Rules(task, num_envs, arguments.num_threads)
        self.episodes = self.rules.episodes
        self._was_reset = False
        self._ended = np.zeros(num_envs, dtype=bool)  # whether the episode is over and the next one has yet to begin
        self._observed = {
            name: np.zeros((num_envs, *array.shape), array.dtype) for name, array in observation_specs(task).items()
        }
        self._observed["context"] = self.rules.context
        self._masks = [f"_{name}" for name in self.rules.infos()]

        # The simulation, with views of its arrays.
        self._body, self._actions = task.body, Actions(task.actions, task.body)
        self._walls = near_walls_of(task.standing, num_envs, task.body)
        self._process = os.getpid()
        self._batch = open_batch(self._walls.model, num_envs, arguments.num_threads)
        self._geoms = WallGeoms.of_batch(self._batch)
        self._around = np.full((2, num_envs), -1)  # maze and cell that the walls are around
        self._sensordata = self._batch.bind("sensordata")
        self._qpos = self._batch.bind("qpos")
        self._qvel = self._batch.bind("qvel")
        self._to_clear = [self._qvel, *map(self._batch.bind, ("qacc_warmstart", "time"))]  # when an episode begins
        self._ctrl = self._batch.bind("ctrl")
        self._marker = self._batch.bind("mocap_pos")
        self._top_camera: Cameras | None = None  # of `render`

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError(
            f"{type(self).__name__} can't be copied or pickled; copy dm_env or Gymnasium environments, or make another "
            "one with the same task and seed"
        )

    def reset(
        self, *, seed: Seeds = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Starts an episode in each environment, or in those of a mask.

        Args:
          seed: one seed for each environment, or an integer s for s, s + 1, ...; with None, an environment's stream of
            episodes goes on.
          options: `{"reset_mask": mask}` with `mask` `[B]` bool resets only where it is True. The other environments
            stay as they are, and `info` says nothing of them. `{"distances": range(1, 4)}` calls `draw_distances`
            before.

        Raises:
          InputError: if an argument is not allowed.
          gymnasium.error.ResetNeeded: if the mask leaves out environments that were never reset.
          gymnasium.error.ClosedEnvironmentError: after `close`, and in a forked process.
        """
        self._require_open()
        chosen = reset_options(options, "reset_mask", "distances")
        mask = chosen.get("reset_mask", np.ones(self.num_envs, dtype=bool))
        if not (isinstance(mask, np.ndarray) and mask.dtype == bool and mask.shape == (self.num_envs,) and mask.any()):
            raise InputError(
                f"expected reset_mask, an array of {self.num_envs} bool, not all False, found {mask!r}"[:200]
            )
        if not (self._was_reset or mask.all()):
            raise gymnasium.error.ResetNeeded("expected a call to reset() of all environments before this one of some")
        seeds = _seeds(seed, self.num_envs)
        if "distances" in chosen:
            self.draw_distances(chosen["distances"])
        for i, value in enumerate(seeds):
            if value is not None and mask[i]:
                self._rngs[i] = np.random.default_rng(value)
        # Gymnasium's own generator, from which no episode draws.
        has_one = not isinstance(seed, Sequence | np.ndarray)
        if given := [value for value in (seeds[:1] if has_one else seeds) if value is not None]:
            self._np_random = np.random.default_rng(given)
            self._np_random_seed = given[0] if has_one else tuple(seeds)  # type: ignore[assignment]  # as SyncVectorEnv
        self._was_reset = True
        indices = np.flatnonzero(mask)
        self._begin_episodes(indices)
        self._observe(indices)
        return self._observations(), self._infos(mask.copy())

    def step(
        self, actions: np.ndarray
    ) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Takes one agent step (0.16 s) in each environment; `actions` is `[B]` int, or `[B, 3]` or `[B, 2]` float.

        The rewards are `[B]` float32.

        Raises:
          gymnasium.error.ResetNeeded: before the first reset; with autoreset disabled, where an episode has ended.
          gymnasium.error.ClosedEnvironmentError: after `close`, and in a forked process.
          InputError: if `actions` are not B legal actions.
        """
        self._require_open()
        self._require_reset()
        self._ctrl[:] = self._actions.controls(actions, self.num_envs)

        # Simulate the environments whose episode is under way.
        running = self.rules.active & ~self._ended
        all_run = running.all()
        self._surround()
        self._batch.step(None if all_run else np.flatnonzero(running), nstep=STEPS_PER_ACTION, stage=_VELOCITY_STAGE)

        # Apply the rules of the task.
        rules = self.rules
        if changed := rules.advance(self._qpos, running):  # other walls around the same bodies
            self._surround()
            self._batch.forward(np.array(changed), stage=_VELOCITY_STAGE)
        self._marker[:, 0] = rules.marker
        terminated, truncated = rules.reached.copy(), rules.timed_out.copy()
        rewards = rules.rewards()
        if not all_run:
            rewards[~running] = 0

        # With NEXT_STEP, begin the episodes that follow those that ended in the step before.
        if self._ended.any():
            self._begin_episodes(np.flatnonzero(self._ended))
        self._observe()
        infos = self._infos()

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
                "another one with the same task and seed"
            )

    def _require_reset(self) -> None:
        if not self._was_reset:
            raise gymnasium.error.ResetNeeded("expected a call to reset() before this step()")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._ended.any():
            raise gymnasium.error.ResetNeeded(
                "expected a call to reset(options={'reset_mask': mask}) before this step(): the episodes ended in "
                f"environments {', '.join(map(str, np.flatnonzero(self._ended)))}"[:200]
            )

    def _autoreset(self, ended: np.ndarray, infos: dict[str, Any]) -> dict[str, Any]:
        """Begins the next episodes where one `ended`, and returns the infos with the ended ones' last observations."""
        # What was observed last, and the infos of then: those of the ended environments only.
        indices = np.flatnonzero(ended)
        final_obs = np.full(self.num_envs, None, dtype=object)
        for i in indices:
            final_obs[i] = {name: values[i].copy() for name, values in self._observed.items()}
        final_info = infos | dict.fromkeys(self._masks, ended)

        # The next episodes, and the infos of now.
        began = self._begin_episodes(indices)
        if len(began):
            self._observe(began)
        final = {"final_obs": final_obs, "_final_obs": ended, "final_info": final_info, "_final_info": ended}
        return self._infos() | final

    def _begin_episodes(self, indices: np.ndarray) -> np.ndarray:
        """Begins the next episodes of the environments `indices`; returns those of them that have one."""
        for i in indices.tolist():
            if self._episode_source:
                self.rules.begin(i, self._episode_source(i))
            else:
                rng = self._rngs[i]
                task = self._tasks[rng.integers(len(self._tasks)) if len(self._tasks) > 1 else 0]
                self.rules.begin(i, sample_episode(task, rng), task)
        self._ended[indices] = False
        began = indices[self.rules.active[indices]]
        if not len(began):
            return began

        # Reset the simulations, place walls, bodies and markers, and compute what follows from that.
        self._surround()
        for values in self._to_clear:
            values[began] = 0
        self._qpos[began] = self.rules.pose[began]
        self._marker[began, 0] = self.rules.marker[began]
        self._batch.forward(began, stage=_VELOCITY_STAGE)
        return began

    def _surround(self) -> None:
        """Puts the walls around the bodies that have entered another cell."""
        maze, cell = self.rules.maze, self.rules.cell
        moved = ((maze != self._around[0]) | (cell != self._around[1])).nonzero()[0]
        if len(moved):
            self._walls.write(self._geoms, moved, maze[moved], cell[moved])
            self._around[:] = maze, cell

    def _observe(self, indices: np.ndarray | None = None) -> None:
        """Takes over what the agents of all environments observe, or of `indices`; each call draws new noise."""
        if indices is None:
            self._observed |= self.rules.observe(self._body.states(self._sensordata))
            return
        for name, values in self.rules.observe(self._body.states(self._sensordata[indices]), indices).items():
            self._observed[name][indices] = values

    def _observations(self) -> dict[str, np.ndarray]:
        return {name: values.copy() for name, values in self._observed.items()}

    def _infos(self, mask: np.ndarray | None = None) -> dict[str, Any]:
        """Returns the infos; `mask` (`[B]` bool) says of which environments they are, of all by default."""
        mask = np.ones(self.num_envs, dtype=bool) if mask is None else mask
        return self.rules.infos() | dict.fromkeys(self._masks, mask)

    def draw_distances(self, distances: Sequence[int]) -> None:
        """Draws episodes with goals at these distances from now on, see `mazebench.Task.at_distances`."""
        self._tasks = tuple(task.at_distances(distances) for task in self._tasks)
        self.task = self._tasks[0]

    def velocity(self) -> np.ndarray:
        """Returns the true velocities `[B, 2]` (x and y on the map, m/s), for labels; agents must not use them."""
        return self._qvel[:, :2].copy()

    def render(self) -> tuple[np.ndarray, ...]:
        """Returns a picture `[480, 480, 3]` uint8 of each environment, seen from above."""
        self._require_open()
        if self._top_camera is None:
            self._top_camera = Cameras(self.task.standing, ("top",), body=self.task.body)
        worlds = zip(self.rules.maze.tolist(), self._qpos, self._marker[:, 0], strict=True)
        return tuple(self._top_camera.take(*world)["top"] for world in worlds)

    def close_extras(self, **kwargs: Any) -> None:
        if self._top_camera is not None:
            self._top_camera.close()
        del self._batch, self._geoms  # with the views of its arrays, which ends the threads
        del self._sensordata, self._qpos, self._qvel, self._ctrl, self._marker, self._to_clear


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
