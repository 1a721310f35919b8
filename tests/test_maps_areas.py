"""Which part of a grid becomes the maze, where its cells lie, and what is said of it."""

from __future__ import annotations

import numpy as np
import pytest

from mazebench.errors import InputError
from mazebench.maps.maze import MazeError
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.readers.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, locate_maze


def grid_of(text: str, pixels: int = 1, **values) -> OccupancyGrid:
    states = {"#": OCCUPIED, ".": FREE, "?": UNKNOWN}
    cells = np.array([[states[letter] for letter in row] for row in text.split()], dtype=np.int8)
    return OccupancyGrid(cells.repeat(pixels, axis=0).repeat(pixels, axis=1), **values)


# A room of 3 x 4 cells with a door to the grounds that a wall closes, and a smaller room.
GROUNDS = """
................
.######.####....
.#....#.#..#....
.#....#.#..#....
.#....#.####....
.######.........
................
"""
TWO_WINGS = "########## #....#...# #....#...# #....#...# ##########"


class TestArea:
    def test_a_room_is_preferred_to_the_ground_around_it_and_all_are_listed(self, remarks):
        maze, origin = locate_maze(grid_of(GROUNDS), ReadOptions(), "map")
        assert len(maze.free_cells) == 12
        assert maze.is_free((2, 2))
        assert origin[:2] == (0, 7 - 16)
        line = remarks()[0]
        assert (
            "3 separate areas (66 m2 with cell 1,1, at 100 % of the edge; 12 m2 with cell 2,2, enclosed; 4 m2" in line
        )
        assert "; number 2 is the maze, --area chooses by a cell; " in line

    def test_a_building_whose_door_reaches_the_edge_is_no_ground(self):
        maze, _ = locate_maze(grid_of("........ #####... #...#... #...#... ....#... #####..."), ReadOptions(), "map")
        assert len(maze.free_cells) == 10

    @pytest.mark.parametrize(("area", "num_free"), [("1,1", 12), ("1,6", 9), ("6.5m,8.5m", 9), (None, 12)])
    def test_a_cell_or_a_point_chooses(self, area, num_free):
        assert len(locate_maze(grid_of(TWO_WINGS), ReadOptions(area=area), "map").maze.free_cells) == num_free

    def test_the_listed_cell_chooses_an_area_though_its_border_is_added(self, remarks):
        locate_maze(grid_of(GROUNDS), ReadOptions(), "map")
        assert "66 m2 with cell 1,1" in remarks()[0]
        assert len(locate_maze(grid_of(GROUNDS), ReadOptions(area="1,1"), "map").maze.free_cells) == 66

    @pytest.mark.parametrize("shape", [(3, 60_000), (200_000, 1), (1, 5_000_000)])
    def test_a_thin_grid_is_refused_before_it_is_made_square(self, shape):
        with pytest.raises(MazeError, match=f"at most 1024 cells a side, found {max(shape) + 2} of 1 m; save it as"):
            locate_maze(OccupancyGrid(np.full(shape, FREE, np.int8), is_cells=True), ReadOptions(), "map")

    def test_an_area_too_large_for_a_maze_is_only_listed(self, remarks):
        states = np.full((41, 2000), OCCUPIED, np.int8)
        states[1:30, 1:30] = states[-1] = FREE  # a room, and a hall of more cells
        maze, _ = locate_maze(OccupancyGrid(states, is_cells=True), ReadOptions(area="1,1"), "map")
        assert len(maze.free_cells) == 29 * 29

    def test_a_place_in_no_area_is_said(self, remarks):
        locate_maze(grid_of(TWO_WINGS), ReadOptions(area="0,0"), "map")
        assert "; none has 0,0; " in remarks()[0]
        with pytest.raises(InputError, match=r"expected area as a cell 'row,column' or a point .*, found 'here'"):
            locate_maze(grid_of(TWO_WINGS), ReadOptions(area="here"), "map")

    def test_ground_outside_of_an_open_door_is_said_and_a_place_inside_cuts_it_off(self, remarks):
        states = np.full((300, 400), FREE, dtype=np.int8)
        states[100:200, 100:300] = OCCUPIED
        states[104:196, 104:296] = FREE
        states[196:200, 200:220] = FREE  # a door of 1 m
        grid = OccupancyGrid(states, 0.05)
        maze, _ = locate_maze(grid, ReadOptions(), "map")
        assert len(maze.free_cells) > 37 * 50 - 13 * 26
        (line,) = remarks()
        inside, said = line.split(" leaves it out")[0].split("--area ")[1], "85 % of the maze lies outside of the walls"
        assert said in line
        maze, _ = locate_maze(grid, ReadOptions(area=inside), "map")
        assert 11 * 23 <= len(maze.free_cells) <= 12 * 24


class TestCells:
    def test_they_begin_where_they_keep_the_most_floor(self):
        states = np.full((24, 44), OCCUPIED, dtype=np.int8)
        states[3:21, 3:41] = FREE  # 1.8 m x 3.8 m: cells from the corner on would keep 1.5 m x 3.5 m
        maze, (x, y, _) = locate_maze(OccupancyGrid(states, 0.1), ReadOptions(cell_size=0.6), "map")
        assert len(maze.free_cells) == 3 * 6
        points = maze.point(maze.free_cells) + np.array([x, y])
        assert points.min() - 0.3 >= 0.3 - 1e-9

    def test_what_may_keep_closed_regions_is_said(self, remarks):
        grid = grid_of(
            TWO_WINGS.replace("#....#...# #....#...# #....", "#....#...# #........# #...."), 8, resolution=0.1
        )
        locate_maze(grid, ReadOptions(inflate=0.45), "map")
        assert (
            remarks()[-1]
            == "map: not in the maze: 5.38 m2 at (6.0, 2.1) m, by a way 0.3 m wide; try a smaller --inflate"
        )

    def test_a_grid_without_a_free_cell_is_described(self):
        grid = grid_of("##### #.?.# #?.?# #.?.# #####", 2, resolution=0.1, shades="its shades are 0 to 254")
        message = (
            "map: expected a free cell of 0.4 m, found none; 64 % of the map is wall, 16 % unknown, 20 % free; "
            "its shades are 0 to 254"
        )
        with pytest.raises(MazeError) as caught:
            locate_maze(grid, ReadOptions(), "map")
        assert str(caught.value) == message
