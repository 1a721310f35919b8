"""Targets and losses of MMN, by numbers one can do by hand."""

import dataclasses
import math

import pytest
import torch
from mazebench_agents.mmn.hypermodel import MMNNetwork
from mazebench_agents.mmn.losses import q_losses, two_hot, unrolled_losses
from mazebench_agents.mmn.mmn_config import MMNConfig
from mazebench_agents.mmn.targets import Batch, Targets, n_step_returns

NEVER = torch.zeros(4, dtype=torch.bool)


def at(*steps):
    """[4] bool, set at `steps`."""
    mask = NEVER.clone()
    mask[list(steps)] = True
    return mask


@pytest.mark.parametrize(
    ("at_goal", "length", "n", "returns"),
    [
        # From state 0: two steps, then -20; from 1: two steps, then -3; from 2: one step only; the last: its own value.
        (NEVER, 4, 2, [-22.0, -5.0, -4.0, -3.0]),
        # The step into the goal is rewarded 0: from state 1 the return is 0, from 0 one step of -1.
        (at(2), 3, 3, [-1.0, 0.0]),
        # Where the trajectory was cut short, its last value follows.
        (NEVER, 2, 3, [-8.0, -7.0]),
    ],
)
def test_n_step_returns(at_goal, length, n, returns):
    value = torch.tensor([-9.0, -7.0, -20.0, -3.0])
    found = n_step_returns(value, at_goal, torch.arange(4) < length, n)
    assert found.tolist()[: len(returns)] == returns


def test_two_hot_weighs_the_two_whole_numbers_beside():
    hot = two_hot(torch.tensor([0.0, -0.25, -4.0, -9.0]), 5)  # of -4, -3, -2, -1, 0
    assert hot.tolist() == [
        [0, 0, 0, 0, 1],
        [0, 0, 0, 0.25, 0.75],
        [1, 0, 0, 0, 0],
        [1, 0, 0, 0, 0],  # below the support
    ]


SMALL = MMNConfig(hidden=8, head_hidden=8, latent=4, embedding=4, task_code=4, longest_value=9)


def make_batch(at_goal_step=None):
    """Two contexts, a sequence each; all states alike, standing still in the start, one cell left of the goal."""
    length = SMALL.sequence_steps + 1
    context = torch.zeros(2, 4, 7, 7)
    context[:, 3, 3, 2] = context[:, 2, 3, 3] = 1
    features = torch.zeros(2, 1, length, 9)
    features[..., 3] = 1  # cosine of yaw
    at_goal = torch.zeros(2, 1, length, dtype=torch.bool)
    exists = torch.ones(2, 1, length, dtype=torch.bool)
    if at_goal_step is not None:
        at_goal[..., at_goal_step] = True
        exists[..., at_goal_step + 1 :] = False
    batch = Batch(
        context=context,
        anchor=torch.tensor([3.0, 2.0]).expand(2, 2),
        maze=torch.arange(2),
        features=features,
        action=torch.zeros(2, 1, SMALL.sequence_steps, dtype=torch.long),
        exists=exists,
        at_goal=at_goal,
    )
    return batch, Targets(torch.full((2, 1, length), -3.0), torch.full((2, 1, length, 6), 1 / 6))


def make_network(config=SMALL):
    """A network that is untrained, but for values: they are -4.5, of ten bins or of actions."""
    torch.manual_seed(0)
    network = MMNNetwork(config, 7)
    if config.model:
        torch.nn.init.zeros_(network.heads.bias[6:-1])
    else:
        torch.nn.init.constant_(network.heads.bias[0], -0.45)
    return network


def test_losses_of_an_untrained_network_by_hand():
    """Its heads are zero: uniform policies, the goal at a logit of -4."""
    batch, targets = make_batch()
    losses, metrics = unrolled_losses(make_network(), SMALL, batch, targets)
    assert losses["value_loss"].item() == pytest.approx(math.log(10), rel=1e-5)
    assert losses["policy_loss"].item() == pytest.approx(math.log(6), rel=1e-5)
    assert losses["goal_loss"].item() == pytest.approx(math.log(1 + math.exp(-4)), rel=1e-4)
    assert metrics["value_error"].item() == pytest.approx(1.5)  # the mean of -9 to 0 is -4.5, and -3 is the target
    assert metrics["value"].item() == -3.0


