"""Two maps of one building in two frames: the pose of one on the other, and what they differ in."""

from __future__ import annotations

import dataclasses
import json
import math

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from mazebench.errors import InputError
from mazebench.maps.align import align, fit, moved
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.maps.maze_files import read_located
from mazebench.maps.pair import compared, draw_pair, pair_of_walls
from mazebench.maps.readers.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, states_in_cells
from mazebench.results.reading import load_result
from mazebench.tasks.task import Task

PIXEL = 0.05  # m


def scan(seed: int = 0, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> OccupancyGrid:
    """A map of an office, in cells of .5 m, with furniture, and unknown where no robot was."""
    rng = np.random.default_rng(seed)
    walls = generate("office", 41, rng).walls
    states = np.where(walls, OCCUPIED, FREE).astype(np.int8).repeat(10, 0).repeat(10, 1)
    inside = cv2.erode(walls.astype(np.uint8), np.ones((3, 3)), borderValue=1).repeat(10, 0).repeat(10, 1) > 0
    states[inside] = UNKNOWN
    for row, column in rng.integers(10, 400, (12, 2)):
        states[row : row + 6, column : column + 12][states[row : row + 6, column : column + 12] == FREE] = OCCUPIED
    return OccupancyGrid(states, PIXEL, origin, frame="map")


def redrawn(grid: OccupancyGrid, pose: tuple[float, float, float], size: int = 640) -> OccupancyGrid:
    """A map of the same building in a frame that has a pose in the frame of `grid`, with an origin of its own."""
    own = (-3.0, 2.0, 0.0)
    corner = moved(dataclasses.replace(grid, origin=own), pose).origin
    return OccupancyGrid(states_in_cells(grid, corner, PIXEL, (size, size)), PIXEL, own, frame="map")


class TestAlign:
    @settings(max_examples=8, deadline=None)  # each takes a second
    @given(st.floats(-math.pi, math.pi), st.floats(-8, 8), st.floats(-8, 8), st.floats(-3, 3))
    def test_any_turn_and_shift_is_found(self, yaw, x, y, of_newer):
        newer = scan(origin=(5.0, -7.0, of_newer))
        # The older map's picture covers the building whatever its turn is.
        middle = np.array(moved(dataclasses.replace(newer, origin=(10.25, 10.25, 0.0)), newer.origin).origin[:2])
        cosine, sine = math.cos(yaw), math.sin(yaw)
        x, y = middle + np.array([x, y]) / 8 - np.array([[cosine, -sine], [sine, cosine]]) @ [13.0, 18.0]
        found = align(redrawn(newer, (x, y, yaw)), newer, "older")
        assert abs(math.remainder(found[2] - yaw, math.tau)) < math.radians(0.5)
        for corner in ([13.0, 18.0], [3.0, 10.0], [23.0, 26.0]):
            places = [
                np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]]) @ corner + [left, up]
                for left, up, a in (found, (x, y, yaw))
            ]
            assert np.linalg.norm(places[0] - places[1]) < 0.1

    @pytest.mark.parametrize("seed", [1, 2])
    def test_another_building_is_refused(self, seed):
        with pytest.raises(InputError, match="other: expected a map of the same building"):
            align(scan(seed), scan(0), "other")

    def test_a_map_of_a_part_in_other_pixels_is_found(self):
        newer = scan()
        part = dataclasses.replace(newer, states=newer.states[40:330, 20:300])
        fine = OccupancyGrid(part.states.repeat(2, 0).repeat(2, 1), PIXEL / 2)
        x, y, yaw = align(fine, newer, "older")
        assert (x, y, yaw) == pytest.approx((1.0, (410 - 330) * PIXEL, 0), abs=0.03)

    def test_a_map_that_shows_nothing_is_refused(self):
        nothing = dataclasses.replace(scan(), states=np.full((50, 50), UNKNOWN, dtype=np.int8))
        with pytest.raises(InputError, match="expected a map with free space"):
            align(nothing, scan(), "older")


class TestFit:
    def test_of_a_map_on_itself_all_is_common(self):
        assert fit(scan(), scan()) == (1, 1)

    def test_what_one_map_does_not_show_is_left_out(self):
        part = scan()
        part.states[:, 200:] = UNKNOWN
        assert fit(part, scan()).covered > 0.98
        assert fit(scan(), part).covered > 0.98


