"""MMN: its hypermodels, how its model reads the map, its learner and the agent."""

import dataclasses

import numpy as np
import pytest
import torch
from acting import inputs_of
from mazebench_agents.common.layers import marked_position
from mazebench_agents.mmn import MMN, MMNPaper
from mazebench_agents.mmn.config import MMNConfig, PaperConfig
from mazebench_agents.mmn.network import rotate
from mazebench_agents.mmn.paper import PaperNetwork
from mazebench_agents.mmn.planning import kernel_model, lookahead, torch_model
from mazebench_agents.mmn.search import gumbel_muzero_policy
from mazebench_agents.mmn.spatial import MMNNetwork, Propagation, brought_nearer
from small_world import learn

from mazebench.agent import Interface
from mazebench.errors import InputError
from mazebench.maps.generators import generate
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START
from mazebench.tasks.spec import TaskSpec
from mazebench.training.experience import Collector

SMALL = {"hidden": 16, "head_hidden": 16, "latent": 8, "groups": 4, "num_envs": 8, "min_rows": 100}
CONFIGS = {
    "mmn": MMNConfig(**SMALL, channels=8),
    "mmn-paper": PaperConfig(**SMALL, embedding=8, task_code=8),
    "mmn-paper, one code": PaperConfig(**SMALL, embedding=8, task_code=8, rows=False, reading=False),
    "mmn-paper, no hypermodel": PaperConfig(**SMALL, embedding=8, task_code=8, rows=False, hypermodel=False),
}
OF_ALL = pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS)
OF_BOTH = pytest.mark.parametrize("config", list(CONFIGS.values())[:2], ids=list(CONFIGS)[:2])


def agent_class(config):
    return MMN if isinstance(config, MMNConfig) else MMNPaper


def small_config(**values):
    return dataclasses.replace(CONFIGS["mmn"], **values)


def a_context(seed=0, size=7, batch=1):
    """Mazes with a start and a goal."""
    rng = np.random.default_rng(seed)
    context = np.zeros((batch, 4, size, size), dtype=np.float32)
    context[:, :2] = rng.random((batch, 2, size, size)) < 0.4
    context[:, 2, 1, size - 2] = context[:, 3, size - 2, 1] = 1
    return torch.from_numpy(context)


def code_of(network, context):
    """What the hypermodel makes of contexts; that of MMN reads what is believed of them."""
    if not isinstance(network, MMNNetwork):
        return network.hypermodel(context)
    return network.hypermodel(context[:, [GLOBAL_MAP, GOAL]], marked_position(context[:, START]))


def make_learner(mazes, config=CONFIGS["mmn"], seed=0, steps=100):
    """A small learner that has seen some steps of random driving."""
    overrides = {name: str(value) for name, value in dataclasses.asdict(config).items()}
    size = mazes[0].size
    learner = agent_class(config).build_learner(Interface("local", size, size), mazes, seed=seed, overrides=overrides)
    spec = TaskSpec(mazes=mazes, distances=(1, 2, 3), **learner.task_options())
    collector = Collector(spec, learner.num_envs, seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        learner.observe(collector.step(rng.integers(6, size=learner.num_envs)))
    return learner


@pytest.fixture(scope="module")
def mazes():
    return tuple(generate("dfs", 7, np.random.default_rng(index), f"m{index}") for index in range(3))


def make_propagation():
    """Costs a step to leave a cell whose feature is 0; those whose feature is 1 can't be entered."""
    propagation = Propagation(1, 1)
    with torch.no_grad():
        propagation.cost.weight.zero_()
        propagation.cost.bias.fill_(np.log(np.e - 1) - 2)  # softplus(2 + bias) = 1
    return propagation


def believed(wall, goal):
    """The belief `[1, 2, M, M]` with a goal."""
    planes = torch.zeros(1, 2, *wall.shape)
    planes[0, 0] = wall
    planes[0, 1][goal] = 1
    return planes


def test_propagation_with_equal_costs_is_the_distance_on_the_grid():
    belief = believed(torch.tensor([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]]), (2, 0))
    distance = make_propagation()(torch.zeros(1, 1, 3, 3), belief)[0, 0]
    torch.testing.assert_close(distance[0], torch.tensor([6.0, 5.0, 4.0]))  # around the wall
    torch.testing.assert_close(distance[2], torch.tensor([0.0, 1.0, 2.0]))
    slopes = Propagation.slopes(distance[None, None])[0]  # up, down, left, right
    torch.testing.assert_close(slopes[:, 0, 1], torch.tensor([2.0, 2.0, 1 / 3, -1 / 3]))


