"""MMN: its transition is generated from the map; its learner, and how it acts."""

import dataclasses
import itertools

import numpy as np
import pytest
import torch
from acting import RandomActor, inputs_of
from mazebench_agents.common.layers import FAR_DILATIONS, NUM_PLACE, MapEncoder, marked_position
from mazebench_agents.mmn import MMN
from mazebench_agents.mmn.hypermodel import MMNNetwork, WayReader
from mazebench_agents.mmn.losses import unrolled_losses
from mazebench_agents.mmn.mmn_config import MMNConfig, MMNEvalConfig
from mazebench_agents.mmn.targets import Targets, make_batch
from small_world import learn

from mazebench.agent import Interface
from mazebench.maps.kinds import generate
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START
from mazebench.tasks.task import Task
from mazebench.training.collector import Collector

SMALL = MMNConfig(hidden=16, head_hidden=16, latent=8, embedding=8, task_code=8, groups=4, num_envs=8, min_rows=100)
CONFIGS = {
    "mmn": SMALL,
    "mmn, one code": dataclasses.replace(SMALL, rows=False, reading=False),
    "mmn, no hypermodel": dataclasses.replace(SMALL, rows=False, hypermodel=False),
    "mmn-paths": dataclasses.replace(SMALL, far="paths"),
}
WITHOUT_MODEL = dataclasses.replace(SMALL, model=False)
OF_ALL = pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS)


def a_context(seed=0, size=7, batch=1):
    """Mazes with a start and a goal."""
    rng = np.random.default_rng(seed)
    context = np.zeros((batch, 4, size, size), dtype=np.float32)
    context[:, :2] = rng.random((batch, 2, size, size)) < 0.4
    context[:, 2, 1, size - 2] = context[:, 3, size - 2, 1] = 1
    return torch.from_numpy(context)


def code_of(network, context):
    """Outputs of the hypermodel for contexts, if displacements are measured from the marked start."""
    return network.hypermodel(context, marked_position(context[:, START]))


def an_observation(batch):
    rng = np.random.default_rng(0)
    return {"state": rng.normal(size=(batch, 12)).astype(np.float32), "context": a_context(batch=batch).numpy()}


def make_learner(mazes, config=SMALL, seed=0, steps=100):
    """A small learner that has seen some steps of random driving."""
    overrides = {name: str(value) for name, value in dataclasses.asdict(config).items()}
    spec = Task.of(mazes=mazes, distances=(1, 2, 3), num_goals=config.num_goals)
    learner = MMN.build_learner(spec, seed=seed, overrides=overrides)
    experience = Collector(spec, learner.num_envs).collect(RandomActor(), seed)
    for step in itertools.islice(experience, steps):
        learner.observe(step)
    return learner


@pytest.fixture(scope="module")
def mazes():
    return tuple(generate("dfs", 7, np.random.default_rng(index), f"m{index}") for index in range(3))


@OF_ALL
def test_another_map_gives_other_transition_weights_and_predictions(config):
    torch.manual_seed(0)
    network = MMN(config, 7).network
    first, second = code_of(network, a_context(0)), code_of(network, a_context(1))
    assert not torch.equal(first.weights, second.weights)
    latent = network.encode(torch.randn(1, 5, 9))

    def next_latent(code):
        return network.step(
            latent, network.first_layer(latent, network.look(latent, code), code), torch.arange(5)[None], code
        )

    assert not torch.allclose(next_latent(first), next_latent(second), atol=1e-6)


def test_every_weight_of_the_papers_transition_is_generated():
    """Motion is still in a network all of whose generated weights are 0, whatever its other parameters are."""
    network = MMNNetwork(SMALL, 7)
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter)
    code = code_of(network, a_context())
    code = code._replace(weights=torch.zeros_like(code.weights), rows=torch.zeros_like(code.rows))
    latent = network.encode(torch.randn(1, 6, 9))
    first = network.first_layer(latent, network.look(latent, code), code)
    after = network.step(latent, first, torch.arange(6)[None], code)
    torch.testing.assert_close(after[..., :4], latent[..., :4])  # the pose stays
    torch.testing.assert_close(after[..., 4:7], torch.zeros(1, 6, 3))


