"""Collecting experience to learn from, in the vector environment.

`B` is the number of environments. A cell is given by its index, row * N + column.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mazebench.agent import Agent, Inputs
from mazebench.envs.vector import MazeVectorEnv
from mazebench.maps.maze import point_to_cell
from mazebench.tasks.spec import TaskSpec

_SEEDS = 2**31


class Experience(NamedTuple):
    """One agent step in B environments.

    It holds neither rewards nor ends of episodes: both follow from the cells, for any goal that a step is learned from.
    """

    state: np.ndarray  # [B, 12] float32, observed before the step
    action: np.ndarray  # [B] int
    cell: np.ndarray  # [B] int, the body's true cell before the step
    new_episode: np.ndarray  # [B] bool, whether a trajectory begins with this step
    new_context: np.ndarray  # [B] bool, whether a trajectory or the leg to another goal begins with this step
    maze: np.ndarray  # [B] int, index among the task's mazes
    start: np.ndarray  # [B] int, the cell where the leg started
    goal: np.ndarray  # [B] int, the cell where the leg leads
    ended: np.ndarray  # [B] bool, whether the trajectory ends with this step
    final_state: np.ndarray  # [B, 12] float32, observed after the step where it ended; undefined elsewhere
    final_cell: np.ndarray  # [B] int, likewise


class Collector:
    """Runs an exploring agent in B environments without end, and returns what it experiences."""

    def __init__(self, task_spec: TaskSpec, num_envs: int, seed: int, num_threads: int = 0):
        self._size = task_spec.size
        self._env = MazeVectorEnv(task_spec, num_envs, num_threads=num_threads)
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

    def play(self, agent: Agent, state: Any) -> tuple[Experience, Any]:
        """Takes the step that the exploring `agent` chooses in its `state`; returns the agent's next state, too."""
        actions, state = agent.act(self.inputs, state, explore=True)
        return self.step(actions), state

    def step(self, action: np.ndarray) -> Experience:
        """Takes `action` `[B]` for the current `inputs`, which those of the next step replace."""
        now, cell, (start, goal) = self.inputs, self._env.cells(), self._env.legs()
        before = (now.new_episode, now.new_context, self._maze, start, goal)
        observation, _, terminated, truncated, infos = self._env.step(action)
        ended = terminated | truncated
        seeds = now.seed.copy()
        seeds[ended] = self._agent_seeds.integers(_SEEDS, size=int(ended.sum()))
        self.inputs = Inputs(observation, ended, infos["is_first"], seeds)
        self._maze = infos["maze"]
        final = (self._final_states(infos, ended), self._final_cells(infos, ended))
        return Experience(now.observation["state"], action, cell, *before, ended, *final)

    def _final_states(self, infos: dict[str, Any], ended: np.ndarray) -> np.ndarray:
        states = np.zeros((self.num_envs, 12), dtype=np.float32)
        for index in np.flatnonzero(ended):
            states[index] = infos["final_obs"][index]["state"]
        return states

    def _final_cells(self, infos: dict[str, Any], ended: np.ndarray) -> np.ndarray:
        if not ended.any():
            return np.zeros(self.num_envs, dtype=np.int64)
        return point_to_cell(infos["final_info"]["position"], self._size) @ (self._size, 1)
