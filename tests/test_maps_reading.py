"""Maps of real buildings: cells at any angle, along the walls, with the passages that the body fits through."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mazebench.maps.readers.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, states_in_cells

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
