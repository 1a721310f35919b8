"""Runs an agent through episodes, as many at a time as there are environments."""

from __future__ import annotations

import collections
from collections.abc import Iterator, Sequence

import numpy as np

from mazebench.agent import Agent
from mazebench.envs.vector import MazeVectorEnv
from mazebench.evaluation.metrics import spl
from mazebench.evaluation.protocol import Trial
from mazebench.records import Record
from mazebench.tasks.episode import Episode
from mazebench.tasks.spec import TaskSpec


def run_trials(
    agent: Agent, task_spec: TaskSpec, trials: Sequence[tuple[int, Trial]], num_envs: int, num_threads: int = 0
) -> Iterator[list[Record]]:
    """Yields the records of the episodes that ended, step by step; each once, in no fixed order.

    Args:
      agent: acts greedily; only its `initial_state`, `seed_episodes` and `act` are called.
      task_spec: the task, with the mazes the trials index.
      trials: (index, trial) of the episodes to run.
      num_envs: environments side by side; the records of an agent that keeps to its contract do not depend on it.
      num_threads: of the simulation, 0 for all cores.
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
    begins = np.ones(num_envs, dtype=bool)
    seed_episodes = getattr(agent, "seed_episodes", None)
    while any(running):
        if seed_episodes is not None and info["is_first"].any():
            seed_episodes(np.array([trial[1].episode.seed if trial else 0 for trial in running]), begins)
        actions, state = agent.act(observation, info["is_first"], state)
        ran = list(running)
        observation, _, terminated, truncated, info = env.step(actions)
        ended = terminated | truncated
        begins = ended & np.array([trial is not None for trial in running])
        if ended.any():
            yield [_record(task_spec, ran[slot], info["final_info"], slot) for slot in np.flatnonzero(ended).tolist()]


def _record(task_spec: TaskSpec, numbered: tuple[int, Trial] | None, final_info: dict, slot: int) -> Record:
    assert numbered is not None
    index, trial = numbered
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