@pytest.mark.parametrize(("chance", "expected"), [(0.1, 2 + 12 / 9), (0.5, 6.0)])
def test_cell_that_may_be_wall_costs_the_tries_that_fail_or_the_way_around_it(chance, expected):
    belief = believed(torch.tensor([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]), (2, 0))
    belief[0, 0, 1, 0] = chance  # between the start, above, and the goal
    distance = make_propagation()(torch.zeros(1, 1, 3, 3), belief)[0, 0]
    assert distance[0, 0].item() == pytest.approx(expected)


def test_goal_that_may_be_in_two_cells_is_sought_in_the_nearer_one_unless_it_is_improbable():
    belief = believed(torch.zeros(1, 9)[:, :].expand(9, 9), (0, 8))
    for chance, expected in ((0.5, 14.0), (0.9, 3 + 12 / 9)):  # relative to that of the far cell, 14 cells away
        belief[0, 1, 6, 3] = chance
        distance = make_propagation()(torch.zeros(1, 1, 9, 9), belief)[0, 0]
        assert distance[6, 0].item() == pytest.approx(min(expected, 3 + 12 * (1 / chance - 1)))


def test_goals_out_of_reach_are_brought_nearer_and_the_way_stays_the_same():
    distance = torch.arange(0.0, 90.0, 10.0).reshape(1, 1, 3, 3)
    near, far = (brought_nearer(distance, torch.tensor([cell])) for cell in ([1.0, 0.0], [2.0, 2.0]))
    torch.testing.assert_close(near, distance)
    torch.testing.assert_close(far.flatten(), torch.tensor([10.0, 10, 10, 10, 10, 10, 10, 20, 30]))


def test_network_with_the_true_scale_looks_where_the_agent_is():
    network = MMNNetwork(small_config(), 7)
    with torch.no_grad():
        network.scale.copy_(torch.tensor([[0.0, 0.2], [-0.2, 0.0]]))  # times 5: a cell a metre, y up
        network.hypermodel.sharpness.fill_(20.0)
    code = code_of(network, a_context())
    moved = torch.tensor([[[0.0, 0.0], [2.0, 0.0], [1.0, 3.0]]])
    latent = torch.cat([moved, torch.zeros(1, 3, network.latent_size - 2)], dim=-1)
    seen = network.look(latent, code)
    for k, (row, column) in enumerate([(5, 1), (5, 3), (2, 2)]):
        torch.testing.assert_close(seen[0, k], code.weights[0, row * 7 + column])


def test_free_motion_is_the_same_wherever_the_body_heads():
    """Where the transition network says nothing, a step turned with the body is the step."""
    torch.manual_seed(0)
    network = MMNNetwork(small_config(), 7)
    torch.nn.init.normal_(network.free_by_action.weight)
    for last in (network.hypermodel.transition.later[-1].weight, network.hypermodel.transition.later[-1].bias):
        torch.nn.init.zeros_(last)
    code = code_of(network, a_context())
    features = torch.randn(1, 1, 9)
    yaw = torch.tensor(0.4)

    def moved_and_heading(yaw):
        features[..., 2:4] = torch.stack([torch.sin(yaw), torch.cos(yaw)])
        latent = network.encode(features)
        first = network.first_layer(latent, network.look(latent, code), code)
        after = network.step(latent, first, torch.tensor([[3]]), code)
        return after[0, 0, :2] - latent[0, 0, :2], after[0, 0, 2:4], after[0, 0, 4:7]

    quarter = torch.tensor([1.0, 0.0])  # sine and cosine of a quarter turn
    (moved, heading, velocities), turned = moved_and_heading(yaw), moved_and_heading(yaw + np.pi / 2)
    torch.testing.assert_close(turned[0], rotate(moved, quarter))
    torch.testing.assert_close(turned[1].flip(-1), rotate(heading.flip(-1), quarter))
    torch.testing.assert_close(turned[2], velocities)
    torch.testing.assert_close(heading.norm(), torch.tensor(1.0))


