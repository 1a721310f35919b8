"""A building that changes while one drives: all environments exchange the walls at the same step."""

from __future__ import annotations

import copy
import dataclasses
import functools
import pickle
from typing import Any

import numpy as np
import pytest

from mazebench.agent import Agent
from mazebench.envs.dm_control import Environment
from mazebench.envs.goal import GoalMazeEnv
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.maps.maze import Maze
from mazebench.rollout import rollout
from mazebench.tasks.episode import Episode
from mazebench.tasks.perturbations.perturbation import Of, Perturbation
from mazebench.tasks.task import Task

CLOSES, OPENS = 4, 40  # the steps after which the door does so
NUM_STEPS = 70
DOOR = (3, 4)
# A passage along the third row, with the door in it, and the detour around it.
PLAN = """
#########
#.......#
#.#####.#
#.......#
#########
#########
#########
#########
#########
"""
EPISODE = Episode(maze=0, start=(3, 1), goal=(1, 7), yaw=0.0, seed=1)


def stands(step: int, maze: int, cell: tuple[int, int]) -> int:
    return int(CLOSES <= step < OPENS)


@dataclasses.dataclass(frozen=True)
class Closing(Perturbation):
    of = Of.BUILDING

    def standing(self, rng):
        return stands


class ClosingTask(Task):
    def perturbations(self, level):
        return [*super().perturbations(level), Closing()]


@functools.cache
def task() -> ClosingTask:
    opened = np.array([[cell == "#" for cell in row] for row in PLAN.split()])
    closed = opened.copy()
    closed[DOOR] = True
    of_mazes = Task.of(mazes=[Maze(opened, "open"), Maze(closed, "closed")], sensors="lidar", time_limit=NUM_STEPS)
    return ClosingTask(*(getattr(of_mazes, field.name) for field in dataclasses.fields(of_mazes)))


def ahead_in_vector(num_envs: int = 3) -> list[tuple[Any, ...]]:
    """The steps of the last environment, which drives ahead."""
    env = MazeVectorEnv(task(), num_envs, episode_source=lambda slot: EPISODE)
    env.reset()
    steps = []
    for _ in range(NUM_STEPS - 1):
        observation, reward, *_, info = env.step(np.zeros(num_envs, dtype=int))
        shown = observation["state"][-1], observation["lidar"][-1], reward[-1].item(), info["way_left"][-1].item()
        steps.append((*shown, env.rules.maze[-1].item()))
    return steps


def ahead_in_one(kind: type[MazeEnv], env: MazeEnv | None = None, num_steps: int = NUM_STEPS - 1) -> list[Any]:
    if env is None:
        env = kind(task())
        env.reset(options={"episode": EPISODE})
    steps = []
    for _ in range(num_steps):
        observation, reward, *_, info = env.step(0)
        state = observation["observation"][:12] if kind is GoalMazeEnv else observation["state"]
        steps.append((state, observation["lidar"], reward, info["way_left"], info["maze"]))
    return steps


def ahead_in_dm_control() -> list[Any]:
    env = Environment(task())
    env.reset(episode=EPISODE)
    steps = []
    for _ in range(NUM_STEPS - 1):
        step, rules = env.step(0), env.task.rules
        shown = step.observation["state"], step.observation["lidar"], step.reward
        steps.append((*shown, rules.way_left.item(), rules.maze.item()))
    return steps


def assert_same(steps, others):
    assert len(steps) == len(others)
    for step, other in zip(steps, others, strict=True):
        for value, expected in zip(step, other, strict=True):
            np.testing.assert_array_equal(value, expected)


@pytest.mark.parametrize(
    "play",
    [
        lambda: ahead_in_vector(1),
        lambda: ahead_in_one(MazeEnv),
        lambda: ahead_in_one(GoalMazeEnv),
        ahead_in_dm_control,
    ],
    ids=["vector of one", "gymnasium", "goal", "dm_control"],
)
def test_all_environments_play_the_same_episode(play):
    assert_same(play(), ahead_in_vector())


def test_body_sensors_and_ways_meet_the_walls_that_stand_now():
    """The body, of radius 0.1 m or so, starts at x = 1.5 and is stopped by the door, whose near side is at x = 4."""
    states, lidar, _, way_left, maze = zip(*ahead_in_vector(), strict=True)
    x, ahead = np.array(states)[:, 0], np.array(lidar)[:, 0]
    assert maze == tuple(int(CLOSES <= step < OPENS) for step in range(1, NUM_STEPS))
    np.testing.assert_allclose(ahead[: CLOSES - 1], np.minimum(5, 8 - x[: CLOSES - 1]), atol=1e-5)
    np.testing.assert_allclose(ahead[CLOSES - 1 : OPENS - 1], 4 - x[CLOSES - 1 : OPENS - 1], atol=1e-5)
    assert 3.5 < x[OPENS - 2] < 4, "stopped by the door"
    assert x[-1] > 7, "through the door when it was open again"

    # In cells: from (3, 1) through the door, and around; from the cell before the door, and then from the last one.
    assert way_left[0] == 8
    assert way_left[OPENS - 2] == 10
    assert way_left[OPENS - 1] == 6
    assert way_left[-1] == 2


@pytest.mark.parametrize("taken", [2, 10], ids=["before", "after"])
@pytest.mark.parametrize("kind", [MazeEnv, GoalMazeEnv])
def test_states_and_copies_go_on_with_the_walls_of_their_step(kind, taken):
    whole, env = ahead_in_one(kind), kind(task())
    env.reset(options={"episode": EPISODE})
    ahead_in_one(kind, env, taken)
    state, copies = env.get_state(), [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]  # noqa: S301
    ahead_in_one(kind, env, 45)
    env.set_state(state)
    for each in (env, *copies):
        assert_same(ahead_in_one(kind, each, NUM_STEPS - 1 - taken), whole[taken:])


def test_dm_control_goes_back_to_a_state_with_other_walls():
    env = Environment(task())
    env.reset(episode=EPISODE)
    steps = [env.step(0) for _ in range(2)]
    state = env.get_state()
    steps = [env.step(0) for _ in range(50)]
    env.set_state(state)
    for expected in steps:
        step = env.step(0)
        assert all((step.observation[name] == expected.observation[name]).all() for name in step.observation)


class Ahead(Agent):
    def initial_state(self, batch_size):
        return None

    def act(self, inputs, state, explore=False):
        return np.zeros(len(inputs.seed), dtype=int), state


def test_a_privileged_agent_is_given_the_walls_that_stand_now():
    episodes = [EPISODE]
    envs = MazeVectorEnv(task(), 1, episode_source=lambda slot: episodes.pop() if episodes else None)
    steps = rollout(Ahead(), envs, envs.reset(), np.zeros_like, needs_truth=True)
    closed = [step.inputs.truth.walls[0][DOOR].item() for step in steps]
    assert closed == [CLOSES <= step < OPENS for step in range(NUM_STEPS)]
