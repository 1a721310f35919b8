"""Maps of real buildings: cells at any angle, along the walls, with the passages that the body fits through."""

import math

import cv2
import numpy as np
import pytest
import scipy
from hypothesis import given, settings
from hypothesis import strategies as st

from mazebench.maps.maze_files import read_located
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.readers.directions import turn_of_walls
from mazebench.maps.readers.narrow_ways import nodes_of, open_ways
from mazebench.maps.readers.occupancy_grid import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    OccupancyGrid,
    locate_maze,
    states_in_cells,
)
from mazebench.maps.readers.ros import write_ros_map

_RESOLUTION, _PIXELS, _RADIUS = 0.05, 8, 0.15  # m, a cell's pixels, m
_STATES = st.lists(st.sampled_from([FREE, FREE, OCCUPIED, UNKNOWN]), min_size=30, max_size=30)
_FLOATS = st.floats(-1, 1)


class TestStatesInCells:
    def test_cells_have_the_states_of_their_pixels(self):
        # Two cells of 2 x 2 pixels beside each other, one pixel in from the corner of the map.
        states = np.full((4, 6), FREE, dtype=np.int8)
        states[1, 1], states[2, 4], states[2, 3] = OCCUPIED, OCCUPIED, UNKNOWN
        grid = OccupancyGrid(states, 0.1, (5.0, 7.0, 0.0))
        assert states_in_cells(grid, (5.1, 7.1, 0.0), 0.2, (1, 2)).tolist() == [[OCCUPIED, OCCUPIED]]
        states[2, 4] = states[1, 1] = FREE
        assert states_in_cells(grid, (5.1, 7.1, 0.0), 0.2, (1, 2)).tolist() == [[FREE, UNKNOWN]]

    def test_a_quarter_turn_turns_the_cells(self):
        states = np.array([[FREE, OCCUPIED, UNKNOWN], [FREE, FREE, FREE]], dtype=np.int8)
        grid = OccupancyGrid(states, 1.0, (1.0, 1.0, 0.0))
        turned = states_in_cells(grid, (4.0, 1.0, math.pi / 2), 1.0, (3, 2))
        assert turned.tolist() == np.rot90(states, -1).tolist()

    def test_beyond_the_map_is_unknown(self):
        grid = OccupancyGrid(np.full((2, 2), FREE, dtype=np.int8), 1.0)
        assert states_in_cells(grid, (-1.0, -1.0, 0.0), 1.0, (3, 3)).tolist() == [[-1, 0, 0], [-1, 0, 0], [-1, -1, -1]]

    @given(_STATES, st.floats(-4, 4), _FLOATS, _FLOATS, st.floats(0.3, 3))
    def test_each_cell_has_the_worst_state_of_its_pixels(self, states, yaw, x, y, cell_size):
        grid = OccupancyGrid(np.array(states, dtype=np.int8).reshape(5, 6), 1.0, (0.5, -2.0, 0.3))
        laid = states_in_cells(grid, (x, y, yaw), cell_size, (4, 5))
        for row, column in np.ndindex(4, 5):
            found = set()
            centre = _in_map(grid, _on_frame((x, y, yaw), (column + 0.5) * cell_size, (3.5 - row) * cell_size))
            found.add(_state_at(grid, *centre))
            for pixel_row, pixel_column in np.ndindex(5 + 2, 6 + 2):  # with those around the map
                place = pixel_column - 0.5, 5 + 0.5 - pixel_row
                point = _to_frame((x, y, yaw), _on_frame(grid.origin, *place))
                if (
                    math.floor(point[0] / cell_size + 1e-6) == column
                    and math.floor(point[1] / cell_size + 1e-6) == 3 - row
                ):
                    found.add(_state_at(grid, *place))
            worst = next(state for state in (OCCUPIED, UNKNOWN, FREE) if state in found)
            assert laid[row, column] == worst


def _on_frame(origin, x, y):
    return (
        origin[0] + math.cos(origin[2]) * x - math.sin(origin[2]) * y,
        origin[1] + math.sin(origin[2]) * x + math.cos(origin[2]) * y,
    )


def _to_frame(origin, point):
    return _on_frame((0, 0, -origin[2]), point[0] - origin[0], point[1] - origin[1])


def _in_map(grid, point):
    return _to_frame(grid.origin, point)


