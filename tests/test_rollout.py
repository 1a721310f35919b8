"""The rollout: what an agent is given in each step, until no episode is left."""

from __future__ import annotations

import numpy as np
from simple_mazes import field

from mazebench.agent import Agent
from mazebench.envs.vector import MazeVectorEnv
from mazebench.rollout import rollout
from mazebench.tasks.episode import Episode
from mazebench.tasks.task import Task


class Ahead(Agent):
    """Drives ahead, and counts its steps in the state."""

    def initial_state(self, batch_size):
        return 0

    def act(self, inputs, state, explore=False):
        return np.zeros(len(inputs.seed), dtype=int), state + 1


def test_an_agent_is_told_when_episodes_begin_and_where_none_is_left():
    # Environment 0 has two episodes of three steps, environment 1 has one.
    task = Task.of(mazes=field(7), time_limit=3)
    episodes = [[Episode(0, (1, 1), (5, 5), 0.0, seed) for seed in seeds] for seeds in ([1, 2], [3])]
    envs = MazeVectorEnv(task, 2, episode_source=lambda slot: episodes[slot].pop(0) if episodes[slot] else None)
    asked = []

    def seeds(slots):
        asked.append(slots.tolist())
        return 10 * len(asked) + slots

    steps = list(rollout(Ahead(), envs, envs.reset(), seeds, needs_truth=True))
    assert [step.state for step in steps] == [1, 2, 3, 4, 5, 6]
    assert asked == [[0, 1], [], [], [0], [], []]
    told = [step.inputs for step in steps]
    assert [inputs.new_episode.tolist() for inputs in told] == [[slot in slots for slot in range(2)] for slots in asked]
    assert [inputs.active.tolist() for inputs in told] == [[True, True]] * 3 + [[True, False]] * 3
    assert [inputs.seed.tolist() for inputs in told] == [[10, 11]] * 3 + [[40, 11]] * 3
    assert [step.ended.any().item() for step in steps] == [False, False, True] * 2
    np.testing.assert_array_equal(told[0].truth.goal, [(5, 5), (5, 5)])
    np.testing.assert_array_equal(told[3].truth.goal, [(5, 5), (0, 0)], "an environment that rests has no goal")
