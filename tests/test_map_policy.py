"""The map policy: what its network reads, what it learns from, and what it refuses."""

import numpy as np
import pytest
import torch
from mazebench_agents.common.symmetry import NUM_SYMMETRIES
from mazebench_agents.map_policy import MapPolicy, cloning
from mazebench_agents.map_policy.network import MapNetwork
from mazebench_agents.robot.quickest import costs_of_actions, make_course

from mazebench.errors import UnplayableError
from mazebench.tasks.task import Task
from mazebench.testing import check_agent
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
def test_a_turned_example_is_one_of_the_turned_maze(symmetry):
    examples = cloning.Examples(0, pool=3)
    example = examples._pool[0]
    pictures = np.zeros((len(example.pose), 1, 1, 3), np.uint8)
    maps, pose, velocity, _, labels = cloning._turned(example, pictures, symmetry)

    walls, goal = maps[0].numpy() > 0, tuple(np.argwhere(maps[1].numpy())[0].tolist())
    course = make_course(SLIDER, walls, 1.0, goal)
    yaw, (forward, left) = pose[:, 2].numpy(), velocity.numpy().T
    on_map = np.stack([np.cos(yaw) * forward - np.sin(yaw) * left, np.sin(yaw) * forward + np.cos(yaw) * left], 1)
    costs = costs_of_actions(
        course.motion,
        *(np.repeat(values[None], len(yaw), axis=0) for values in (course.walls, course.way_left)),
        np.full((len(yaw), 2), (course.goal_x, course.goal_y)),
        1.0, pose.numpy().astype(np.float64), on_map.astype(np.float64),
    )  # fmt: skip
    found = torch.softmax(torch.from_numpy(-costs / 0.08).float(), dim=1)
    assert (found - labels).abs().mean() < 0.02  # ties of the search may fall otherwise


def test_a_batch_is_of_new_mazes_too():
    examples = cloning.Examples(0, pool=3)
    first = {example.maze for example in examples._pool}
    maps, pose, velocity, pictures, labels = examples.batch()
    assert maps.shape == (16, 2, 31, 31)
    assert [tuple(each.shape[:2]) for each in (pose, velocity, pictures, labels)] == [(16, 24)] * 4
    assert first.isdisjoint(example.maze for example in examples._pool)


def test_the_checkpoint_that_ships_does_what_the_oracle_does():
    """In two of three states of other drives than it learned from."""
    interface = Task.of("building", sensors="egocentric").interface
    network = MapPolicy.build(interface)._network
    maps, pose, velocity, pictures, labels = cloning.Examples(1, pool=12).batch()
    with torch.no_grad():
        logits = network(network.read(maps), pose, velocity, pictures)
    assert (logits.argmax(-1) == labels.argmax(-1)).float().mean() > 0.6


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
