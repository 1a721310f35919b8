"""The checks of the tracks, on a few mazes."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import tracks_checks
from mazebench.maps.doors import swap_doors
from mazebench.tasks.perturbations.moved_doors import MovedDoors

KINDS, EPISODES = "dfs,office", 3


def rows(text: str) -> list[list[str]]:
    """Returns the cells of the rows of a Markdown table, without its head."""
    return [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")][2:]


@pytest.mark.parametrize("kind", tracks_checks.KINDS.split(","))
def test_as_many_doors_can_move_as_a_level_wants(kind):
    for maze in tracks_checks.check_mazes(kind, 1):
        doors = MovedDoors(percent=85)
        doors.require(maze)
        ends = tuple(map(tuple, maze.free_cells[[0, -1]].tolist()))
        swap_doors(maze.walls, maze.kind, doors.num_swaps(maze), ends, np.random.default_rng(0))


def test_more_swaps_block_more_paths(capsys):
    tracks_checks.swaps(KINDS, EPISODES)
    for row in rows(capsys.readouterr().out):
        shares = [float(cell.partition(": ")[2]) for cell in row[3:]]
        assert shares == sorted(shares)


def test_the_oracle_reaches_all_goals(capsys):
    tracks_checks.worth(KINDS, EPISODES)
    table = rows(capsys.readouterr().out)
    assert [row[0] for row in table] == ["dfs", "office"]
    assert all(row[1].startswith("1.00") for row in table)
