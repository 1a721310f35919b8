"""The walls near a body: the same bits as the whole maze gives, wherever the body drives."""

from __future__ import annotations

import numpy as np
import pytest
from simple_mazes import CART

from mazebench.constants import ACTIONS, STEPS_PER_ACTION
from mazebench.envs.vector import MazeVectorEnv
from mazebench.maps.doors import swap_doors
from mazebench.maps.drawn import FreshMazes
from mazebench.maps.kinds import KINDS, generate
from mazebench.maps.maze import MAX_SIZE, Maze, resized
from mazebench.maps.moving_doors import ChangingMazes, moving_doors
from mazebench.tasks.episode import Episode
from mazebench.tasks.task import Task
from mazebench.world.bodies import SLIDER, Body
from mazebench.world.mjcf import maze_spec
from mazebench.world.near_walls import NearWalls, WallGeoms
from mazebench.world.simulation import MujocoSimulation


def maze_of(kind: str, size: int = 21, cell_size: float = 1.0) -> Maze:
    return resized(generate(kind, size, np.random.default_rng(3)), cell_size)


def rebuilt() -> Maze:
    """A house in which doors have moved."""
    house = maze_of("house")
    ends = tuple(map(tuple, house.free_cells[[0, -1]].tolist()))
    return Maze(swap_doors(house.walls, house.kind, 2, ends, np.random.default_rng(0)), "rebuilt")


def drive(
    maze: Maze, num_steps: int, held: float, seed: int = 0, is_continuous: bool = False, body: Body = SLIDER
) -> tuple[int, float]:
    """Drives at random in the whole maze and near its walls; returns the contacts and the top speed there were.

    An action, one of six or velocities, is held on with the probability `held` in each of the steps.
    """
    walls, of_actions = NearWalls((maze,), 1, body), body.action_controls()
    whole, near = MujocoSimulation(maze_spec(maze, body=body).compile()), MujocoSimulation(walls.model, walls)
    rng = np.random.default_rng(seed)
    start = maze.free_cells[rng.integers(len(maze.free_cells))]
    near.surround(0, int(start @ (maze.size, 1)))
    for simulation in (whole, near):
        with simulation.reset_context():
            simulation.place_agent(maze.point(start), 0.3)
    controls, contacts, fastest = of_actions[0], 0, 0.0
    for _ in range(num_steps):
        if rng.random() >= held:
            action = int(rng.integers(len(ACTIONS)))
            controls = body.velocity_controls(rng.uniform(-1, 1, 3)) if is_continuous else of_actions[action]
        row, column = maze.cell_at(*near.position())
        near.surround(0, row * maze.size + column)
        for simulation in (whole, near):
            simulation.set_controls(controls)
            simulation.step(STEPS_PER_ACTION)
        np.testing.assert_array_equal(near.data.qpos, whole.data.qpos)
        np.testing.assert_array_equal(near.data.qvel, whole.data.qvel)
        contacts, fastest = contacts + whole.data.ncon, max(fastest, np.hypot(*whole.data.qvel[:2]))
    return contacts, fastest


class TestBits:
    @pytest.mark.parametrize("kind", KINDS)
    def test_a_body_moves_as_in_the_whole_maze(self, kind):
        contacts, fastest = drive(maze_of(kind), 300, held=0.8)
        assert contacts > 100
        assert fastest > SLIDER.top_speed

    @pytest.mark.parametrize("cell_size", [0.4, 0.75])
    def test_in_narrow_cells_of_caves_too(self, cell_size):
        assert drive(maze_of("cave", cell_size=cell_size), 300, held=0.8)[0] > 100

    @pytest.mark.parametrize("cell_size", [0.4, 0.76, 1.0])
    def test_when_velocities_are_set(self, cell_size):
        assert drive(maze_of("dfs", cell_size=cell_size), 400, held=0.8, is_continuous=True)[0] > 100

    def test_of_a_wider_and_slower_body_too(self):
        contacts, fastest = drive(maze_of("dfs"), 300, held=0.8, body=CART)
        assert contacts > 100
        assert CART.top_speed < fastest < CART.fastest

    def test_where_doors_have_moved(self):
        assert drive(rebuilt(), 300, held=0.8)[0] > 100

    def test_when_cells_are_entered_at_top_speed(self):
        contacts, fastest = drive(maze_of("dfs", 31), 600, held=0.95)
        assert contacts > 100
        assert fastest > 0.99 * SLIDER.top_speed

    def test_the_body_is_never_faster_than_it_says(self):
        assert SLIDER.fastest >= 3.643  # m/s, which no two drives exceed (the comment in its file)


