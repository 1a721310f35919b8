"""The DQN agents: targets, network, config, and that they learn."""

import numpy as np
import pytest
import torch
from acting import inputs_of
from mazebench_agents.dqn import DQN
from mazebench_agents.dqn.q_learner import double_q_target
from mazebench_agents.mah import MAH
from mazebench_agents.mah.map_q_network import ReadingQNetwork
from small_world import learn


def test_double_q_target_by_hand():
    value = torch.tensor([[-50.0, -1.0], [-4.0, -1.0]])  # believes the second action
    selector = torch.tensor([[0.0, -9.0], [0.0, -9.0]])  # chooses the first
    target = double_q_target(torch.tensor([-2.0, -3.0]), torch.tensor([0.0, 1.0]), value, selector)
    assert target.tolist() == [-2.0, -7.0]


def test_network_with_the_true_scale_reads_the_map_where_the_agent_is():
    torch.manual_seed(0)
    network = ReadingQNetwork(8, 4)
    with torch.no_grad():
        network.scale.copy_(torch.tensor([[0.0, 0.2], [-0.2, 0.0]]))  # times 5: a cell a metre, y up
        network.sharpness.fill_(20.0)
    context = torch.zeros(1, 4, 7, 7)
    context[0, 3, 5, 1] = context[0, 2, 1, 5] = 1
    code = network.encode(context)
    moved = torch.tensor([[[0.0, 0.0], [2.0, 0.0], [1.0, 3.0]]])
    assert network.locate(moved, code)[0].tolist() == [[5.0, 1.0], [5.0, 3.0], [2.0, 2.0]]
    read = network.read(moved, code)
    features = code[0, :4].reshape(4, 7, 7)
    for k, (row, column) in enumerate([(5, 1), (5, 3), (2, 2)]):
        torch.testing.assert_close(read[0, k, :4], features[:, row, column])
    torch.testing.assert_close(read[0, 2, 4:6], torch.tensor([-0.1, 0.3]))


def test_network_takes_the_middle_of_the_map_for_a_start_that_is_not_marked():
    network = ReadingQNetwork(8, 4)
    context = torch.zeros(2, 4, 7, 7)
    context[:, 2, 1, 5] = context[1, 3, 0, 0] = 1
    assert network.locate(torch.zeros(2, 1, 2), network.encode(context))[:, 0].tolist() == [[3.0, 3.0], [0.0, 0.0]]


def test_network_without_context_does_not_depend_on_it():
    agent = DQN(DQN.default_config, 13)
    rng = np.random.default_rng(0)
    state, contexts = rng.normal(size=(8, 12)).astype(np.float32), rng.random((2, 8, 4, 13, 13)).astype(np.float32)
    first = np.ones(8, dtype=bool)
    one, other = (
        agent.act(inputs_of({"state": state, "context": context}, first), agent.initial_state(8))[0]
        for context in contexts
    )
    np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_mah_after_a_minute_beats_random_in_a_small_maze():
    """The learning test: goals up to 3 cells away in 25 steps, where acting at random reaches some 40 %."""
    values = {
        "hidden": 128,
        "min_rows": 2000,
        "steps_per_update": 64,
        "groups": 16,
        "num_envs": 64,
        "learning_rate": 2e-3,
        "target_rate": 0.02,
        "longest_value": 25,
        "hindsight_mean_offset": 8,
        "hindsight_window": 30,
    }
    before, after = learn(MAH, 3, (2, 3), 1500, values)
    assert before < 0.6
    assert after > 0.8
