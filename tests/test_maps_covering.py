"""Rectangles that cover the walls: exact, disjoint, and as grown by hand."""

from __future__ import annotations

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies
from hypothesis.extra import numpy as numpy_strategies

from mazebench.maps.covering import Rectangle, cover


@pytest.mark.parametrize(
    ("rows", "rectangles"),
    [
        (["...", "...", "..."], []),
        (["###", "###", "###"], [Rectangle(0, 0, 3, 3)]),
        ([".#.", "...", "..."], [Rectangle(0, 1, 1, 2)]),
        # Grown to the right first, then down.
        (["##.", "##.", "#.."], [Rectangle(0, 0, 2, 2), Rectangle(2, 0, 3, 1)]),
        (["###", "#.#", "###"], [(0, 0, 1, 3), (1, 0, 3, 1), (1, 2, 3, 3), (2, 1, 3, 2)]),
        (["#.#", ".#.", "#.#"], [(0, 0, 1, 1), (0, 2, 1, 3), (1, 1, 2, 2), (2, 0, 3, 1), (2, 2, 3, 3)]),
    ],
)
def test_cover_when_worked_by_hand(rows, rectangles):
    walls = np.array([[character == "#" for character in row] for row in rows])
    assert cover(walls) == rectangles


@hypothesis.settings(max_examples=200, deadline=None)
@hypothesis.given(numpy_strategies.arrays(bool, strategies.integers(1, 12).map(lambda size: (size, size))))
def test_cover_when_grid_is_arbitrary(walls):
    before = walls.copy()
    times_covered = np.zeros(walls.shape, dtype=int)
    for top, left, bottom, right in cover(walls):
        assert 0 <= top < bottom <= len(walls)
        assert 0 <= left < right <= len(walls)
        times_covered[top:bottom, left:right] += 1
    np.testing.assert_array_equal(times_covered, walls)
    np.testing.assert_array_equal(walls, before)
