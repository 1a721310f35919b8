"""Runs some of an evaluation's episodes, as many side by side as there are environments.

`B` is the number of environments.
"""

from __future__ import annotations

import collections
import contextlib
import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from mazebench.agent import Agent, Inputs
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError, RunError, UnplayableError
from mazebench.evaluation.agent_inputs import agent_seed, true_state
from mazebench.evaluation.checked_agent import AgentError
from mazebench.evaluation.plan import Plan
from mazebench.evaluation.recorder import PoseRecorder, Recorder
from mazebench.results.metrics import spl
from mazebench.results.records import Record
from mazebench.results.trajectories import Trajectory
from mazebench.tasks.episode import Episode
from mazebench.tasks.observation import state_errors
from mazebench.tasks.task import Task
from mazebench.tasks.trials import Trial

PATIENCE = 0.5  # seconds that a pool waits for a chunk to end before it lets the caller look for signals


@dataclasses.dataclass(frozen=True)
class Chunk:
    """Some episodes of an evaluation, for one process to run."""

    plan: Plan
    episodes: tuple[int, ...]  # their indices in the plan
    record: bool  # whether trajectories are wanted
    num_envs: int  # environments side by side
    num_threads: int  # of the simulation; 0 for all cores


class Ended(NamedTuple):
    """An episode that ended."""

    record: Record
    trajectory: Trajectory | None  # None where none is wanted


@dataclasses.dataclass(frozen=True)
class Outcome:
    """The result of a trial."""

    index: int  # of the trial
    trial: Trial
    success: bool
    steps: int
    path_length: float  # m
    blocked: bool  # whether a wall stands in the shortest path on the shown map
    recorded: Any  # what the recorder made of it; None without one


def run_chunk(chunk: Chunk) -> Iterator[list[Ended]]:
    """Yields the episodes that ended, after each step; each once, in no fixed order."""
    plan = chunk.plan
    trials = [(index, plan.trials[index]) for index in chunk.episodes]
    agent = plan.build_agent()
    for outcomes in run_trials(
        agent,
        plan.task,
        trials,
        chunk.num_envs,
        chunk.num_threads,
        seed=plan.options.seed,
        needs_truth=plan.agent_class.needs_truth,
        recorder=PoseRecorder() if chunk.record else None,
    ):
        yield [Ended(_to_record(plan, outcome), _to_trajectory(plan.task, outcome)) for outcome in outcomes]


def run_whole_chunk(chunk: Chunk) -> list[Ended]:
    """Returns all episodes of a chunk.

    Raises:
      InputError, RunError: of the plain kinds, since what caused them need not survive the way to another process.
    """
    try:
        return [ended for step in run_chunk(chunk) for ended in step]
    except (InputError, RunError) as error:
        kinds = (UnplayableError, InputError, AgentError, RunError)
        raise next(kind for kind in kinds if isinstance(error, kind))(str(error)) from None