def test_anchor_stays_as_long_as_it_agrees_with_the_cell_marked_as_start():
    network = MMNNetwork(small_config(), 7)
    with torch.no_grad():
        network.scale.copy_(torch.tensor([[0.0, 0.2], [-0.2, 0.0]]))
    anchor, moved = torch.tensor([[5.0, 1.0], [5.0, 1.0]]), torch.tensor([[2.3, 0.4], [2.3, 0.4]])  # so in (4.6, 3.3)
    start = torch.tensor([[5.0, 3.0], [5.0, 4.0]])
    expected = torch.tensor([[5.0, 1.0], [5.0, 1.2]])  # in the second, 0.2 cells short of where it must be
    torch.testing.assert_close(network.reanchored(anchor, moved, start), expected)


@OF_ALL
def test_another_map_gives_other_transition_weights_and_predictions(config):
    torch.manual_seed(0)
    network = agent_class(config)(config, 7).network
    first, second = code_of(network, a_context(0)), code_of(network, a_context(1))
    assert not torch.equal(first.weights, second.weights)
    latent = network.encode(torch.randn(1, 5, 9))

    def next_latent(code):
        return network.step(
            latent, network.first_layer(latent, network.look(latent, code), code), torch.arange(5)[None], code
        )

    assert not torch.allclose(next_latent(first), next_latent(second), atol=1e-6)


@OF_ALL
def test_task_and_model_losses_reach_the_hypermodels_weights(config, mazes):
    """The paper's point: psi learns from both, and through the transition network whose weights it predicts."""
    learner = make_learner(mazes, config)
    network = learner.actor.network
    with torch.no_grad():  # heads that are zero pass nothing on
        network.heads.weight.normal_(std=0.1)
    losses, _ = learner._losses(learner.sample())
    psi = (network.hypermodel.rows if isinstance(config, MMNConfig) else network.hypermodel.hyper).weight
    for loss in ("value_loss", "policy_loss", "goal_loss", "model_loss"):
        (gradient,) = torch.autograd.grad(losses[loss], psi, retain_graph=True)
        assert gradient.abs().sum() > 0, loss


@OF_ALL
def test_search_by_kernels_finds_what_the_search_by_pytorch_finds(config):
    torch.manual_seed(0)
    network = agent_class(config)(config, 7).network
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    with torch.no_grad():
        latent, code = network.encode(3 * torch.randn(5, 3, 9)), code_of(network, a_context(batch=5))
        found, expected = (
            gumbel_muzero_policy(*prepare(network, latent, code), 6, np.zeros((15, 6)), rescale_values=False)
            for prepare in (kernel_model, torch_model)
        )
    np.testing.assert_array_equal(found.visit_counts, expected.visit_counts)
    np.testing.assert_allclose(found.qvalues, expected.qvalues, rtol=1e-4)
    np.testing.assert_allclose(found.action_weights, expected.action_weights, rtol=1e-3, atol=1e-5)


