"""The map policy: what its network reads, what it learns from, and what it refuses."""

import numpy as np
import pytest
import torch
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
    maps, pose, velocity, _, label = turned(symmetry, maps, pose, velocity, pictures, label)

    mazes = [Maze(each[0].numpy() > 0, "turned") for each in maps]
    goal = maps[:, 1].flatten(1).argmax(1).numpy()
    yaw, (forward, left) = pose[:, 2].numpy(), velocity.numpy().T
    on_map = np.stack([np.cos(yaw) * forward - np.sin(yaw) * left, np.sin(yaw) * forward + np.cos(yaw) * left], 1)
    costs = Expert(mazes, 8, SLIDER).costs(
        np.arange(8), goal, pose.numpy().astype(np.float64), on_map.astype(np.float64)
    )
    assert (torch.softmax(torch.from_numpy(-costs / 0.08).float(), dim=1) - label).abs().mean() < 0.02


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
