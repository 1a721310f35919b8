"""What training gives to an agent to learn from, read off the vector environment.

`B` is the number of environments. Cells are numbers, row * N + column.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mazebench.agent import Agent
from mazebench.envs.vector import MazeVectorEnv
from mazebench.maps.maze import point_to_cell
from mazebench.tasks.spec import TaskSpec


class Experience(NamedTuple):
    """One agent step in B environments.

    Rewards and ends are not in it: with the cells, they follow for whatever goal a step is learned from.
    """

    state: np.ndarray  # [B, 12] float32, observed before the step
    action: np.ndarray  # [B] int
    cell: np.ndarray  # [B] int, the body's true cell before the step
    begins: np.ndarray  # [B] bool, a trajectory begins with this step
    is_first: np.ndarray  # [B] bool, the context is new at this step: a trajectory or the leg to a goal begins
    maze: np.ndarray  # [B] int, index among the task's mazes
    start: np.ndarray  # [B] int, the cell where the leg started
    goal: np.ndarray  # [B] int, the cell where it leads
    ended: np.ndarray  # [B] bool, the trajectory ends with this step
    final_state: np.ndarray  # [B, 12] float32, observed after the step where it ended; else not defined
    final_cell: np.ndarray  # [B] int, likewise


class Collector:
    """Runs an acting policy in B environments without end, and hands over what it experiences."""

    def __init__(self, task_spec: TaskSpec, num_envs: int, seed: int, num_threads: int = 0):
        self._size = task_spec.size
        self._env = MazeVectorEnv(task_spec, num_envs, num_threads=num_threads)
        self.restart(seed)

    def restart(self, seed: int) -> None:
        """Begins new trajectories everywhere, the same for the same `seed`; make the policy's state anew, too."""
        self._streams = np.random.SeedSequence(seed).generate_state(self._env.num_envs).astype(np.int64)
        self._num_begun = np.zeros(self._env.num_envs, dtype=np.int64)  # trajectories
        self.observation, infos = self._env.reset(seed=self._streams.tolist())
        self.is_first: np.ndarray = infos["is_first"]  # [B] bool, of the current observation
        self._begins = np.ones(self._env.num_envs, dtype=bool)
        self._maze: np.ndarray = infos["maze"]

    @property
    def num_envs(self) -> int:
        """B."""
        return self._env.num_envs

    def play(self, actor: Agent, state: Any) -> tuple[Experience, Any]:
        """Takes the step that `actor`, exploring, wants in its `state`; returns its next state, too."""
        seed_episodes = getattr(actor, "seed_episodes", None)
        if seed_episodes is not None and self.is_first.any():
            self._num_begun += self._begins
            seed_episodes(self._streams + self._num_begun, self._begins)
        actions, state = actor.act(self.observation, self.is_first, state, explore=True)
        return self.step(actions), state

    def step(self, action: np.ndarray) -> Experience:
        """Takes `action` `[B]` for the current observation, which the next one replaces."""
        state, cell, (start, goal) = self.observation["state"], self._env.cells(), self._env.legs()
        before = (self._begins, self.is_first, self._maze, start, goal)
        self.observation, _, terminated, truncated, infos = self._env.step(action)
        ended = terminated | truncated
        final_state = self._final_states(infos, ended)
        self._begins, self.is_first, self._maze = ended, infos["is_first"], infos["maze"]
        return Experience(state, action, cell, *before, ended, final_state, self._final_cells(infos, ended))

    def _final_states(self, infos: dict[str, Any], ended: np.ndarray) -> np.ndarray:
        states = np.zeros((self.num_envs, 12), dtype=np.float32)
        for index in np.flatnonzero(ended):
            states[index] = infos["final_obs"][index]["state"]
        return states

    def _final_cells(self, infos: dict[str, Any], ended: np.ndarray) -> np.ndarray:
        if not ended.any():
            return np.zeros(self.num_envs, dtype=np.int64)
        return point_to_cell(infos["final_info"]["position"], self._size) @ (self._size, 1)