@OF_ALL
def test_lookahead_is_every_action_of_the_model_by_itself(config):
    torch.manual_seed(0)
    network = agent_class(config)(config, 7).network
    torch.nn.init.normal_(network.heads.weight)
    code = code_of(network, a_context(batch=2))
    latent = network.encode(torch.randn(2, 3, 9))
    qvalues = lookahead(network, latent, code)
    first = network.first_layer(latent, network.look(latent, code), code)
    for action in range(6):
        after = network.step(latent, first, torch.full((2, 3), action), code)
        out = network.predict(after, network.look(after, code), code)
        # -1 and the value, unless it ends there
        expected = torch.sigmoid(-out.goal_logit) * (network.value(out.value_logits) - 1)
        torch.testing.assert_close(qvalues[..., action], expected)


@pytest.mark.parametrize("config", [*CONFIGS.values(), small_config(policy_target="search")])
def test_same_seed_gives_the_same_first_updates(config, mazes):
    learners = [make_learner(mazes, config) for _ in range(2)]
    for _ in range(5):
        first, second = (learner.update() for learner in learners)
        assert first == second
    assert all(np.isfinite(list(first.values())))


def test_what_tells_early_whether_a_run_will_work_is_logged(mazes):
    both = {"value_loss", "policy_loss", "goal_loss", "model_loss", "gradient_norm", "value_error", "value"}
    mmn, paper = (set(make_learner(mazes, CONFIGS[name]).update()) for name in ("mmn", "mmn-paper"))
    assert mmn == both | {"model_error_1", "model_error_4", "map_ratio"} | {
        f"{name}_loss" for name in ("localization", "distance", "wall", "goal_place")
    }
    assert paper == both | {"model_error_1", "model_error_5", "map_ratio"}


def test_learner_goes_on_as_if_it_had_not_been_saved(tmp_path, mazes):
    learner = make_learner(mazes)
    for _ in range(3):
        learner.update()
    learner.save(tmp_path, {})
    expected = [learner.update() for _ in range(3)]
    resumed = make_learner(mazes, seed=1, steps=1)
    resumed.load(tmp_path)
    assert [resumed.update() for _ in range(3)] == expected


@OF_ALL
def test_saved_and_built_agent_acts_identically(config, tmp_path, mazes):
    learner = make_learner(mazes, config)
    learner.update()
    learner.save(tmp_path, {})
    agent = type(learner.actor).build(Interface("local", 7, 7), checkpoint=tmp_path / "agent.safetensors")
    observation = an_observation(40)
    first = np.ones(40, dtype=bool)
    expected, _ = learner.actor.act(inputs_of(observation, first), learner.actor.initial_state(40))
    actions, _ = agent.act(inputs_of(observation, first), agent.initial_state(40))
    np.testing.assert_array_equal(actions, expected)


def an_observation(batch, size=7):
    rng = np.random.default_rng(0)
    return {
        "state": rng.normal(size=(batch, 12)).astype(np.float32),
        "context": a_context(batch=batch, size=size).numpy(),
    }


@OF_BOTH
def test_actions_do_not_depend_on_what_else_is_in_the_batch(config):
    agent = agent_class(config)(config, 7, seed=2)
    torch.nn.init.normal_(agent.network.heads.weight)
    observation = an_observation(77)

    def actions(rows):
        part = {key: value[rows] for key, value in observation.items()}
        return agent.act(inputs_of(part, np.ones(len(rows), dtype=bool)), agent.initial_state(len(rows)))[0]

    together = actions(np.arange(77))
    for rows in (np.array([76]), np.arange(40, 77), np.random.default_rng(0).permutation(77)):
        np.testing.assert_array_equal(actions(rows), together[rows])


@OF_BOTH
@pytest.mark.parametrize("active", [[False, True, False], [True, False, True]])
def test_environments_that_rest_change_no_action_of_the_others(config, active):
    agent = agent_class(config)(config, 7)
    torch.manual_seed(1)
    torch.nn.init.normal_(agent.network.heads.weight)
    inputs = inputs_of(an_observation(3), np.ones(3, dtype=bool))
    every, _ = agent.act(inputs, agent.initial_state(3))
    assert every.all()  # no action is that of a resting environment
    some, _ = agent.act(inputs._replace(active=np.array(active)), agent.initial_state(3))
    np.testing.assert_array_equal(some, np.where(active, every, 0))


