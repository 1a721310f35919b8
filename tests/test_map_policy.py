"""The map policy: what its network reads, what it learns from, and what it refuses."""

import itertools

import numpy as np
import pytest
import torch
from mazebench_agents.common.rollouts import Rows
from mazebench_agents.common.symmetry import NUM_SYMMETRIES
from mazebench_agents.expert import Expert
from mazebench_agents.map_policy import MapPolicy
from mazebench_agents.map_policy.cloning import turned
from mazebench_agents.map_policy.network import MapNetwork

from mazebench.errors import UnplayableError
from mazebench.maps.maze import Maze
from mazebench.tasks.task import Task
from mazebench.testing import check_agent
from mazebench.training.collector import Collector
from mazebench.training.loop import train
from mazebench.world.bodies import SLIDER


def test_a_cell_knows_the_goal_that_is_up_to_41_cells_away():
    """By 40 steps and the convolution before them."""
    network = MapNetwork()
    maps = torch.zeros(2, 2, 5, 61)
    maps[1, 1, 2, 0] = 1
    with torch.no_grad():
        features = network.read(maps)
    differs = (features[0] != features[1]).any(0).any(0)
    assert differs[:30].all()
    assert not differs[42:].any()


@pytest.mark.parametrize("symmetry", range(NUM_SYMMETRIES))
def test_a_turned_minibatch_is_one_of_the_turned_maze(symmetry):
    """The oracle labels its states so, but where ties of the search fall otherwise."""
    task = Task.of("building", split="train", sensors="egocentric", distances=(5,))
    learner = MapPolicy.build_learner(task, overrides={"num_envs": "8"})
    steps = Collector(task, 8).collect(learner.actor, seed=0)
    for _ in range(4):
        step = next(steps)
    maps, pose, velocity = (torch.from_numpy(part) for part in (np.stack(step.notes.shared), *step.notes.parts))
    label, pictures = torch.from_numpy(learner.seen(step).parts[-1]), torch.zeros(8, 1, 1, 3, dtype=torch.uint8)
    rows = Rows(maps, torch.arange(8), (pose, velocity, pictures, label))
    maps, _, (pose, velocity, _, label) = turned(np.full(8, symmetry), rows)

    mazes = [Maze(each[0].numpy() > 0, "turned") for each in maps]
    goal = maps[:, 1].flatten(1).argmax(1).numpy()
    yaw, (forward, left) = pose[:, 2].numpy(), velocity.numpy().T
    on_map = np.stack([np.cos(yaw) * forward - np.sin(yaw) * left, np.sin(yaw) * forward + np.cos(yaw) * left], 1)
    costs = Expert(mazes, 8, SLIDER).costs(
        np.arange(8), goal, pose.numpy().astype(np.float64), on_map.astype(np.float64)
    )
    assert (torch.softmax(torch.from_numpy(-costs / 0.08).float(), dim=1) - label).abs().mean() < 0.02


def test_each_map_is_turned_by_its_own_symmetry():
    """Two states at (1, 2) on each of two maps of 4 x 4 cells: the first map stays, the second one is mirrored."""
    maps = torch.arange(64, dtype=torch.float32).reshape(2, 2, 4, 4)
    pose, velocity = torch.tensor([[1.0, 2.0, 0.0]]).repeat(4, 1), torch.tensor([[0.5, 0.25]]).repeat(4, 1)
    pictures = torch.arange(4 * 12, dtype=torch.uint8).reshape(4, 2, 2, 3)
    label = torch.arange(6.0).repeat(4, 1)
    rows = Rows(maps, torch.tensor([0, 1, 1, 0]), (pose, velocity, pictures, label))
    after, group, parts = turned(np.array([0, 4]), rows)
    for part, before in zip(
        (after[0], *(part[[0, 3]] for part in parts)), (maps[0], *(part[[0, 3]] for part in rows.parts)), strict=True
    ):
        assert torch.equal(part, before)
    assert torch.equal(after[1], maps[1].flip(-1))
    assert torch.equal(group, rows.group)
    pose, velocity, seen, label = (part[1] for part in parts)
    assert torch.allclose(pose, torch.tensor([3.0, 2.0, torch.pi]))
    assert velocity.tolist() == [0.5, -0.25]
    assert torch.equal(seen, pictures[1].flip(1))
    assert label.tolist() == [0, 1, 3, 2, 5, 4]


