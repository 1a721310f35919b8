"""Runs an agent through episodes, as many at a time as there are environments."""

from __future__ import annotations

import collections
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from mazebench.agent import Agent
from mazebench.envs.vector import MazeVectorEnv
from mazebench.evaluation.contract import CheckedAgent
from mazebench.evaluation.metrics import spl
from mazebench.evaluation.protocol import Trial
from mazebench.evaluation.trajectories import Trajectory
from mazebench.records import Record
from mazebench.tasks.episode import Episode
from mazebench.tasks.spec import TaskSpec

_YAW = 5  # place in the state
_NUM_POSES = 128  # room for a local episode; more is made where it is needed


def run_trials(
    agent: Agent | CheckedAgent,
    task_spec: TaskSpec,
    trials: Sequence[tuple[int, Trial]],
    num_envs: int,
    num_threads: int = 0,
    on_trajectory: Callable[[int, Trajectory], None] | None = None,
) -> Iterator[list[Record]]:
    """Yields the records of the episodes that ended, step by step; each once, in no fixed order.

    Args:
      agent: acts greedily; only its `initial_state`, `seed_episodes` and `act` are called.
      task_spec: the task, with the mazes the trials index.
      trials: (index, trial) of the episodes to run.
      num_envs: environments side by side; the records of an agent that keeps to its contract do not depend on it.
      num_threads: of the simulation, 0 for all cores.
      on_trajectory: called with an episode's index and its trajectory, before its record is yielded.
    """
    if not trials:
        return
    num_envs = min(num_envs, len(trials))
    waiting = collections.deque(trials)
    running: list[tuple[int, Trial] | None] = [None] * num_envs

    def next_episode(slot: int) -> Episode | None:
        running[slot] = numbered = waiting.popleft() if waiting else None
        return None if numbered is None else numbered[1].episode

    env = MazeVectorEnv(task_spec, num_envs, num_threads=num_threads, episode_source=next_episode)
    observation, info = env.reset()
    state = agent.initial_state(num_envs)
    begins = active = np.ones(num_envs, dtype=bool)
    seed_episodes = getattr(agent, "seed_episodes", None)
    tracks = _Tracks(task_spec, num_envs) if on_trajectory else None
    while active.any():
        if tracks:
            tracks.add(info["position"], observation["state"], active)
        if seed_episodes is not None and info["is_first"].any():
            seed_episodes(np.array([trial[1].episode.seed if trial else 0 for trial in running]), begins)
        actions, state = agent.act(observation, info["is_first"], state)
        ran = list(running)
        observation, _, terminated, truncated, info = env.step(actions)
        ended = terminated | truncated
        active = np.array([trial is not None for trial in running])
        begins = ended & active
        done = [(slot, *_present(ran[slot])) for slot in np.flatnonzero(ended).tolist()]
        if tracks and on_trajectory:
            for slot, index, trial in done:
                on_trajectory(index, tracks.take(slot, trial, info))
        if done:
            yield [_record(task_spec, index, trial, info["final_info"], slot) for slot, index, trial in done]


def _present(numbered: tuple[int, Trial] | None) -> tuple[int, Trial]:
    assert numbered is not None
    return numbered


def _record(task_spec: TaskSpec, index: int, trial: Trial, final_info: dict[str, Any], slot: int) -> Record:
    success, driven = bool(final_info["success"][slot]), float(final_info["path_length"][slot])
    both = spl(np.array([success] * 2), np.array([trial.shortest_path, float(trial.distance)]), np.array([driven] * 2))
    return {
        "episode": index,
        "maze": task_spec.mazes[trial.episode.maze].name,
        "start": list(trial.episode.start),
        "goal": list(trial.episode.goal),
        "distance": trial.distance,
        "success": success,
        "steps": int(final_info["steps"][slot]),
        "path_length": driven,
        "shortest_path": trial.shortest_path,
        "spl": float(both[0]),
        "spl_grid": float(both[1]),
        "seed": trial.episode.seed,
    }


class _Tracks:
    """The poses in each environment since its episode began; `B` is their number."""

    def __init__(self, task_spec: TaskSpec, num_envs: int):
        self._task_spec = task_spec
        self._pose = np.empty((num_envs, _NUM_POSES, 3), dtype=np.float16)
        self._count = np.zeros(num_envs, dtype=np.int64)

    def add(self, position: np.ndarray, state: np.ndarray, active: np.ndarray) -> None:
        """Notes the poses where `active`: `[B, 2]` m as they truly are, and `[B, 12]` as the agent observes them."""
        if self._count.max() == self._pose.shape[1]:
            self._pose = np.concatenate([self._pose, np.empty_like(self._pose)], axis=1)
        slots = np.arange(len(position))
        self._pose[slots, self._count, :2] = position
        self._pose[slots, self._count, 2] = state[:, _YAW]  # which is never perturbed
        self._count += active

    def take(self, slot: int, trial: Trial, info: dict[str, Any]) -> Trajectory:
        """The trajectory of the episode that just ended in `slot`, of which `info` has the last moment."""
        last = [*info["final_info"]["position"][slot], info["final_obs"][slot]["state"][_YAW]]
        pose = np.concatenate([self._pose[slot, : self._count[slot]], np.array([last], dtype=np.float16)])
        self._count[slot] = 0
        spec, shown = self._task_spec, self._task_spec.show(trial.episode)
        cells = spec.route(trial.episode, shown).cells[1:]
        landmarks = np.array([row * spec.size + column for row, column in cells], dtype=np.int32)
        return Trajectory(pose, shown.seen_walls(), landmarks)