def _state_at(grid, x, y):
    """Returns the state of the pixel of 1 m at a point of the map's own frame."""
    column, from_below = math.floor(x + 1e-6), math.floor(y + 1e-6)
    height, width = grid.states.shape
    is_inside = 0 <= column < width and 0 <= from_below < height
    return int(grid.states[height - 1 - from_below, column]) if is_inside else UNKNOWN


def _two_rooms(degrees: float, door: float = 0.8) -> OccupancyGrid:
    """Returns a building of 12 x 8 m with a wall across it and a door in that, turned about the map's frame."""
    picture = np.full((400, 400), UNKNOWN + 1, dtype=np.uint8)
    for low, high, shade in (
        ((-6.2, -4.2), (6.2, 4.2), OCCUPIED + 1),
        ((-6.0, -4.0), (-0.1, 4.0), FREE + 1),
        ((0.1, -4.0), (6.0, 4.0), FREE + 1),
        ((-0.2, 1.0), (0.2, 1.0 + door), FREE + 1),
    ):
        corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
        cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        right, up = np.array([[cosine, -sine], [sine, cosine]]) @ corners.T
        cv2.fillPoly(picture, [np.stack([200 + 20 * right, 200 - 20 * up], axis=1).round().astype(np.int32)], shade)
    return OccupancyGrid(picture.astype(np.int8) - np.int8(1), _RESOLUTION, (-10.0, -10.0, 0.0), frame="map")


class TestSlantedBuildings:
    @given(st.floats(-44, 44))
    @settings(max_examples=40)
    def test_the_direction_of_the_walls_is_found_unless_it_is_nearly_that_of_the_picture(self, degrees):
        grid = _two_rooms(degrees)
        turn = math.degrees(turn_of_walls(grid.states == FREE, grid.states == OCCUPIED, _RESOLUTION))
        if abs(degrees) < 2.5:
            assert turn == 0
        elif abs(degrees) > 3.5:
            assert turn == pytest.approx(degrees, abs=1.0)

    def test_round_walls_have_no_direction(self):
        rows, columns = np.mgrid[:200, :200] - 100
        distance = np.hypot(rows, columns)
        assert turn_of_walls(distance < 90, (distance >= 90) & (distance < 94), _RESOLUTION) == 0

    @given(st.floats(-44, 44), st.floats(0.45, 1.2))
    @settings(max_examples=40, deadline=None)
    def test_a_maze_lies_along_the_walls_and_has_both_rooms(self, degrees, door):
        grid = _two_rooms(degrees, door)
        maze, origin = locate_maze(grid, ReadOptions(), "map")
        assert len(maze.free_cells) * maze.cell_size**2 > 0.8 * 2 * 5.9 * 8
        assert math.degrees(origin[2]) == pytest.approx(degrees if origin[2] else 0, abs=3.1)
        # Points of the maze are those of the map.
        x, y = np.transpose([_on_frame(origin, *point) for point in maze.point(maze.free_cells)])
        states = grid.states[(400 - (y + 10) / 0.05).astype(int), ((x + 10) / 0.05).astype(int)]
        assert (states == FREE).mean() > 0.98

    def test_a_written_maze_is_read_in_its_place(self, tmp_path):
        maze, origin = locate_maze(_two_rooms(30), ReadOptions(), "map")
        write_ros_map(maze, tmp_path / "map.yaml", origin)
        read, place = read_located(tmp_path / "map.yaml")
        assert read == maze
        assert place == pytest.approx(origin)

    def test_ground_around_a_slanted_building_is_not_the_building(self):
        grid = _two_rooms(30, door=3)
        grid.states[grid.states == UNKNOWN] = FREE
        maze, _ = locate_maze(grid, ReadOptions(), "map")
        assert len(maze.free_cells) * maze.cell_size**2 < 2 * 6 * 8

    def test_pictures_of_cells_are_not_turned(self):
        slanted = np.abs(np.subtract(*np.mgrid[:40, :40])) < 3
        grid = OccupancyGrid(np.where(slanted, FREE, OCCUPIED).astype(np.int8), is_cells=True)
        assert locate_maze(grid, ReadOptions(), "map").origin[2] == 0


