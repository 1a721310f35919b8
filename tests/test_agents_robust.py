"""Any numbers near those of a maze are answered by actions, and NumPy has nothing to warn of."""

from __future__ import annotations

import functools
import warnings

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies
from hypothesis.extra import numpy as arrays

from mazebench.agent import Agent, Inputs, Interface, Truth
from mazebench.agent_loading import agent_names, load_agent_class

SIZE, NUM_SLOTS, NUM_STEPS = 13, 2, 5
POSITIONS = strategies.floats(-2, SIZE + 2, width=32)
SHARES = strategies.sampled_from((0.0, 1.0)) | strategies.floats(0, 1, width=32)
RANGES = strategies.sampled_from((0.0, 5.0)) | strategies.floats(0, 5, width=32)
FLAGS = arrays.arrays(bool, (NUM_STEPS, NUM_SLOTS))

# Two ask somebody, one needs pictures, and one refuses maps that differ from the maze in more than doors.
OTHERS = ("llm", "person", "map-policy", "navigator-told")
CASES = [
    *((name, SIZE) for name in agent_names() if name not in OTHERS),
    *((name, 26) for name in ("planner", "planner-closed-loop", "navigator")),
]


def of_floats(shape: tuple[int, ...], numbers: strategies.SearchStrategy) -> strategies.SearchStrategy:
    return arrays.arrays(np.float32, shape, elements=numbers)


def truth_of(walls: np.ndarray, state: np.ndarray) -> Truth:
    walls = walls.copy()
    walls[:, [0, -1]] = walls[:, :, [0, -1]] = True
    return Truth(walls, state[:, [0, 1, 5]].astype(np.float64), np.array([[1, 1], [SIZE - 2, 3]]))


@functools.cache
def built(name: str, context_size: int) -> tuple[type[Agent], Agent]:
    agent_class = load_agent_class(name)
    interface = Interface("hierarchical", SIZE, context_size, sensors=("lidar",))
    return agent_class, agent_class.build(interface)


@pytest.mark.parametrize(("name", "context_size"), CASES)
@hypothesis.settings(max_examples=5, deadline=None, derandomize=True)
@hypothesis.given(data=strategies.data())
def test_any_observations_are_answered_by_actions(name, context_size, data):
    agent_class, agent = built(name, context_size)
    states = data.draw(of_floats((NUM_STEPS, NUM_SLOTS, 12), POSITIONS))
    ranges = data.draw(of_floats((NUM_STEPS, NUM_SLOTS, 32), RANGES))
    contexts = data.draw(of_floats((2, NUM_SLOTS, 4, context_size, context_size), SHARES))
    walls = data.draw(arrays.arrays(bool, (NUM_SLOTS, SIZE, SIZE)))
    new_episode, is_landmark = data.draw(FLAGS), data.draw(FLAGS)
    new_episode[0] = True

    context, memory = contexts[0].copy(), agent.initial_state(NUM_SLOTS)
    for step in range(NUM_STEPS):
        new_context = new_episode[step] | is_landmark[step]
        context[new_context] = contexts[step % 2, new_context]
        observation = {"state": states[step], "context": context, "lidar": ranges[step]}
        seed = np.zeros(NUM_SLOTS, dtype=np.int64)
        truth = truth_of(walls, states[step]) if agent_class.needs_truth else None
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            actions, memory = agent.act(Inputs(observation, new_episode[step], new_context, seed, truth), memory)
        if "six" in agent_class.plays_actions:
            assert actions.shape == (NUM_SLOTS,)
            assert set(actions.tolist()) <= set(range(6))
        else:
            assert actions.shape == (NUM_SLOTS, 2)
            assert np.abs(actions).max() <= 1