def run_trials(
    agent: Agent,
    task: Task,
    trials: Sequence[tuple[int, Trial]],
    num_envs: int,
    num_threads: int = 0,
    *,
    seed: int = 0,
    needs_truth: bool = False,
    recorder: Recorder | None = None,
) -> Iterator[list[Outcome]]:
    """Yields what came of the trials that ended, after each step; each once, in no fixed order.

    Args:
      agent: acts without exploring.
      task: the task, with the mazes that the trials index.
      trials: the episodes to run, each with its index.
      num_envs: environments side by side, at most; outcomes of an agent that keeps its contract do not depend on it.
      num_threads: of the simulation; 0 for all cores.
      seed: of what the agent draws; with a trial's index it gives the seed of the episode's draws.
      needs_truth: whether the agent is given the true maze and pose.
      recorder: of the episodes.
    """
    if not trials:
        return

    num_envs = min(num_envs, len(trials))
    # The longest ways first, so that no environment is left alone with one at the end.
    queue = collections.deque(sorted(trials, key=lambda numbered: -numbered[1].shortest_path))
    slots: list[tuple[int, Trial] | None] = [None] * num_envs

    def next_episode(slot: int) -> Episode | None:
        slots[slot] = numbered = queue.popleft() if queue else None
        return None if numbered is None else numbered[1].episode

    state = agent.initial_state(num_envs)
    active = new_episode = np.ones(num_envs, dtype=bool)
    seeds = np.zeros(num_envs, dtype=np.int64)
    env = MazeVectorEnv(task, num_envs, num_threads=num_threads, episode_source=next_episode)
    with contextlib.closing(env):
        observation, info = env.reset()
        while active.any():
            # What the agent is told: each episode has a seed of its own.
            for slot in np.flatnonzero(new_episode):
                seeds[slot] = agent_seed(seed, _present(slots[slot])[0])
            truth = true_state(task, env.episodes, info["position"], info["yaw"]) if needs_truth else None
            inputs = Inputs(
                observation=observation,
                new_episode=new_episode,
                new_context=info["is_first"],
                seed=seeds,
                truth=truth,
                active=active,
            )

            # A step. An environment whose episode ends in it takes the next one; without one, it is no longer active.
            actions, state = agent.act(inputs, state)
            if recorder:
                recorder.add(observation, info, actions, active)
            running = list(slots)
            observation, _, terminated, truncated, info = env.step(actions)
            ended = terminated | truncated
            active = np.array([numbered is not None for numbered in slots])
            new_episode = ended & active

            yield [_outcome(*_present(running[slot]), info, slot, recorder) for slot in np.flatnonzero(ended).tolist()]


def _present(numbered: tuple[int, Trial] | None) -> tuple[int, Trial]:
    assert numbered is not None
    return numbered


def _outcome(index: int, trial: Trial, info: dict[str, Any], slot: int, recorder: Recorder | None) -> Outcome:
    final = info["final_info"]
    recorded = recorder.take(slot, info["final_obs"][slot], final) if recorder else None
    success, steps = bool(final["success"][slot]), int(final["steps"][slot])
    path_length, blocked = float(final["path_length"][slot]), bool(final["blocked"][slot])
    return Outcome(index, trial, success, steps, path_length, blocked, recorded)


def _to_trajectory(task: Task, outcome: Outcome) -> Trajectory | None:
    if outcome.recorded is None:
        return None
    is_wrong = task.track is not None and state_errors(task, outcome.trial.episode)
    return Trajectory(outcome.recorded.true, outcome.recorded.observed if is_wrong else None)


def _to_record(plan: Plan, outcome: Outcome) -> Record:
    task, trial, episode = plan.task, outcome.trial, outcome.trial.episode
    maze = task.mazes[episode.maze]
    # Of the body as a disc, and from cell to cell; both in metres.
    shortest = np.array([trial.shortest_path, trial.distance * task.cell_size])
    spl_of_disc, spl_grid = spl(np.array([outcome.success]), shortest, np.array([outcome.path_length])).tolist()
    values = {
        "agent": plan.options.agent,
        "task": task.name,
        "size": task.size,
        "split": task.options.split_in_results,
        "episode": outcome.index,
        "maze": maze.name,
        "start": episode.start,
        "goal": episode.goal,
        "distance": trial.distance,
        "success": outcome.success,
        "steps": outcome.steps,
        "path_length": outcome.path_length,
        "shortest_path": trial.shortest_path,
        "spl": spl_of_disc,
        "spl_grid": spl_grid,
        "seed": episode.seed,
        "leg": 1,
        "oracle_steps": trial.oracle_steps,
    }
    further: dict[str, Any] = {} if task.cell_size == 1 else {"cell_size": task.cell_size}
    if task.track is not None:
        further["level"] = task.options.track_level
    noise = {"lidar_noise": task.options.lidar_noise, "odometry_noise": task.options.odometry_noise}
    further |= {name: value for name, value in noise.items() if value is not None}
    further |= task.options.perturbations
    if task.track is not None:  # summaries report the episodes of each of these groups apart
        further["blocked"] = outcome.blocked
        if maze.kind:
            further["kind"] = maze.kind
    return Record.model_validate(values | further)