def _two_rooms_with_a_door(num_rows: int) -> np.ndarray:
    """The blocked pixels of two rooms, each 3 cells wide, and of a wall of a cell with a door between them."""
    blocked = np.ones((num_rows * _PIXELS, 9 * _PIXELS), dtype=bool)
    for left in (1, 5):
        blocked[_PIXELS:-_PIXELS, left * _PIXELS : (left + 3) * _PIXELS] = False
    blocked[20:29, 4 * _PIXELS : 5 * _PIXELS] = False
    return blocked


class TestNarrowWays:
    def test_the_fewest_cells_are_opened(self):
        # Two rooms of 3 x 5 cells, and between them a wall of a cell with a door half in one cell, half in the next.
        blocked = _two_rooms_with_a_door(7)
        walls, opened = _opened(blocked)
        assert np.argwhere(walls & ~opened).tolist() in ([[2, 4]], [[3, 4]])

    def test_a_way_that_a_thin_wall_divides_is_left_closed(self):
        # A passage of 0.4 m along the side of a room, in the same cells as the wall between them, to no place.
        blocked = _two_rooms_with_a_door(9)
        blocked[20:29, 36] = True
        walls, opened = _opened(blocked)
        assert (walls == opened).all()

    @given(st.data())
    @settings(max_examples=200, deadline=None)
    def test_only_what_the_body_connects_is_joined_and_at_cells_that_it_passes(self, data):
        blocked = np.zeros((12 * _PIXELS, 12 * _PIXELS), dtype=np.uint8)
        ends = st.integers(0, len(blocked) - 1)
        for _ in range(data.draw(st.integers(3, 9))):
            first, last = data.draw(st.tuples(ends, ends)), data.draw(st.tuples(ends, ends))
            cv2.line(blocked, first, last, 1, data.draw(st.integers(1, 4)))
        for _ in range(data.draw(st.integers(0, 6))):  # doors
            cv2.circle(blocked, data.draw(st.tuples(ends, ends)), data.draw(st.integers(3, 12)), 0, -1)
        blocked[[0, -1]] = blocked[:, [0, -1]] = 1
        walls, opened = _opened(blocked > 0)
        positions, cell_of = _positions(blocked > 0), _cell_of(walls.shape)
        component, _ = scipy.ndimage.label(positions)

        # No two areas are joined between which there is no way for the body.
        before, after = scipy.ndimage.label(~walls)[0], scipy.ndimage.label(~opened)[0]
        assert not (opened & ~walls).any()
        for area in range(1, after.max() + 1):
            if len(np.unique(before[(after == area) & ~walls])) > 1:
                of_cells = [set(component[positions & (cell_of == cell)]) for cell in np.flatnonzero(after == area)]
                assert set.intersection(*of_cells)

        # The body passes through each opened cell, and near it to each open one beside it.
        for row, column in np.argwhere(walls & ~opened):
            box = slice(max(0, row - 2), row + 3), slice(max(0, column - 2), column + 3)
            pixels = tuple(slice(each.start * _PIXELS, each.stop * _PIXELS) for each in box)
            near, cells = scipy.ndimage.label(positions[pixels])[0], cell_of[pixels]
            here = set(near[cells == row * 12 + column]) - {0}
            assert here
            for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                beside = row + down, column + right
                if not np.pad(opened, 1, constant_values=True)[beside[0] + 1, beside[1] + 1]:
                    assert here & set(near[cells == beside[0] * 12 + beside[1]])


def _positions(blocked):
    distance = cv2.distanceTransform((~blocked).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return distance > _RADIUS / _RESOLUTION


def _cell_of(shape):
    return np.arange(shape[0] * shape[1]).reshape(shape).repeat(_PIXELS, axis=0).repeat(_PIXELS, axis=1)


def _opened(blocked):
    """Returns the walls of cells before and after ways are opened from their largest area."""
    walls = blocked.reshape(len(blocked) // _PIXELS, _PIXELS, -1, _PIXELS).any(axis=(1, 3))
    areas, _ = scipy.ndimage.label(~walls)
    area = areas == 1 + np.argmax(np.bincount(areas[~walls], minlength=2)[1:])
    nodes = nodes_of(_positions(blocked), _cell_of(walls.shape), walls.shape, _RESOLUTION)
    return walls, open_ways(walls, area & ~walls, np.zeros_like(walls), nodes, 1.0)
