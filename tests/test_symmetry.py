"""Turned tasks: the world, its map and the actions turn together."""

import numpy as np
import pytest
import torch
from hypothesis import given, strategies
from mazebench_agents.common import symmetry
from mazebench_agents.common.layers import state_features
from simple_mazes import field

from mazebench.envs.dm_control import Environment
from mazebench.maps.kinds import generate
from mazebench.tasks.context import build_context
from mazebench.tasks.episode import Episode
from mazebench.tasks.task import Task


def test_turn_planes_by_symmetry_one_turns_to_the_left():
    plane = torch.arange(4.0).reshape(1, 2, 2)  # 0 1 / 2 3
    assert symmetry.turn_planes(plane, 1).tolist() == [[[1.0, 3.0], [0.0, 2.0]]]
    assert symmetry.turn_planes(plane, 4).tolist() == [[[1.0, 0.0], [3.0, 2.0]]]


SYMMETRY = strategies.integers(0, symmetry.NUM_SYMMETRIES - 1)
SEED = strategies.integers(0, 2**32)


def turned_cell(cell, size, turned):
    return tuple(symmetry.turn_cells(torch.tensor(cell), size, turned).tolist())


@given(SYMMETRY, strategies.integers(2, 6), SEED)
def test_turned_context_is_the_context_of_the_turned_maze(turned, half, seed):
    rng = np.random.default_rng(seed)
    size = 2 * half + 1
    walls = generate("dfs", size, rng).walls
    start, goal = rng.permutation(np.argwhere(~walls))[:2].tolist()
    context = build_context(walls, tuple(start), tuple(goal), size)
    turned_walls = symmetry.turn_planes(torch.from_numpy(walls.copy()), turned).numpy()
    expected = build_context(turned_walls, turned_cell(start, size, turned), turned_cell(goal, size, turned), size)
    np.testing.assert_array_equal(symmetry.turn_planes(torch.from_numpy(context), turned), expected)


@given(SYMMETRY, strategies.integers(1, 9), SEED)
def test_the_inverse_of_a_symmetry_turns_everything_back(turned, size, seed):
    inverse = turned if turned >= 4 else -turned % 4  # mirrored twice, or turned on to a whole turn
    rng = np.random.default_rng(seed)
    planes, features = torch.from_numpy(rng.normal(size=(2, size, size))), torch.from_numpy(rng.normal(size=(5, 9)))
    cells, actions = torch.from_numpy(rng.integers(size, size=(5, 2))), rng.integers(6, size=5)
    assert torch.equal(symmetry.turn_planes(symmetry.turn_planes(planes, turned), inverse), planes)
    assert torch.equal(symmetry.turn_features(symmetry.turn_features(features, turned), inverse), features)
    assert torch.equal(symmetry.turn_cells(symmetry.turn_cells(cells, size, turned), size, inverse), cells)
    np.testing.assert_array_equal(symmetry.turn_actions(symmetry.turn_actions(actions, turned), inverse), actions)


@pytest.mark.parametrize("turned", range(symmetry.NUM_SYMMETRIES))
def test_turned_experience_is_what_the_simulation_does_in_the_turned_maze(turned):
    """Drives the same way in a field and in the turned one, and compares what would be learned from."""
    start, goal, yaw = (8, 5), (3, 4), 0.7
    turned_yaw = (np.pi - yaw if turned >= 4 else yaw) + (turned % 4) * np.pi / 2
    # Short enough to touch no wall: the boxes that walls are made of do not turn along.
    actions = np.random.default_rng(0).integers(6, size=12)
    plain = drive(Episode(0, start, goal, yaw, 0), actions)
    other = drive(
        Episode(0, turned_cell(start, 13, turned), turned_cell(goal, 13, turned), turned_yaw, 0),
        symmetry.turn_actions(actions, turned),
    )
    assert np.ptp(plain[:, :2], axis=0).max() > 0.5
    features = [state_features(torch.from_numpy(states), torch.from_numpy(states[0, :2])) for states in (plain, other)]
    np.testing.assert_allclose(symmetry.turn_features(features[0], turned), features[1], atol=1e-4)


def drive(episode, actions):
    env = Environment(Task.of(mazes=field(13), distances=(1,), time_limit=1000))
    states = [env.reset(episode=episode).observation["state"]]
    for action in actions:
        states.append(env.step(int(action)).observation["state"])
    return np.stack(states)