@OF_ALL
def test_task_and_model_losses_reach_the_hypermodels_weights(config, mazes):
    """The paper's point: psi learns from both, and through the transition network whose weights it predicts."""
    learner = make_learner(mazes, config)
    network = learner.actor.network
    with torch.no_grad():  # heads that are zero pass nothing on
        network.heads.weight.normal_(std=0.1)
    sample = learner.replay.sample_sequences(
        8, 3, config.sequence_steps, hindsight=learner.hindsight, rng=np.random.default_rng(0)
    )
    device = network.support.device
    batch = make_batch(sample, maps=learner.maps, turned=0, device=device)
    wanted = Targets(-torch.rand(batch.exists.shape), torch.softmax(torch.randn(*batch.exists.shape, 6), dim=-1))
    losses, _ = unrolled_losses(network, config, batch, Targets(*(each.to(device) for each in wanted)))
    for loss in ("value_loss", "policy_loss", "goal_loss", "model_loss"):
        (gradient,) = torch.autograd.grad(losses[loss], network.hypermodel.hyper.weight, retain_graph=True)
        assert gradient.abs().sum() > 0, loss


@pytest.mark.parametrize("config", [SMALL, WITHOUT_MODEL])
def test_learner_goes_on_as_if_it_had_not_been_saved(config, tmp_path, mazes):
    learner = make_learner(mazes, config)
    for _ in range(3):
        learner.update()
    learner.save(tmp_path, {})
    expected = [learner.update() for _ in range(3)]
    resumed = make_learner(mazes, config, seed=1, steps=1)
    resumed.load(tmp_path)
    assert [resumed.update() for _ in range(3)] == expected


@pytest.mark.parametrize("config", [*CONFIGS.values(), WITHOUT_MODEL])
def test_saved_and_built_agent_acts_identically(config, tmp_path, mazes):
    learner = make_learner(mazes, config)
    assert np.isfinite(list(learner.update().values())).all()
    learner.save(tmp_path, {})
    agent = MMN.build(Interface("local", 7, 7), checkpoint=tmp_path / "agent.safetensors")
    inputs = inputs_of(an_observation(40), np.ones(40, dtype=bool))
    expected, _ = learner.actor.act(inputs, learner.actor.initial_state(40))
    actions, _ = agent.act(inputs, agent.initial_state(40))
    np.testing.assert_array_equal(actions, expected)


def test_agent_that_reads_ways_knows_its_place_as_in_a_map_of_another_size():
    network = MMN(CONFIGS["mmn-paths"], 7).network
    torch.nn.init.normal_(network.scale)
    small, large = a_context(), torch.zeros(1, 4, 15, 15)
    large[:, :, 4:11, 4:11] = small  # four cells on: an even row stays even
    latent = network.encode(torch.rand(1, 5, 9))
    seen = [network.look(latent, code_of(network, context))[..., :NUM_PLACE] for context in (small, large)]
    torch.testing.assert_close(*seen)
    assert seen[0].std(dim=1).max() > 0.1


@pytest.mark.parametrize("config", [SMALL, WITHOUT_MODEL])
def test_actions_do_not_depend_on_what_else_is_in_the_batch(config):
    agent = MMN(config, 7, seed=2)
    torch.nn.init.normal_(agent.network.heads.weight)
    observation = an_observation(77)

    def actions(rows):
        part = {key: value[rows] for key, value in observation.items()}
        return agent.act(inputs_of(part, np.ones(len(rows), dtype=bool)), agent.initial_state(len(rows)))[0]

    together = actions(np.arange(77))
    for rows in (np.array([76]), np.arange(40, 77), np.random.default_rng(0).permutation(77)):
        np.testing.assert_array_equal(actions(rows), together[rows])


@pytest.mark.parametrize("active", [[False, True, False], [True, False, True]])
def test_environments_that_rest_change_no_action_of_the_others(active):
    agent = MMN(SMALL, 7)
    torch.manual_seed(1)
    torch.nn.init.normal_(agent.network.heads.weight)
    inputs = inputs_of(an_observation(3), np.ones(3, dtype=bool))
    every, _ = agent.act(inputs, agent.initial_state(3))
    assert every.all()  # no action is that of a resting environment
    some, _ = agent.act(inputs._replace(active=np.array(active)), agent.initial_state(3))
    np.testing.assert_array_equal(some, np.where(active, every, 0))


