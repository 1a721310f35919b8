"""The search of MMN on a CPU: the model by kernels, which equals the one by PyTorch."""

import numpy as np
import pytest
import torch
from mazebench_agents.mmn import MMN
from mazebench_agents.mmn.kernel_model import kernel_model, step, weights_of
from mazebench_agents.mmn.search_policy import torch_model
from mazebench_agents.muzero.search import gumbel_muzero_policy
from mazebench_agents.muzero.tree import empty_evaluation
from test_mmn import CONFIGS, a_context, code_of, make_learner

from mazebench import kernels
from mazebench.agent import Interface
from mazebench.maps.kinds import generate


def random_network(name="mmn"):
    torch.manual_seed(0)
    network = MMN(CONFIGS[name], 7).network
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    return network


@pytest.mark.parametrize("name", [*CONFIGS, "shipped"])
@torch.no_grad()
def test_model_by_kernels_equals_the_model_by_pytorch(name):
    if name == "shipped":
        network, size = MMN.build(Interface("local", 13, 13)).network, 13
    else:
        network, size = random_network(name), 9 if name == "mmn-paths" else 7
    torch.manual_seed(1)
    latent, code = network.encode(3 * torch.randn(5, 3, 9)), code_of(network, a_context(batch=5, size=size))
    (root, kernels_step), (expected, torch_step) = (
        prepare(network, latent, code) for prepare in (kernel_model, torch_model)
    )
    close = {"rtol": 1e-4, "atol": 1e-4}
    np.testing.assert_allclose(root.prior_logits, expected.prior_logits, **close)
    np.testing.assert_allclose(root.value, expected.value, **close)
    for action in range(6):
        actions = np.full(15, action)
        predicted, after = torch_step(expected.embedding, actions)
        found, states = evaluated(kernels_step.model, root.embedding, actions)
        # The other numbers are the next step's first layer, which the kernels keep without its bias.
        num_latent = network.latent_size
        torch.testing.assert_close(states[:, :num_latent], after[:, :num_latent], **close)
        for part, other in zip(found, predicted, strict=True):
            np.testing.assert_allclose(part, other, **close)


def evaluated(model, embedding, actions):
    """Predictions of the kernels for actions `[B]` in states `[B, D + H]`, and the states that follow."""
    states = np.repeat(embedding.numpy()[:, None], 2, axis=1)
    evaluation = empty_evaluation(len(states), 6)
    step(model, 0, states, np.zeros(len(states), np.int64), actions, 1, evaluation)
    return evaluation, torch.from_numpy(states[:, 1])


@pytest.mark.parametrize("name", CONFIGS)
def test_search_by_kernels_finds_what_the_search_by_pytorch_finds(name):
    network = random_network(name)
    with torch.no_grad():
        latent, code = network.encode(3 * torch.randn(5, 3, 9)), code_of(network, a_context(batch=5))
        found, expected = (
            gumbel_muzero_policy(*prepare(network, latent, code), 6, np.zeros((15, 6)))
            for prepare in (kernel_model, torch_model)
        )
    np.testing.assert_array_equal(found.visit_counts, expected.visit_counts)
    np.testing.assert_allclose(found.qvalues, expected.qvalues, rtol=1e-4)
    np.testing.assert_allclose(found.action_weights, expected.action_weights, rtol=1e-3, atol=1e-5)


@torch.no_grad()
def test_trees_are_searched_alike_in_one_thread_and_in_several(monkeypatch):
    network = random_network()
    latent, code = network.encode(torch.randn(100, 1, 9)), code_of(network, a_context(batch=100))
    found = []
    for num_threads in (1, 3):
        monkeypatch.setattr(kernels, "num_threads", lambda num_threads=num_threads: num_threads)
        found.append(gumbel_muzero_policy(*kernel_model(network, latent, code), 6, np.zeros((100, 6))))
    for one, several in zip(*found, strict=True):
        np.testing.assert_array_equal(one, several)


def test_kernels_search_with_the_weights_that_an_update_left():
    learner = make_learner((generate("dfs", 7, np.random.default_rng(0), "m"),))
    network = learner.actor.network
    before = weights_of(network)
    assert weights_of(network) is before, "copied only once"
    learner.update()
    assert weights_of(network) is not before
    np.testing.assert_array_equal(weights_of(network).heads.weight, network.heads.weight.detach().numpy().T)
