"""The rollout: the loop in which an agent acts in environments, and what the agent is given in it.

`B` is the number of environments.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from mazebench.agent import Agent, Inputs, Observation, Truth
from mazebench.envs.vector import MazeVectorEnv


class Step(NamedTuple):
    """A step that an agent took in B environments."""

    inputs: Inputs  # what the agent was given before the step
    info: dict[str, Any]  # of the environments before the step, which agents are not given
    actions: np.ndarray  # [B] int, or [B, 3] or [B, 2] float
    state: Any  # the agent's, after it chose the actions
    reward: np.ndarray  # [B] float32
    terminated: np.ndarray  # [B] bool, whether the step reached the goal
    ended: np.ndarray  # [B] bool, whether the episode ended with the step
    next_observation: Observation
    next_info: dict[str, Any]


def rollout(
    agent: Agent,
    envs: MazeVectorEnv,
    first: tuple[Observation, dict[str, Any]],
    seeds: Callable[[np.ndarray], Sequence[int] | np.ndarray],
    *,
    needs_truth: bool = False,
    explore: bool = False,
    driven: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Iterator[Step]:
    """Lets an agent act in environments, and yields each step once it is taken, until no episode is left.

    Args:
      agent: begins with a new state.
      envs: the environments, which were reset.
      first: what `envs.reset` returned.
      seeds: returns the seeds `[K]` of the agent's own draws in the episodes that begin in the environments `[K]` int.
      needs_truth: whether the agent is given the true maze and pose.
      explore: whether the agent acts as in training.
      driven: returns the actions that are taken, of those that the agent chose; by default these.
    """
    observation, info = first
    state = agent.initial_state(envs.num_envs)
    seed = np.zeros(envs.num_envs, dtype=np.int64)
    active = new_episode = envs.rules.active.copy()
    while active.any():
        # What the agent is given: each episode has a seed of its own.
        begun = np.flatnonzero(new_episode)
        seed = seed.copy()
        seed[begun] = seeds(begun)
        truth = None
        if needs_truth:  # where an environment rests, it is a maze without a goal
            mazes = np.where(envs.rules.active, envs.rules.maze, 0).tolist()
            walls = np.stack([envs.task.standing[maze].walls for maze in mazes])
            pose = np.column_stack([info["position"], info["yaw"]]).astype(np.float64)
            routes = zip(envs.episodes, envs.rules.routes, strict=True)
            goals = [route.goal if episode and route else (0, 0) for episode, route in routes]
            doors = envs.rules.schedules() if envs.task.arena.moves_doors else None
            truth = Truth(walls, pose, np.array(goals, dtype=np.int64), doors)
        inputs = Inputs(observation, new_episode, info["is_first"], seed, truth, active)

        # A step. An environment whose episode ends in it takes the next one; without one, it is no longer active.
        actions, state = agent.act(inputs, state, explore)
        if driven is not None:
            actions = driven(actions)
        next_observation, reward, terminated, truncated, next_info = envs.step(actions)
        ended = terminated | truncated
        active = envs.rules.active.copy()
        new_episode = ended & active
        yield Step(inputs, info, actions, state, reward, terminated, ended, next_observation, next_info)
        observation, info = next_observation, next_info


def agent_seed(run_seed: int, number: int) -> int:
    """Returns the seed of an agent's own draws in episode `number` of a run.

    It is another seed than `Episode.seed`, of flips, warp and noise, but it gives back the number of the episode.
    """
    return int(np.random.SeedSequence([run_seed, number]).generate_state(1)[0])
