"""Films and pictures: what is cut out, and what stands above the views."""

from __future__ import annotations

import numpy as np
import pytest
from simple_mazes import field

from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.plan import make_plan
from mazebench.film import run_episode
from mazebench.maps.maze import Maze
from mazebench.maps.text import format_maze

PIXELS = 210  # a side of a view


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    """A plan in a hall of 5 x 9 cells in a corner of 21 x 21."""
    walls = np.ones_like(field(21).walls)
    walls[1:6, 1:10] = False
    path = tmp_path_factory.mktemp("hall") / "hall.txt"
    path.write_text(format_maze(Maze(walls, "hall")))
    return make_plan(eval_options("planner", mazes=path, distances=(4,), episodes_per_distance=1, sensors=("lidar",)))


@pytest.mark.parametrize("view", ["map", "lidar"])
def test_the_building_is_cut_out_of_its_square(plan, view):
    [picture], _ = run_episode(plan, 0, view, PIXELS, is_film=False)
    assert picture.shape == (PIXELS, PIXELS, 3)
    rows = np.flatnonzero((picture != 255).any(axis=(1, 2)))
    assert np.ptp(rows) + 1 == pytest.approx(PIXELS * 7 / 11, abs=2)  # with its walls, in the middle
    assert rows[0] + rows[-1] == pytest.approx(PIXELS, abs=2)
    walls = (picture < 60).all(axis=2)[rows[0] : rows[-1]]
    assert walls.mean() == pytest.approx(1 - 45 / 77, abs=0.08)


def test_titles_stand_above_several_views(plan, monkeypatch):
    monkeypatch.setattr("mazebench.film.CAMERAS", ())
    [picture], _ = run_episode(plan, 0, "all", PIXELS, is_film=False)
    [alone], _ = run_episode(plan, 0, "map", PIXELS, is_film=False)
    above = len(picture) - PIXELS
    assert picture.shape == (PIXELS + above, 2 * PIXELS, 3)
    assert np.array_equal(picture[above:, 1 : PIXELS - 1], alone[:, 1:-1])
    for title in np.split(picture[:above], 2, axis=1):
        assert (title < 128).any()