class TestWithoutModel:
    CONFIG = dataclasses.replace(SMALL, model=False)

    def test_targets_by_hand(self):
        """All values are -4.5. A return takes 5 steps, or fewer at the end, and is -9 at least."""
        batch, _ = make_batch()
        network = make_network(self.CONFIG)
        losses, metrics = q_losses(network, network, self.CONFIG, batch)
        returns = [-9.0] * 6 + [-4.5 - steps for steps in (4, 3, 2, 1)]
        assert metrics["value"].item() == pytest.approx(sum(returns) / 10)
        errors = [-4.5 - value for value in returns]
        assert losses["value_loss"].item() == pytest.approx(sum(error - 0.5 for error in errors) / 10 / 10)

    def test_the_step_into_the_goal_is_worth_nothing_and_ends_what_is_learned(self):
        batch, _ = make_batch(at_goal_step=3)
        network = make_network(self.CONFIG)
        _, metrics = q_losses(network, network, self.CONFIG, batch)
        assert metrics["value"].item() == pytest.approx((-2 - 1 + 0) / 3)

    def test_the_network_chooses_the_action_whose_value_the_target_network_tells(self):
        batch, _ = make_batch()
        network, target = make_network(self.CONFIG), make_network(self.CONFIG)
        with torch.no_grad():
            network.heads.bias[1 + 2] = 0.6  # by the network, action 2 is the best
            target.heads.bias[:7] = torch.tensor([-0.55, 0.0, 0.0, 0.6, 0.0, 0.9, 0.0])  # -2 by the target, 4 is best
        _, metrics = q_losses(network, target, self.CONFIG, batch)
        returns = [-7.0] * 6 + [-2.0 - steps for steps in (4, 3, 2, 1)]
        assert metrics["value"].item() == pytest.approx(sum(returns) / 10, rel=1e-4)


def test_map_ratio_compares_the_weights_of_two_mazes():
    """A model whose weights do not depend on the map errs as much with those of the other maze."""
    batch, targets = make_batch()
    steps = torch.arange(SMALL.sequence_steps + 1.0)
    batch.features[..., 0] = torch.stack([steps, -steps])[:, None]  # a metre a step, forwards and backwards
    batch.context[0, 0, 3, 3] = 1  # a wall ahead in one of the two
    network = make_network()
    _, metrics = unrolled_losses(network, SMALL, batch, targets)
    assert metrics["map_ratio"].item() != 1.0
    torch.nn.init.zeros_(network.hypermodel.hyper.weight)
    torch.nn.init.zeros_(network.hypermodel.rows.weight)
    _, metrics = unrolled_losses(network, SMALL, batch, targets)
    assert metrics["map_ratio"].item() == pytest.approx(1.0)


def test_losses_stop_counting_at_the_goal():
    """The goal in the second state: its end is learned, but neither a value nor a policy there, nor anything later."""
    batch, targets = make_batch(at_goal_step=1)
    network = make_network()
    losses, _ = unrolled_losses(network, SMALL, batch, targets)
    later = batch._replace(features=batch.features.clone())
    later.features[:, :, 2:] = 5.0
    again, _ = unrolled_losses(network, SMALL, later, targets)
    assert {name: value.item() for name, value in losses.items()} == {name: v.item() for name, v in again.items()}
    # The root says "not the goal" and weighs 1, the state after it "the goal" and weighs 1 / 5.
    ends = (math.log(1 + math.exp(-4)) + 0.2 * math.log(1 + math.exp(4))) / 1.2
    assert losses["goal_loss"].item() == pytest.approx(ends, rel=1e-4)


def test_model_loss_by_hand():
    """A network whose transition changes nothing, where the body in truth moved by (0.3, -0.1) metres in each step."""
    network = make_network()
    for module in (network.hypermodel.hyper, network.hypermodel.rows, network.encoder[2]):
        for parameter in module.parameters():
            torch.nn.init.zeros_(parameter)
    batch, targets = make_batch()
    steps = torch.arange(SMALL.sequence_steps + 1.0)[:, None]
    batch.features[..., :2] = steps * torch.tensor([0.3, -0.1])
    batch.features[..., 3] = 0.0
    losses, metrics = unrolled_losses(network, SMALL, batch, targets)
    assert metrics["model_error_1"].item() == pytest.approx(0.4, rel=1e-5)
    assert metrics["model_error_5"].item() == pytest.approx(2.0, rel=1e-5)
    # 2 * (0.4 + 0.8 + 1.2 + 1.6 + 2.0) / 5, and squares of 0.3 k and 0.1 k in two of the latent state's eleven numbers;
    # all others are zero, and so they are.
    squares = 0.1 * (1 + 4 + 9 + 16 + 25) / 5 / 11
    assert losses["model_loss"].item() == pytest.approx(2.4 + squares, rel=1e-4)
