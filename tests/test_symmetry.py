"""Turned tasks: the world, its map and the actions turn together."""

import numpy as np
import pytest
import torch
from mazebench_agents.common import symmetry
from mazebench_agents.common.layers import state_features
from simple_mazes import field

from mazebench.envs.dm_control import Environment
from mazebench.maps.generators import generate
from mazebench.tasks.context import build_context
from mazebench.tasks.episode import Episode
from mazebench.tasks.spec import TaskSpec


def test_turn_planes_by_symmetry_one_turns_to_the_left():
    plane = torch.arange(4.0).reshape(1, 2, 2)  # 0 1 / 2 3
    assert symmetry.turn_planes(plane, 1).tolist() == [[[1.0, 3.0], [0.0, 2.0]]]
    assert symmetry.turn_planes(plane, 4).tolist() == [[[1.0, 0.0], [3.0, 2.0]]]


@pytest.mark.parametrize("turned", range(symmetry.NUM_SYMMETRIES))
def test_turned_cells_are_where_the_turned_plane_has_the_mark(turned):
    plane = torch.zeros(1, 5, 5)
    plane[0, 1, 3] = 1
    row, column = symmetry.turn_cells(torch.tensor([1, 3]), 5, turned).tolist()
    assert symmetry.turn_planes(plane, turned)[0, row, column] == 1


@pytest.mark.parametrize("turned", range(symmetry.NUM_SYMMETRIES))
def test_turned_experience_is_what_the_simulation_does_in_the_turned_maze(turned):
    """Drives the same way in a field and in the turned one, and compares what would be learned from."""
    start, goal, yaw = (8, 5), (3, 4), 0.7
    turn = lambda cell: tuple(symmetry.turn_cells(torch.tensor(cell), 13, turned).tolist())  # noqa: E731
    turned_yaw = (np.pi - yaw if turned >= 4 else yaw) + (turned % 4) * np.pi / 2
    # Short enough to touch no wall: the boxes that walls are made of do not turn along.
    actions = np.random.default_rng(0).integers(6, size=12)
    plain = drive(Episode(0, start, goal, yaw, 0), actions)
    other = drive(Episode(0, turn(start), turn(goal), turned_yaw, 0), symmetry.turn_actions(actions, turned))
    assert np.ptp(plain[:, :2], axis=0).max() > 0.5
    features = [state_features(torch.from_numpy(states), torch.from_numpy(states[0, :2])) for states in (plain, other)]
    np.testing.assert_allclose(symmetry.turn_features(features[0], turned), features[1], atol=1e-4)


@pytest.mark.parametrize("turned", range(symmetry.NUM_SYMMETRIES))
def test_turned_context_is_the_context_of_the_turned_maze(turned):
    walls = generate("dfs", 7, np.random.default_rng(2)).walls
    turn = lambda cell: tuple(symmetry.turn_cells(torch.tensor(cell), 7, turned).tolist())  # noqa: E731
    turned_walls = symmetry.turn_planes(torch.from_numpy(walls.copy()), turned).numpy()
    context = torch.from_numpy(build_context(walls, (1, 1), (5, 3), 7))
    expected = build_context(turned_walls, turn((1, 1)), turn((5, 3)), 7)
    np.testing.assert_array_equal(symmetry.turn_planes(context, turned), expected)


def drive(episode, actions):
    env = Environment(TaskSpec(mazes=(field(13),), distances=(1,), time_limit=1000))
    states = [env.reset(episode=episode).observation["state"]]
    for action in actions:
        states.append(env.step(int(action)).observation["state"])
    return np.stack(states)