def drives(**values):
    """The actions `[10, 8]` of ten steps in eight environments, and those that the oracle would take there."""
    task = Task.of("building", split="train", sensors="egocentric", distances=(5,))
    learner = MapPolicy.build_learner(task, overrides={"num_envs": "8", **values})
    steps = itertools.islice(Collector(task, 8).collect(learner.actor, 0, learner.driven), 10)
    taken = [(step.action, learner.seen(step).parts[-1].argmax(axis=1)) for step in steps]
    return tuple(np.stack(each) for each in zip(*taken, strict=True))


def test_the_oracle_drives_in_its_share_of_the_environments():
    actions, labels = drives(oracle_drives="0.5", random_actions="0")
    np.testing.assert_array_equal(actions[:, :4], labels[:, :4])
    assert (actions[:, 4:] != labels[:, 4:]).any(axis=0).all()


def test_its_share_of_random_actions_makes_the_oracle_stray():
    """Of six actions, a random one is another than the oracle's five times out of six."""
    actions, labels = drives(oracle_drives="1", random_actions="0.6")
    assert 0.3 < (actions != labels).mean() < 0.7


def test_an_update_learns_from_whole_drives_that_were_cut():
    """Each of two rollouts has five states on each of eight maps, but where an episode reached its goal."""
    task = Task.of("building", split="train", sensors="egocentric", distances=(20,))
    values = {"num_envs": "8", "rollout_steps": "5", "drive_steps": "5", "epochs": "1", "minibatches": "1"}
    learner = MapPolicy.build_learner(task, overrides=values)
    steps = Collector(task, 8).collect(learner.actor, 0, learner.driven, learner.drive_steps)
    for _ in range(2):
        for _ in range(5):
            learner.observe(next(steps))
        assert learner.num_rows == 40
        learner.update()
        assert learner.num_rows == 0


def test_the_checkpoint_that_ships_does_what_the_oracle_does():
    """In more than half of the states of its own drives."""
    task = Task.of("building", split="train", sensors="egocentric", distances=(5, 15))
    learner = MapPolicy.build_learner(task, overrides={"num_envs": "32", "rollout_steps": "20", "learning_rate": "0"})
    learner.actor.load(MapPolicy.default_checkpoint())
    steps = Collector(task, 32).collect(learner.actor, seed=0)
    for _ in range(20):
        learner.observe(next(steps))
    assert learner.update()["agreement"] > 0.55


def run(out, env_steps, resume=False):
    """A training with a milestone every 80 steps, which are two rollouts; returns its last checkpoint."""
    values = {"num_envs": 8, "rollout_steps": 5, "epochs": 1, "minibatches": 2, "kept_rollouts": 3}
    values |= {"total_steps": 160}
    options = {"overrides": values, "checkpoint_steps": 80, "eval_mazes": 1, "distances": 15}
    train("map-policy", "building", out=out, env_steps=env_steps, resume=resume, **options)
    return max((out / "checkpoints").iterdir())


def test_resumed_run_is_the_unbroken_one(tmp_path):
    whole = run(tmp_path / "whole", 160)
    run(tmp_path / "broken", 80)
    resumed = run(tmp_path / "broken", 160, resume=True)
    for path in whole.iterdir():
        assert path.read_bytes() == (resumed / path.name).read_bytes(), path.name


def test_agent_keeps_its_contract():
    check_agent(MapPolicy, task="building", sensors="egocentric")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"task": "rough"}, "expected maps with a pixel per cell, found 62 pixels for 31 cells"),
        ({"task": "building", "camera_fov": 170}, "expected the default camera"),
    ],
)
def test_what_it_cannot_read_is_refused(options, message):
    with pytest.raises(UnplayableError, match=message):
        MapPolicy.build(Task.of(sensors="egocentric", **options).interface)