class TestCompared:
    """Two maps of 3 x 3 cells with 4 x 4 squares each."""

    def grid(self, **areas):
        states = np.full((12, 12), FREE, dtype=np.int8)
        for state, (rows, columns) in areas.items():
            states[rows, columns] = {"wall": OCCUPIED, "unknown": UNKNOWN}[state]
        return states

    def test_walls_that_came_and_went(self):
        first, second = self.grid(wall=(slice(0, 4), slice(0, 4))), self.grid(wall=(slice(8, 12), slice(8, 12)))
        pair = compared(first, second, 3, 0.5, 1.0)
        assert np.argwhere(pair.wall_now).tolist() == [[2, 2]]
        assert np.argwhere(pair.free_now).tolist() == [[0, 0]]
        assert pair.areas == {"wall_now": 0.25, "free_now": 0.25, "on_one_map": 0}

    def test_what_is_unknown_on_either_has_not_changed(self):
        wall = self.grid(wall=(slice(0, 4), slice(0, 4)))
        unknown = self.grid(unknown=(slice(0, 6), slice(0, 6)))
        for pair in (compared(wall, unknown, 3, 1, 1.0), compared(unknown, wall, 3, 1, 1.0)):
            assert not pair.wall_now.any()
            assert not pair.free_now.any()
            assert np.argwhere(pair.on_one_map).tolist() == [[0, 1], [1, 0], [1, 1]]

    @given(st.integers(-2, 2), st.integers(-2, 2), st.integers(0, 99))
    def test_half_a_cell_of_error_is_no_change(self, down, right, seed):
        walls = np.random.default_rng(seed).random((10, 10)) < 0.3
        squares = np.pad(walls, 2).repeat(4, 0).repeat(4, 1)
        right = right if down == 0 else 0  # along one axis, for the distance is that in a straight line
        states = [
            np.where(each, OCCUPIED, FREE).astype(np.int8)
            for each in (squares, np.roll(squares, (down, right), (0, 1)))
        ]
        assert compared(*states, 14, 0.4, 1.0).areas == {"wall_now": 0, "free_now": 0, "on_one_map": 0}

    def test_a_picture_has_a_colour_for_each_difference(self):
        walls = np.pad(np.zeros((7, 7), bool), 1, constant_values=True)
        older = walls.copy()
        older[4, 4] = True
        image = draw_pair(pair_of_walls(older, walls, 1.0), Maze(walls))
        picture = image[: image.shape[1]]  # without the legend
        greens = np.argwhere((picture == (64, 161, 99)).all(axis=2))
        assert (greens.min(axis=0) * 9 // len(picture)).tolist() == [4, 4]
        assert not (picture == (214, 61, 61)).all(axis=2).any()


class TestPairsOfFiles:
    def write(self, folder, name, grid):
        shades = np.select([grid.states == OCCUPIED, grid.states == UNKNOWN], [0, 205], 254).astype(np.uint8)
        cv2.imwrite(str(folder / f"{name}.png"), shades)
        metadata = {"image": f"{name}.png", "resolution": grid.resolution, "origin": list(grid.origin), "negate": 0}
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(metadata | {"occupied_thresh": 0.65, "free_thresh": 0.196}))
        return folder / f"{name}.yaml"

    def test_a_turned_map_is_refused_by_origin_and_taken_aligned(self, tmp_path, command):
        new = self.write(tmp_path, "new", scan())
        old = self.write(tmp_path, "old", redrawn(scan(), (12.0, -9.0, 0.7)))
        with pytest.raises(InputError, match="if it is turned or moved, try --align"):
            Task.of("building", mazes=new, shown=old)
        run = "eval", "--agent", "oracle", "--track", "building", "--mazes", new, "--shown", old, "--align"
        few = "--distances", "8", "--episodes-per-distance", "1", "--cell-size", "0.5"
        status, _, errors = command(*run, *few, "--out", tmp_path / "run")
        assert status == 0, errors
        assert "turned by 40.1" in errors
        summary = json.loads((tmp_path / "run" / "summary.json").read_text())
        assert summary["task"]["align"] is True
        assert summary["pairs"]["new"]["pose"] == pytest.approx([12, -9, 0.7], abs=0.02)
        assert summary["pairs"]["new"]["wall_now"] < 2
        assert cv2.imread(str(tmp_path / "run" / "pair.png")) is not None
        assert load_result(tmp_path / "run").summary.pairs["new"].covered > 0.95

    def test_the_maze_has_its_place_in_the_frame_of_the_older_map(self, tmp_path):
        new = self.write(tmp_path, "new", scan(origin=(1.0, 2.0, 0.0)))
        pose = 12.0, -9.0, 0.7
        old = self.write(tmp_path, "old", redrawn(scan(origin=(1.0, 2.0, 0.0)), pose))
        options = {"mazes": new, "cell_size": 0.5, "distances": 5}
        [aligned] = Task.of("building", **options, shown=old, align=True).arena.shown
        [alike] = Task.of("building", **options, shown=new).arena.shown
        assert alike.origin == read_located(new, cell_size=0.5).origin
        back = moved(dataclasses.replace(scan(), origin=aligned.origin), pose).origin
        assert back == pytest.approx(alike.origin, abs=0.05)

    def test_an_origin_that_is_five_centimetres_off_changes_nothing(self, tmp_path, remarks):
        new = self.write(tmp_path, "new", scan())
        old = self.write(tmp_path, "old", dataclasses.replace(scan(), origin=(0.05, -0.05, 0.0)))
        Task.of("building", mazes=new, shown=old)
        assert "; 0 m2 are wall now, 0 m2 are free now, 0 m2 are on one map only" in remarks()[-1]

    def test_arrays_are_aligned_too(self):
        walls = generate("office", 41, np.random.default_rng(0)).walls
        task = Task.of("building", mazes=walls, shown=np.rot90(walls), align=True)
        assert (task.arena.shown[0].walls == walls).all()

    def test_align_needs_an_older_map(self):
        with pytest.raises(InputError, match="align: expected shown"):
            Task.of("building", align=True)
