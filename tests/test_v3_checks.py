"""The checks before benchmark v3 is frozen, on a few mazes."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest

from benchmarks import ideal_agents, v3_checks
from mazebench.errors import InputError
from mazebench.maps.doors import door_slots, swap_doors
from mazebench.tasks.tracks.rebuilt import MovedDoors, num_swaps
from tests.simple_mazes import field

SETTINGS = v3_checks.Settings(kinds=("dfs", "office"), episodes=5, workers=0, old_navigator=None)


def rows(text: str) -> list[list[str]]:
    """Returns the cells of the rows of a Markdown table, without its head."""
    return [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")][2:]


@pytest.mark.parametrize("kind", v3_checks.KINDS)
def test_as_many_doors_can_move_as_a_level_wants(kind):
    for maze in v3_checks.check_mazes(kind, 5):
        MovedDoors().require(maze, 0.85)
        ends = tuple(map(tuple, maze.free_cells[[0, -1]].tolist()))
        swap_doors(maze.walls, door_slots(maze), num_swaps(maze, 0.85), ends, np.random.default_rng(0))


def test_more_swaps_block_more_paths(capsys):
    v3_checks.check_swaps(SETTINGS)
    for row in rows(capsys.readouterr().out):
        shares = [float(cell.partition(": ")[2]) for cell in row[3:]]
        assert shares == sorted(shares)


def test_the_oracle_reaches_all_goals(capsys):
    v3_checks.check_worth(SETTINGS)
    table = rows(capsys.readouterr().out)
    assert [row[0] for row in table] == ["dfs", "office"]
    assert all(row[1].startswith("1.00") for row in table)


def test_a_right_map_leads_the_ideal_agent_to_the_goal_without_a_detour(capsys):
    v3_checks.check_ideal(SETTINGS)
    table = rows(capsys.readouterr().out)
    assert [(row[0], row[1]) for row in table] == [(f"`{track}`", str(level)) for track, level in v3_checks.PARTS]
    assert [row[2][:4] for row in table[:3]] == ["1.00"] * 3
    assert table[0][3] == "1.00"


def test_the_old_navigator_must_be_given(capsys):
    with pytest.raises(InputError, match="old-navigator"):
        v3_checks.check_old(SETTINGS)


def test_the_agents_of_the_checkout_play(tmp_path, monkeypatch, capsys):
    navigator = tmp_path / "agents" / "navigator"
    navigator.mkdir(parents=True)
    navigator.joinpath("__init__.py").write_text("from mazebench_agents.random_agent import RandomAgent as Navigator")
    here = pathlib.Path(v3_checks.__file__).parents[1]
    navigator.parent.joinpath("random_agent").symlink_to(here / "agents" / "random_agent")
    monkeypatch.setattr(v3_checks, "PARTS", [("rebuilt", 1)])
    v3_checks.check_old(SETTINGS._replace(kinds=("dfs",), workers=1, old_navigator=tmp_path))
    assert rows(capsys.readouterr().out)[0][2].startswith("0.00")


class TestIdealAgent:
    def test_it_goes_straight_in_a_building_that_it_knows(self):
        maze = field(9)
        start, goal = (1, 1), (7, 7)
        wall = np.where(maze.walls, 1.0, 1e-3)[None]
        prior = np.full(wall.shape, -1e4)
        prior[0, 1, 1] = 0
        told = ideal_agents.Told(start, wall, np.array([goal]), prior)
        assert ideal_agents.cells_entered(maze.walls, goal, told, 40) == 12
        assert ideal_agents.cells_entered(maze.walls, goal, told, 11) is None

    def test_without_the_goal_it_visits_cell_after_cell(self):
        walls = np.ones((7, 7), dtype=bool)
        walls[3, 1:6] = False
        told = ideal_agents.Told((3, 1), walls[None].astype(float), None, np.zeros((1, 7, 7)))
        assert ideal_agents.cells_entered(walls, (3, 5), told, 40) == 4

    def test_it_finds_its_place_by_what_it_sees(self):
        # A corridor with a niche: the map tells the two halves apart.
        walls = np.ones((9, 9), dtype=bool)
        walls[4, 1:8] = walls[3, 2] = False
        wall = np.where(walls, 0.999, 0.001)[None]
        told = ideal_agents.Told((4, 1), wall, np.array([(4, 7)]), np.where(walls, -1e4, 0.0)[None])
        assert ideal_agents.cells_entered(walls, (4, 7), told, 40) == 6
