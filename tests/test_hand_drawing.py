"""A map as it is drawn by hand: what it keeps of the maze, and what it changes."""

from __future__ import annotations

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies

from mazebench.maps.kinds.dfs import dfs_walls
from mazebench.maps.maze import cell_to_point
from mazebench.tasks.perturbations.hand_drawing import (
    LARGEST_STRETCH,
    PIXELS,
    Displacement,
    HandDrawnMap,
    Line,
    draw_displacement,
    fitted_drawing,
)
from mazebench.tasks.perturbations.perturbation import ShownMap

SIZE = 13
SHEET = PIXELS * SIZE
BENDS = (0.5, 1.0, 1.5)  # cells
NONE = Displacement(np.zeros((2, SIZE + 18, SIZE + 18)), np.zeros(2))

seeds = strategies.integers(0, 2**32 - 1)
bends = strategies.sampled_from(BENDS)
few = hypothesis.settings(max_examples=10, deadline=None)


def maze(seed):
    return dfs_walls(SIZE, np.random.default_rng(seed))


def drawing(bend, seed):
    shown = ShownMap(maze(seed))
    return HandDrawnMap(bend).shown(shown, ((1, 1), (1, 1)), np.random.default_rng(seed)).drawing


def plain(share=(1.0, 1.0), place=(0.0, 0.0), thickening=0.0):
    return fitted_drawing(SIZE, NONE, np.array(share), np.array(place), thickening)


def grid(per_cell):
    """So many points per cell along an axis, and all points (row, column) of the maze on these, `[2, T, T]`."""
    line = Line(SIZE * per_cell + 1, per_cell)
    return line, np.stack(np.meshgrid(*2 * [line.coordinates()], indexing="ij"))


class TestDisplacement:
    @few
    @hypothesis.given(bends, seeds)
    def test_largest_displacement_is_the_bend(self, bend, seed):
        displacement = draw_displacement(SIZE, np.random.default_rng(seed)).scaled(bend)
        lengths = np.sqrt((displacement.on_grid(grid(20)[0]) ** 2).sum(axis=0))
        assert lengths.max() == pytest.approx(bend, rel=0.005)

    @few
    @hypothesis.given(bends, seeds)
    def test_sheet_does_not_fold(self, bend, seed):
        line, points = grid(10)
        displaced = points + draw_displacement(SIZE, np.random.default_rng(seed)).scaled(bend).on_grid(line)
        down, right = np.diff(displaced, axis=1)[:, :, :-1], np.diff(displaced, axis=2)[:, :-1]
        assert (down[0] > 0).all()
        assert (right[1] > 0).all()
        assert (down[0] * right[1] - down[1] * right[0] > 0).all()

    def test_points_move_as_the_grid_does(self):
        displacement = draw_displacement(SIZE, np.random.default_rng(0))
        line, points = grid(2)
        at_points = displacement.at(points.reshape(2, -1).T)
        np.testing.assert_allclose(at_points.T.reshape(points.shape), displacement.on_grid(line), atol=1e-12)


class TestPicture:
    def test_maze_without_distortions_is_drawn_as_it_is(self):
        np.testing.assert_array_equal(plain().picture(maze(0)), np.kron(maze(0), np.ones((PIXELS, PIXELS))))

    @few
    @hypothesis.given(bends, seeds)
    def test_values_have_8_bits(self, bend, seed):
        picture = drawing(bend, seed).picture(maze(seed))
        assert picture.dtype == np.float32
        assert picture.shape == (SHEET, SHEET)
        grey = np.round(picture * 255)
        np.testing.assert_array_equal(picture, (grey / np.float32(255)).astype(np.float32))
        assert grey.min() >= 0
        assert grey.max() == 255

    def test_same_generator_draws_the_same_field_for_all_bends(self):
        first, *others = (drawing(bend, 3) for bend in BENDS)
        for bend, other in zip(BENDS[1:], others, strict=True):
            np.testing.assert_allclose(other.displacement.noise / bend, first.displacement.noise / BENDS[0])
            assert other.thickening == first.thickening

    def test_pixel_across_an_edge_shows_its_share_of_wall(self):
        # 13 cells of 1.5 pixels, from 3.25 on: the first free cell's left edge lies at 4.75.
        picture = plain(share=(0.75, 0.75), place=(0.5, 0.5)).picture(
            np.pad(np.zeros((11, 11), bool), 1, constant_values=True)
        )
        np.testing.assert_allclose(picture[13, :7], [1, 1, 1, 1, 0.75, 0, 0], atol=0.05)

    @pytest.mark.parametrize("thickening", [-0.5, -0.25, 0.25, 0.5])
    def test_walls_are_thickened_on_both_sides(self, thickening):
        walls = np.zeros((SIZE, SIZE), bool)
        walls[:, 6] = True
        shares = plain(thickening=thickening).picture(walls)[13, 11:15]
        inside = min(1.0, 1 + thickening)  # of the wall's own pixels, 12 and 13
        np.testing.assert_allclose(shares, [max(0, thickening), inside, inside, max(0, thickening)], atol=0.1)

    @few
    @hypothesis.given(bends, seeds)
    def test_drawing_lies_on_the_sheet_in_the_size_that_was_drawn(self, bend, seed):
        drawn = drawing(bend, seed)
        outline = drawn.points(grid(20)[1].reshape(2, -1).T, SIZE)
        np.testing.assert_array_less(-0.02, outline)
        np.testing.assert_array_less(outline, SHEET + 0.02)
        share = np.ptp(outline, axis=0) / SHEET
        assert (share >= (1 - LARGEST_STRETCH) / (1 + LARGEST_STRETCH) - 0.005).all()
        assert (share <= 1.005).all()


class TestMarks:
    @few
    @hypothesis.given(bends, seeds)
    def test_marks_are_never_inside_a_wall(self, bend, seed):
        walls, drawn = maze(seed), drawing(bend, seed)
        picture = drawn.picture(walls)
        for cell in np.argwhere(~walls)[::7]:
            assert picture[drawn.pixel(tuple(cell), picture)] <= 0.5

    @few
    @hypothesis.given(bends, seeds)
    def test_marks_lie_where_the_points_lie_that_they_mark(self, bend, seed):
        walls, drawn = maze(seed), drawing(bend, seed)
        picture, cells = drawn.picture(walls), np.argwhere(~walls)[::7]
        points = drawn.points(cell_to_point(cells, SIZE), SIZE)
        for cell, (x, y) in zip(cells, points, strict=True):
            pixel = int(SHEET - y), int(x)
            if picture[pixel] <= 0.5:
                assert drawn.pixel(tuple(cell), picture) == pixel

    def test_mark_in_a_wall_moves_to_the_nearest_free_pixel(self):
        walls = np.ones((SIZE, SIZE), bool)
        walls[1, 5] = walls[4, 1] = False
        assert plain().pixel((1, 1), plain().picture(walls)) == (8, 2)  # the centre of the cell is at (3, 3)
