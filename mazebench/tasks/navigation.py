"""The navigation task and its environment on dm_control."""

from __future__ import annotations

import dm_env
import numpy as np
from dm_control.rl import control
from dm_env import specs

from mazebench.maps.maze import cell_to_point, point_to_cell
from mazebench.tasks.actions import VELOCITY_SIZE, controls_of_action, controls_of_velocities
from mazebench.tasks.context import NUM_PLANES
from mazebench.tasks.episode import Episode, Event
from mazebench.tasks.spec import TaskSpec
from mazebench.world.mjcf import ACTIONS, STEPS_PER_ACTION
from mazebench.world.physics import STATE_SIZE, Physics


class Navigation(control.Task):
    """Drive to the goal cell of a maze never seen before, with a map of it at hand.

    Actions: one of six, 0.16 s each: forward, backward, strafe_left, strafe_right, look_left, look_right. With
    `continuous`, `[3]` velocities to drive at for 0.16 s, each in [-1, 1]: forward and left in shares of the top speed
    (together no faster than it), turning to the left in shares of the turn rate.

    Observations:

    - state: `[12]` float32: x, y, z (m); roll, pitch, yaw (rad, yaw in [-pi, pi)); velocity forward, left, up (m/s);
      angular velocity about the body's x, y, z (rad/s). With `position_noise`, x and y are noisy.
    - context: `[4, M, M]` float32, constant until the next landmark: the map, the map around the start, goal, start.
    - is_first: bool, only where an episode has several legs: this context is new, as at the start of an episode.
    - egocentric, top, chase: `[H, H, 3]` uint8, those of `cameras`; they show the true world, the goal's marker in it.

    Reward: -1 a step, 0 for the step that reaches the goal cell; never discounted on the way.

    Termination: when the body's centre is in the goal cell after a step (discount 0), else when `time_limit` steps went
    by, in the hierarchical task at the last landmark (discount 1: a truncation). The goal wins over the limit.
    """

    def __init__(self, spec: TaskSpec, rng: np.random.Generator):
        self.spec = spec
        self.rng = rng
        self.path_length = 0.0  # m, driven since the start of the episode
        self.steps = 0  # agent steps since the start of the episode
        self._next_episode: Episode | None = None
        self._event = Event.NONE
        self._cameras = spec.open_cameras()

    def set_next_episode(self, episode: Episode) -> None:
        """Makes the next reset play `episode` instead of one that is drawn.

        Raises:
          InputError: if it can't be played in this task's mazes.
        """
        self._next_episode = self.spec.check_episode(episode)

    @property
    def success(self) -> bool:
        """Whether the goal has been reached."""
        return self._event is Event.REACHED

    @property
    def is_first(self) -> bool:
        """Whether the context is new: at the start of an episode and of each leg to a landmark."""
        return self._is_first

    def initialize_episode(self, physics: Physics) -> None:
        self.episode = self._next_episode or self.spec.sample_episode(self.rng)
        self._next_episode = None
        episode = self.episode
        physics.load_maze(self.spec.models[episode.maze])
        self._position = cell_to_point(episode.start, self.spec.size)
        physics.place_agent(self._position, episode.yaw)
        self.shown_map = self.spec.show(episode)
        self.route = self.spec.route(episode, self.shown_map)
        self._noise = episode.streams()[2] if self.spec.perturbation.position_noise else None
        self.path_length, self.steps, self._event = 0.0, 0, Event.NONE
        self._begin_leg(physics)

    def before_step(self, action: int | np.ndarray, physics: Physics) -> None:
        if self.spec.continuous:
            physics.set_controls(controls_of_velocities(np.asarray(action), (VELOCITY_SIZE,)))
        else:
            physics.set_controls(controls_of_action(action))  # type: ignore[arg-type]

    def after_step(self, physics: Physics) -> None:
        position = physics.position()
        moved = position - self._position
        self.path_length += float(np.sqrt(moved[0] * moved[0] + moved[1] * moved[1]))
        self._position = position
        self.steps += 1
        row, column = point_to_cell(position, self.spec.size).tolist()
        self._event = self.route.advance((row, column), self.steps)
        self._is_first = False
        if self._event is Event.LANDMARK:
            self._begin_leg(physics)

    def _begin_leg(self, physics: Physics) -> None:
        self._context = self.spec.context(self.shown_map, self.route.start, self.route.target)
        self._is_first = True
        physics.place_goal(self.route.goal, self.spec.size)

    def get_observation(self, physics: Physics) -> dict[str, np.ndarray]:
        state = physics.state()
        if self._noise is not None:
            state[:2] += self._noise.normal(0.0, self.spec.perturbation.position_noise, size=2)
        observation = {"state": state.astype(np.float32), "context": self._context.copy()}
        if self.spec.has_legs:
            observation["is_first"] = np.array(self._is_first)
        if self._cameras is not None:
            model = self.spec.models[self.episode.maze]
            observation |= self._cameras.take(model, physics.data.qpos, physics.data.mocap_pos[0])
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
        size = self.spec.context_size
        result = {
            "state": specs.Array((STATE_SIZE,), np.float32, name="state"),
            "context": specs.BoundedArray((NUM_PLANES, size, size), np.float32, 0.0, 1.0, name="context"),
        }
        if self.spec.has_legs:
            result["is_first"] = specs.Array((), bool, name="is_first")
        shape = (self.spec.camera_size, self.spec.camera_size, 3)
        return result | {name: specs.BoundedArray(shape, np.uint8, 0, 255, name) for name in self.spec.cameras}

    def close(self) -> None:
        """Closes the rendering context of the cameras, if there is one."""
        if self._cameras is not None:
            self._cameras.close()


class Environment(control.Environment):
    """A dm_control Environment whose `reset` also takes a seed, or the very episode to play."""

    physics: Physics
    task: Navigation

    def __init__(self, spec: TaskSpec, seed: int | None = None):
        task = Navigation(spec, np.random.default_rng(seed))
        # The task judges the time limit itself, so that a goal reached on the last step is a termination.
        super().__init__(Physics.of_maze(spec.models[0]), task, n_sub_steps=STEPS_PER_ACTION)

    def reset(self, seed: int | None = None, episode: Episode | None = None) -> dm_env.TimeStep:
        """Starts an episode: the next one of the environment's stream, the first one of `seed`'s, or `episode`."""
        if seed is not None:
            self.task.rng = np.random.default_rng(seed)
        if episode is not None:
            self.task.set_next_episode(episode)
        return super().reset()

    @property
    def needs_reset(self) -> bool:
        """Whether no episode is under way, so that the next `step` would start one."""
        return self._reset_next_step

    def close(self) -> None:
        self.task.close()

    def reward_spec(self) -> specs.BoundedArray:
        return specs.BoundedArray((), float, -1.0, 0.0, name="reward")
