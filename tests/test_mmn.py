"""MMN: its transition is generated from the map, and kernels search in it."""

import dataclasses

import numpy as np
import pytest
import torch
from acting import inputs_of
from mazebench_agents.common import kernels
from mazebench_agents.mmn import MMN
from mazebench_agents.mmn.config import MMNConfig
from mazebench_agents.mmn.network import MMNNetwork
from mazebench_agents.mmn.planning import kernel_model, torch_model
from mazebench_agents.muzero.search import gumbel_muzero_policy
from test_muzero import CONFIGS, a_context, an_observation, make_learner

from mazebench.agent import Interface
from mazebench.errors import UnplayableError
from mazebench.maps.generators import generate


@pytest.fixture(scope="module")
def mazes():
    return tuple(generate("dfs", 7, np.random.default_rng(index), f"m{index}") for index in range(3))


@torch.no_grad()
def test_trees_are_searched_alike_in_one_thread_and_in_several(monkeypatch):
    torch.manual_seed(0)
    network = MMN(CONFIGS["mmn"], 7).network
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    latent, code = network.encode(torch.randn(100, 1, 9)), network.hypermodel(a_context(batch=100))
    found = []
    for num_threads in (1, 3):
        monkeypatch.setattr(kernels, "num_threads", lambda num_threads=num_threads: num_threads)
        found.append(gumbel_muzero_policy(*kernel_model(network, latent, code), 6, np.zeros((100, 6))))
    for one, several in zip(*found, strict=True):
        np.testing.assert_array_equal(one, several)


def test_anchor_stays_as_long_as_it_agrees_with_the_cell_marked_as_start():
    network = MMNNetwork(CONFIGS["mmn"], 7)
    with torch.no_grad():
        network.scale.copy_(torch.tensor([[0.0, 0.2], [-0.2, 0.0]]))
    anchor, moved = torch.tensor([[5.0, 1.0], [5.0, 1.0]]), torch.tensor([[2.3, 0.4], [2.3, 0.4]])  # so in (4.6, 3.3)
    start = torch.tensor([[5.0, 3.0], [5.0, 4.0]])
    expected = torch.tensor([[5.0, 1.0], [5.0, 1.2]])  # in the second, 0.2 cells short of where it must be
    torch.testing.assert_close(network.reanchored(anchor, moved, start), expected)


@pytest.mark.parametrize("name", ["mmn", "mmn, one code", "mmn, no hypermodel"])
def test_search_by_kernels_finds_what_the_search_by_pytorch_finds(name):
    torch.manual_seed(0)
    network = MMN(CONFIGS[name], 7).network
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    with torch.no_grad():
        latent, code = network.encode(3 * torch.randn(5, 3, 9)), network.hypermodel(a_context(batch=5))
        found, expected = (
            gumbel_muzero_policy(*prepare(network, latent, code), 6, np.zeros((15, 6)), rescale_values=False)
            for prepare in (kernel_model, torch_model)
        )
    np.testing.assert_array_equal(found.visit_counts, expected.visit_counts)
    np.testing.assert_allclose(found.qvalues, expected.qvalues, rtol=1e-4)
    np.testing.assert_allclose(found.action_weights, expected.action_weights, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("config", [CONFIGS["mmn"], dataclasses.replace(CONFIGS["mmn"], keep_anchor=False)])
def test_motion_is_told_from_where_the_episode_began_through_its_landmarks(config):
    agent = MMN(config, 7)
    with torch.no_grad():
        agent.network.scale.copy_(torch.tensor([[0.0, 0.2], [-0.2, 0.0]]))
    observation = an_observation(2)  # the start marked in (5, 1)
    observation["state"][:, :2] = 0.0
    every = np.ones(2, dtype=bool)
    _, state = agent.act(inputs_of(observation, every), agent.initial_state(2))
    # In (4, 2): a landmark in the first environment, another episode in the second.
    observation["state"][:, :2] = (0.8, 1.1)
    observation["context"][:, 3] = 0
    observation["context"][:, 3, 4, 2] = 1
    _, state = agent.act(inputs_of(observation, every, np.array([False, True])), state)
    anew = [[0.8, 1.1], [4, 2]]
    for env, (origin, anchor) in enumerate([[[0, 0], [5, 1]] if config.keep_anchor else anew, anew]):
        np.testing.assert_allclose(state.origin[env], origin)
        torch.testing.assert_close(state.code.positions[env, :2], torch.tensor(anchor, dtype=torch.float32))


def test_agent_with_one_code_a_context_says_which_sizes_it_serves(tmp_path, mazes):
    make_learner(mazes, CONFIGS["mmn"]).save(tmp_path, {})
    with pytest.raises(UnplayableError, match=r"'mmn': its checkpoint reads maps of 7 x 7 only, found 13 x 13"):
        MMN.build(Interface("local", 13, 13), checkpoint=tmp_path / "agent.safetensors")


def test_config_has_what_the_paper_states():
    paper = MMNConfig()
    assert paper.value_target == "n_step"
    assert (paper.model_weight, paper.relabel_start, paper.n_step) == (1, False, 5)


def test_every_weight_of_the_papers_transition_is_generated():
    """Motion is still in a network all of whose generated weights are 0, whatever its other parameters are."""
    network = MMNNetwork(CONFIGS["mmn"], 7)
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter)
    code = network.hypermodel(a_context())
    code = code._replace(weights=torch.zeros_like(code.weights), rows=torch.zeros_like(code.rows))
    latent = network.encode(torch.randn(1, 6, 9))
    first = network.first_layer(latent, network.look(latent, code), code)
    after = network.step(latent, first, torch.arange(6)[None], code)
    torch.testing.assert_close(after[..., :4], latent[..., :4])  # the pose stays
    torch.testing.assert_close(after[..., 4:7], torch.zeros(1, 6, 3))