def write_one(walls, geoms, maze, cell):
    walls.write(geoms, np.array([0]), np.array([maze]), np.array([cell]))


class TestBoxes:
    @pytest.mark.parametrize(("cell_size", "reach"), [(1.0, 1), (0.75, 2), (0.4, 2)])
    def test_those_within_reach_of_a_cell_are_there_in_order(self, cell_size, reach):
        maze = maze_of("obstacles", 15, cell_size)
        whole = maze_spec(maze).compile()
        walls = NearWalls((maze,), 1, SLIDER)
        geoms = WallGeoms.of_model(walls.model)
        for row, column in maze.free_cells[::7].tolist():
            write_one(walls, geoms, 0, row * maze.size + column)
            near = [
                index
                for index, box in enumerate(maze.boxes)
                if box.top - reach <= row < box.bottom + reach and box.left - reach <= column < box.right + reach
            ]
            for name, values in zip(geoms._fields, geoms, strict=True):
                expected = getattr(whole, f"geom_{name}")[np.add(near, 1)]  # after the floor
                np.testing.assert_array_equal(values[0, : len(near)], expected, err_msg=name)
            assert (geoms.pos[0, len(near) :, 2] < 0).all()

    def test_environments_may_be_in_different_fresh_mazes(self):
        mazes = FreshMazes(("dfs", "house"), 13)
        walls, alone = NearWalls(mazes, 10, SLIDER), NearWalls((mazes[9],), 1, SLIDER)
        expected = WallGeoms.of_model(alone.model)
        geoms = WallGeoms(*(np.zeros((10, *each.shape[1:])) for each in expected))
        cell = int(mazes[9].free_cells[4] @ (13, 1))
        others = np.arange(7)
        walls.write(geoms, np.append(others, 8), np.append(others + 5, 9), np.append(others * 0 + 14, cell))
        write_one(alone, expected, 0, cell)
        np.testing.assert_array_equal(geoms.pos[8], expected.pos[0])
        assert not geoms.pos[9].any()

    def test_an_environment_without_an_episode_has_no_body_in_a_free_cell(self):
        envs = MazeVectorEnv(Task.of(), 2, episode_source=lambda i: None if i else Episode(0, (1, 1), (3, 1), 0.0, 7))
        envs.reset()
        envs.step(np.zeros(2, dtype=int))


def test_a_maze_of_the_largest_size_is_played():
    envs = MazeVectorEnv(Task.of(mazes=maze_of("cave", MAX_SIZE - 1), distances=5, sensors="lidar"), 2)
    observation, _ = envs.reset(seed=0)
    assert observation["context"].shape == (2, 4, 21, 21)
    assert (envs.step(np.zeros(2, dtype=int))[0]["lidar"] > 0).all()


def test_the_boxes_near_a_body_are_the_walls_there_whichever_doors_have_moved():
    maze, rng = maze_of("house"), np.random.default_rng(0)
    mazes = ChangingMazes((maze,))
    walls, num_doors = NearWalls(mazes, 1, SLIDER), len(moving_doors(maze))
    geoms = WallGeoms.of_model(walls.model)
    for _ in range(200):
        number = len(mazes) * int(rng.integers(2**num_doors))
        stands = mazes[number].walls
        row, column = maze.free_cells[rng.integers(len(maze.free_cells))].tolist()
        write_one(walls, geoms, number, row * maze.size + column)
        around = np.argwhere(np.ones((3, 3))) + np.array([row - 1, column - 1])
        off = np.abs(geoms.pos[0, :, None, :2] - maze.point(around))
        is_wall = ((off < geoms.size[0, :, None, :2]).all(axis=-1) & (geoms.pos[0, :, None, 2] > 0)).any(axis=0)
        np.testing.assert_array_equal(is_wall, stands[tuple(around.T)])