def test_anchor_stays_as_long_as_it_agrees_with_the_cell_marked_as_start():
    network = MMNNetwork(SMALL, 7)
    with torch.no_grad():
        network.scale.copy_(torch.tensor([[0.0, 0.2], [-0.2, 0.0]]))
    anchor, moved = torch.tensor([[5.0, 1.0], [5.0, 1.0]]), torch.tensor([[2.3, 0.4], [2.3, 0.4]])  # so in (4.6, 3.3)
    start = torch.tensor([[5.0, 3.0], [5.0, 4.0]])
    expected = torch.tensor([[5.0, 1.0], [5.0, 1.2]])  # in the second, 0.2 cells short of where it must be
    torch.testing.assert_close(network.reanchored(anchor, moved, start), expected)


def test_motion_is_told_from_where_the_episode_began_through_its_landmarks():
    agent = MMN(SMALL, 7)
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
    np.testing.assert_allclose(state.origin, [[0, 0], [0.8, 1.1]])
    torch.testing.assert_close(state.code.positions[:, :2], torch.tensor([[5.0, 1.0], [4.0, 2.0]]))


def test_an_evaluation_sets_the_number_of_simulations():
    configs = {None: 64, MMNEvalConfig(): 64, MMNEvalConfig(num_eval_simulations=4): 4}
    for config, number in configs.items():
        agent = MMN.build(Interface("local", 13, 13), config=config)
        assert (agent.config.num_eval_simulations, agent.config.num_simulations) == (number, 8)


@pytest.mark.slow
def test_mmn_after_some_seconds_beats_random_in_a_small_maze():
    """The learning test: goals 2 and 3 cells away in 25 steps."""
    values = {
        "hidden": 32,
        "head_hidden": 64,
        "learning_rate": 1e-2,
        "num_simulations": 4,
        "num_eval_simulations": 8,
        "num_envs": 64,
        "groups": 4,
        "sequences": 6,
        "min_rows": 1000,
        "steps_per_update": 64,
        "target_rate": 0.3,
        "longest_value": 25,
        "hindsight_mean_offset": 8,
        "hindsight_window": 30,
    }
    before, after = learn(MMN, 3, (2, 3), 200, values)
    assert before < 0.3
    assert after > 0.5


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_first_update_on_a_gpu_is_that_on_a_cpu(mazes, monkeypatch):
    on_gpu = make_learner(mazes)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    on_cpu = make_learner(mazes)
    found, expected = on_gpu.update(), on_cpu.update()
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=0.05, abs=1e-3), name


def test_ways_go_around_dear_cells_where_the_agent_does_not_explore():
    """A wall of 13 cells that cost 21 each: crossing it is cheaper than the way around."""
    reader = WayReader(8)
    with torch.no_grad():
        for parameter in reader.parameters():
            parameter.zero_()
        reader.features.weight[0, 8] = 1.0  # of the way left
        reader.costs[0].weight[0, GLOBAL_MAP, 1, 1] = reader.costs[2].weight[0, 0, 1, 1] = 1.0
        reader.costs[4].weight[0, 0], reader.costs[4].bias[0] = 9.0, -6.0  # walls cost 21, other cells 1
    context = torch.zeros(1, 4, 15, 15)
    context[0, GLOBAL_MAP, 7, :13] = context[0, GOAL, 9, 0] = 1.0
    crossing, around = (torch.atanh(reader(context, closes)[0, 0, 5, 0]) * 5 for closes in (False, True))
    assert 23 < crossing < 25
    assert 25 < around < 31


@pytest.mark.parametrize(("reader", "sees_far"), [(WayReader(8), True), (MapEncoder(8, FAR_DILATIONS), False)])
def test_only_ways_tell_a_cell_of_a_goal_that_is_far(reader, sees_far):
    """In a corridor of 61 cells, the goal is at the left or at the right end."""
    context = torch.zeros(2, 4, 61, 61)
    context[:, GLOBAL_MAP] = 1.0
    context[:, GLOBAL_MAP, 30, 1:60] = 0.0
    context[0, GOAL, 30, 1] = context[1, GOAL, 30, 59] = 1.0
    left, right = reader(context)[:, :, 30, 30]
    assert (left - right).abs().max().item() > 1e-3 if sees_far else torch.equal(left, right)
