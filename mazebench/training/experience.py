"""Collecting experience to learn from, in the vector environment.

`B` is the number of environments. A cell is given by its index, row * N + column.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mazebench.agent import Inputs, Observation
from mazebench.envs.vector import MazeVectorEnv
from mazebench.tasks.task import Task

_SEEDS = 2**31


class Experience(NamedTuple):
    """One agent step in B environments.

    Rewards and ends are those of the goal that the agent was sent to; for another goal, they follow from the cells.
    """

    state: np.ndarray  # [B, 12] float32, observed before the step
    action: np.ndarray  # [B] int
    cell: np.ndarray  # [B] int, the body's true cell before the step
    pose: np.ndarray  # [B, 3] float64, its true x and y (m) and yaw (rad)
    velocity: np.ndarray  # [B, 2] float64, the true one on the map (m/s)
    new_episode: np.ndarray  # [B] bool, whether a trajectory begins with this step
    new_context: np.ndarray  # [B] bool, whether a trajectory or the leg to another goal begins with this step
    maze: np.ndarray  # [B] int, index among the task's mazes
    start: np.ndarray  # [B] int, the cell where the leg started
    goal: np.ndarray  # [B] int, the cell where the leg leads
    reward: np.ndarray  # [B] float32, for the step
    terminated: np.ndarray  # [B] bool, whether the step reached the goal
    ended: np.ndarray  # [B] bool, whether the trajectory ends with this step
    final_state: np.ndarray  # [B, 12] float32, observed after the step where it ended; undefined elsewhere
    final_cell: np.ndarray  # [B] int, likewise
    context: np.ndarray  # [B, 4, M, M] float32, observed before the step
    sensors: Observation  # [B, ...] by the sensor's name, observed before the step
    final_sensors: Observation  # observed after the step where the trajectory ended; undefined elsewhere
    task: Task  # that was played
    notes: Any  # what the agent's `notes` returned


class Collector:
    """Steps B environments without end, and returns what is experienced in them."""

    def __init__(self, task: Task, num_envs: int, seed: int, num_threads: int = 0):
        self._task = task
        self._any_maze = task.mazes[0]  # all have one size and one cell size
        self._env = MazeVectorEnv(task, num_envs, num_threads=num_threads)
        self.restart(seed)

    def restart(self, seed: int) -> None:
        """Begins new trajectories everywhere, the same for the same `seed`; the agent's state must be made anew."""
        root = np.random.SeedSequence(seed)
        observation, infos = self._env.reset(seed=root.generate_state(self.num_envs).tolist())
        # What an agent draws from must not let it reconstruct its episode's flips, warp or noise.
        self._agent_seeds = np.random.default_rng(root.spawn(1)[0])
        self._maze: np.ndarray = infos["maze"]
        everywhere = np.ones(self.num_envs, dtype=bool)
        seeds = self._agent_seeds.integers(_SEEDS, size=self.num_envs)
        self.inputs = Inputs(observation, everywhere, infos["is_first"], seeds)  # of the next step

    @property
    def num_envs(self) -> int:
        """B."""
        return self._env.num_envs

    def limit_distances(self, longest: int) -> None:
        """Sends the agent to goals at most so many cells away from now on, or to the nearest of the task's."""
        distances = self._task.distances
        self._env.draw_distances([each for each in distances if each <= longest] or [min(distances)])

    def step(self, action: np.ndarray, notes: Any = None) -> Experience:
        """Takes `action` `[B]` for the current `inputs`, which those of the next step replace; keeps the `notes`."""
        now, rules = self.inputs, self._env.rules
        cell, pose, velocity = rules.cell.copy(), rules.pose.copy(), self._env.velocity()
        before = (now.new_episode, now.new_context, self._maze, rules.start.copy(), rules.target.copy())
        observation, reward, terminated, truncated, infos = self._env.step(action)
        ended = terminated | truncated
        seeds = now.seed.copy()
        seeds[ended] = self._agent_seeds.integers(_SEEDS, size=int(ended.sum()))
        self.inputs = Inputs(observation, ended, infos["is_first"], seeds)
        self._maze = infos["maze"]
        final = {name: self._final(name, infos, ended) for name in ("state", *self._task.sensors)}
        return Experience(
            now.observation["state"],
            action,
            cell,
            pose,
            velocity,
            *before,
            reward,
            terminated,
            ended,
            final["state"],
            self._final_cells(infos, ended),
            now.observation["context"],
            {name: now.observation[name] for name in self._task.sensors},
            {name: final[name] for name in self._task.sensors},
            self._task,
            notes,
        )

    def _final(self, name: str, infos: dict[str, Any], ended: np.ndarray) -> np.ndarray:
        """Returns `[B, ...]`: the last observation called `name` where a trajectory ended, zero elsewhere."""
        final = np.zeros_like(self.inputs.observation[name])
        for index in np.flatnonzero(ended):
            final[index] = infos["final_obs"][index][name]
        return final

    def _final_cells(self, infos: dict[str, Any], ended: np.ndarray) -> np.ndarray:
        if not ended.any():
            return np.zeros(self.num_envs, dtype=np.int64)
        return self._any_maze.cell_index(infos["final_info"]["position"])