def test_context_is_encoded_where_it_is_new_and_only_there():
    agent = MMN(small_config(), 7)
    observation = an_observation(3)
    _, state = agent.act(inputs_of(observation, np.ones(3, dtype=bool)), agent.initial_state(3))
    before = [part.clone() for part in state.code]
    observation["context"] = a_context(seed=9, batch=3).numpy()
    _, state = agent.act(inputs_of(observation, np.array([False, True, False])), state)
    for old, new in zip(before, state.code, strict=True):
        assert torch.equal(old[[0, 2]], new[[0, 2]])
    assert not torch.equal(before[1][1], state.code.weights[1])


@pytest.mark.parametrize("config", [CONFIGS["mmn-paper"], dataclasses.replace(CONFIGS["mmn-paper"], keep_anchor=False)])
def test_motion_is_told_from_where_the_episode_began_through_its_landmarks(config):
    agent = MMNPaper(config, 7)
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


def test_spatial_agent_serves_maps_of_any_size(tmp_path, mazes):
    make_learner(mazes).save(tmp_path, {})
    agent = MMN.build(Interface("local", 21, 21), checkpoint=tmp_path / "agent.safetensors")
    actions, _ = agent.act(inputs_of(an_observation(2, size=21), np.ones(2, dtype=bool)), agent.initial_state(2))
    assert actions.shape == (2,)


def test_agent_with_one_code_a_context_says_which_sizes_it_serves(tmp_path, mazes):
    make_learner(mazes, CONFIGS["mmn-paper"]).save(tmp_path, {})
    with pytest.raises(InputError, match=r"expected contexts of 7 x 7, the only ones .* found 13 x 13"):
        MMNPaper.build(Interface("local", 13, 13), checkpoint=tmp_path / "agent.safetensors")


def test_paper_has_what_the_paper_states():
    paper = PaperConfig()
    assert paper.value_target == "n_step"
    assert (paper.model_weight, paper.relabel_start, paper.n_step) == (1, False, 5)


def test_every_weight_of_the_papers_transition_is_generated():
    """Motion is still in a network all of whose generated weights are 0, whatever its other parameters are."""
    network = PaperNetwork(CONFIGS["mmn-paper"], 7)
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter)
    code = code_of(network, a_context())
    code = code._replace(weights=torch.zeros_like(code.weights), rows=torch.zeros_like(code.rows))
    latent = network.encode(torch.randn(1, 6, 9))
    first = network.first_layer(latent, network.look(latent, code), code)
    after = network.step(latent, first, torch.arange(6)[None], code)
    torch.testing.assert_close(after[..., :4], latent[..., :4])  # the pose stays
    torch.testing.assert_close(after[..., 4:7], torch.zeros(1, 6, 3))


def test_mmn_after_a_minute_beats_random_in_a_small_maze():
    """The learning test: goals 3 and 4 cells away in 25 steps."""
    values = {
        "channels": 16,
        "hidden": 64,
        "head_hidden": 64,
        "num_envs": 64,
        "groups": 12,
        "min_rows": 2000,
        "steps_per_update": 64,
        "num_simulations": 4,
        "learning_rate": 2e-3,
        "target_rate": 0.05,
        "longest_value": 25,
        "hindsight_mean_offset": 8,
        "hindsight_window": 30,
    }
    before, after = learn(MMN, 5, (3, 4), 700, values)
    assert before < 0.4
    assert after > 0.8


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_first_update_on_a_gpu_is_that_on_a_cpu(mazes, monkeypatch):
    on_gpu = make_learner(mazes)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    on_cpu = make_learner(mazes)
    found, expected = on_gpu.update(), on_cpu.update()
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=0.05, abs=1e-3), name
