"""How the belief planner's network learns: scenes, walks, losses, and checkpoints."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from mazebench_agents.belief_planner import BeliefPlanner
from mazebench_agents.belief_planner.config import BeliefPlannerConfig
from mazebench_agents.belief_planner.layouts import draw_layout
from mazebench_agents.belief_planner.learner import BeliefPlannerLearner, draw_batch, losses
from mazebench_agents.belief_planner.network import BeliefNetwork, View, believe, picture
from mazebench_agents.belief_planner.walks import true_ranges, walk_to_goal
from mazebench_agents.belief_planner.wrong_maps import Situation, draw_situation
from mazebench_agents.robot.occupancy import SURE, Occupancy
from scipy import ndimage

import mazebench
from benchmarks import belief_losses

CONFIG = BeliefPlannerConfig(channels=8, dilations=(1, 2), batch_size=8, least_size=9)
MAZES = tuple(mazebench.generate(kind, 15, np.random.default_rng(0)) for kind in ("dfs", "house", "rooms"))


def make_network(config: BeliefPlannerConfig = CONFIG, trained: bool = False) -> BeliefNetwork:
    torch.manual_seed(0)
    network = BeliefNetwork(config)
    if trained:  # corrections that are not zero
        torch.nn.init.normal_(network.outputs.weight)
    return network


def make_learner(seed: int = 0) -> BeliefPlannerLearner:
    actor = BeliefPlanner(CONFIG, 15)
    actor.network = make_network()
    return BeliefPlannerLearner(actor, SimpleNamespace(mazes=MAZES), seed)  # type: ignore[arg-type]


def situations(count: int, is_lost: bool = False) -> list[Situation]:
    rng = np.random.default_rng(1)
    return [draw_situation(draw_layout(MAZES, 0.5, 15, rng), is_lost, rng) for _ in range(count)]


def views(count: int, is_lost: bool = False) -> list[View]:
    rng = np.random.default_rng(2)
    return [walk_to_goal(situation, 2, rng)[1] for situation in situations(count, is_lost)]


def rule(view: View) -> np.ndarray:
    return Occupancy(view.evidence).walls(view.prior)


@pytest.mark.parametrize("size", [9, 12, 15])
def test_layouts_are_connected_and_closed(size):
    rng = np.random.default_rng(0)
    for _ in range(30):
        walls = draw_layout(MAZES, 0.5, size, rng)
        assert walls.shape == (size, size)
        assert walls[[0, -1]].all()
        assert walls[:, [0, -1]].all()
        assert ndimage.label(~walls)[1] == 1


def test_all_layouts_may_be_from_the_mazes_of_the_task():
    rng = np.random.default_rng(0)
    drawn = [draw_layout(MAZES, 1.0, 15, rng) for _ in range(60)]
    is_from_one = [any(np.array_equal(walls, maze.walls) for maze in MAZES) for walls in drawn]
    assert 0.65 < np.mean(is_from_one) < 0.95  # in a fifth, something is built or torn down
    assert not any(np.array_equal(draw_layout(MAZES, 0.0, 15, rng), maze.walls) for maze in MAZES for _ in range(10))


@pytest.mark.parametrize("is_lost", [False, True])
def test_a_situation_has_a_start_and_a_goal_on_free_cells(is_lost):
    for situation in situations(60, is_lost):
        prior, goal = situation.belief.mixture()
        assert prior.shape == goal.shape == situation.walls.shape
        assert situation.start != situation.goal
        assert not situation.walls[situation.start]
        assert not situation.walls[situation.goal]
        assert is_lost or prior[situation.goal] < 1  # of many placements, only the likeliest are held for possible
        assert goal.sum() == pytest.approx(1)


def test_a_right_map_shows_the_layout():
    for situation in situations(60):
        if situation.wrong == "right" and len(situation.belief.placements) == 1:
            prior, goal = situation.belief.mixture()
            if np.ptp(prior[1:-1, 1:-1]) > 0:  # not a blank map
                assert ((prior > 0.5) == situation.walls).all()
                assert goal[situation.goal] == pytest.approx(1)


def test_ranges_are_the_distances_to_the_walls():
    walls = np.ones((7, 7), dtype=bool)
    walls[3, 1:6] = False
    ranges = true_ranges(walls, np.array([[1.5, 3.5, 0.0]]), 10.0)[0]
    assert ranges[[0, 8, 16, 24]] == pytest.approx([4.5, 0.5, 0.5, 0.5])
    assert true_ranges(walls, np.array([[1.5, 3.5, 0.0]]), 2.0)[0, 0] == 2.0


@pytest.mark.parametrize("is_lost", [False, True])
def test_what_a_walk_has_seen_is_mostly_true(is_lost):
    rng = np.random.default_rng(2)
    num_seen = num_true = 0
    for situation in situations(40, is_lost):
        for view in walk_to_goal(situation, 2, rng):
            seen = np.abs(view.evidence) >= SURE
            num_seen += seen.sum()
            num_true += ((view.evidence > 0) == situation.walls)[seen].sum()
            assert not (view.searched & situation.walls).any()
            assert not view.searched[situation.goal]
    assert num_seen > 500
    assert num_true / num_seen > 0.99


@pytest.mark.parametrize("is_lost", [False, True])
def test_an_untrained_network_believes_what_the_rule_does(is_lost):
    network = make_network()
    for view in views(10, is_lost):
        walls, goal = believe(network, view)
        assert walls == pytest.approx(rule(view), abs=1e-3)
        if not view.searched[view.goal == view.goal.max()].any():
            assert goal.max() > 0.5 * view.goal.max()


def test_what_is_seen_or_certain_is_never_corrected():
    network = make_network(trained=True)
    for view in views(10):
        walls, goal = believe(network, view)
        fixed = (np.abs(view.evidence) >= SURE) | (view.prior == 1)
        assert (walls[fixed] == rule(view)[fixed]).all()
        assert (walls[view.prior == 1] == 1).all()
        assert goal.sum() == pytest.approx(1)
        assert not goal[view.searched | (view.prior == 1)].any()


def test_a_belief_does_not_depend_on_where_the_maze_lies():
    network = make_network(trained=True)
    for view in views(3):
        walls, goal = believe(network, view)
        wall, nothing = np.ones((25, 25)), np.zeros((25, 25))
        wide = View(wall, nothing, nothing.copy(), nothing > 0)
        for into, plane in zip(wide, view, strict=True):
            into[3:18, 7:22] = plane
        shifted, goal_shifted = believe(network, wide)
        assert shifted[3:18, 7:22] == pytest.approx(walls, abs=1e-5)
        assert goal_shifted[3:18, 7:22] == pytest.approx(goal, abs=1e-5)


def test_padding_changes_no_loss():
    network = make_network(trained=True)
    batch = draw_batch(MAZES, CONFIG, np.random.default_rng(0))
    side = batch.walls.shape[-1]
    wider = {
        name: torch.nn.functional.pad(value, (0, 4, 0, 3))
        for name, value in batch._asdict().items()
        if value.shape[-2:] == (side, side)
    }
    row, column = batch.goal // side, batch.goal % side
    padded = batch._replace(**wider, goal=torch.where(batch.goal < 0, -1, row * (side + 4) + column))
    for before, after in zip(losses(network, batch).values(), losses(network, padded).values(), strict=True):
        assert torch.allclose(after, before, atol=1e-4)


@pytest.mark.parametrize("size", [13, 51, 101])
def test_one_network_serves_all_sizes(size):
    maze = mazebench.generate("dfs", size, np.random.default_rng(0))
    goal = np.zeros((size, size))
    goal[tuple(maze.free_cells[-1])] = 1
    prior = np.where(maze.walls, 0.9, 0.1)
    prior[[0, -1]] = prior[:, [0, -1]] = 1
    evidence = np.zeros((size, size))
    walls, believed = believe(make_network(trained=True), View(prior, evidence, goal, goal > 1))
    assert walls.shape == believed.shape == (size, size)
    assert np.isfinite(walls).all()
    assert np.isfinite(believed).all()


def test_a_goal_that_can_be_nowhere_has_no_probability():
    view = views(1)[0]
    _, goal = believe(make_network(), view._replace(searched=np.ones_like(view.searched)))
    assert not goal.any()


@pytest.mark.parametrize("options", [(), ("--trained-in", "1")])
def test_before_training_the_losses_are_those_of_the_rule(tmp_path, monkeypatch, capsys, options):
    path = tmp_path / "agent.safetensors"
    BeliefPlanner(CONFIG, 21).save(path, {})
    monkeypatch.setattr("sys.argv", ["", str(path), "--batches", "2", "--kind", "rooms", *options])
    belief_losses.main()
    assert capsys.readouterr().out.split() == ["rooms", "1.000", "[1.000,", "1.000]"]


def test_learning_lowers_the_loss_on_scenes_that_it_sees_again():
    network = make_network()
    batch = draw_batch(MAZES, CONFIG, np.random.default_rng(0))
    optimizer = torch.optim.Adam(network.parameters(), lr=5e-3)
    history = []
    for _ in range(60):
        found = losses(network, batch)
        loss = found["wall_loss"].mean()
        history.append(loss.item())
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert history[0] == pytest.approx(found["rule_wall_loss"].mean().item(), abs=1e-3)
    assert history[-1] < 0.8 * history[0]


def test_a_learner_resumes_bit_for_bit(tmp_path):
    unbroken, resumed = make_learner(), make_learner()
    unbroken.update()
    unbroken.save(tmp_path, {})
    resumed.load(tmp_path)
    assert resumed.num_rows == unbroken.num_rows
    for _ in range(2):
        assert unbroken.update() == resumed.update()


def test_scenes_differ_from_update_to_update_and_from_seed_to_seed():
    learner = make_learner()
    found = {learner.update()["rule_wall_loss"] for _ in range(3)} | {make_learner(seed=1).update()["rule_wall_loss"]}
    assert len(found) == 4


def test_rows_are_counted():
    learner = make_learner()
    learner.observe(SimpleNamespace(action=np.zeros(4)))  # type: ignore[arg-type]
    assert learner.num_rows == 4


def test_pictures_are_of_numbers_near_one():
    for view in views(20):
        assert np.abs(picture(view).planes).max() <= 2
