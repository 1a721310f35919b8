"""Maps of ROS: map_server's rules worked by hand, the place of a maze in its map, and the way back.

http://wiki.ros.org/map_server documents the rules; the bounds are those of nav2_map_server since 1.4.0.
"""

from __future__ import annotations

import math
import pathlib

import cv2
import hypothesis
import numpy as np
import pytest
import yaml
from hypothesis import strategies as st

import mazebench
from mazebench.errors import InputError
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze, MazeError, cell_to_point
from mazebench.maps.maze_files import read_located, read_maze, read_mazes
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.pictures import draw_maze, write_image
from mazebench.maps.readers.ros import read_occupancy, write_ros_map
from mazebench.maps.text import parse_maze, write_text_maze
from mazebench.world.formats import make_mazes, write_maze

METADATA = {
    "image": "map.pgm",
    "resolution": 1.0,
    "origin": [0.0, 0.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def write_map(folder: pathlib.Path, picture: np.ndarray, **metadata) -> pathlib.Path:
    """Writes a map and returns the path of its YAML file."""
    metadata = METADATA | metadata
    cv2.imwrite(str(folder / metadata["image"]), picture)
    (folder / "map.yaml").write_text(yaml.safe_dump(metadata))
    return folder / "map.yaml"


def drawn(text: str, pixels: int = 1) -> np.ndarray:
    """A picture of rows of `#` (black), `.` (white) and `?` (the gray of what is unknown)."""
    shades = {"#": 0, ".": 254, "?": 205}
    rows = [[shades[letter] for letter in row] for row in text.split()]
    return np.array(rows, dtype=np.uint8).repeat(pixels, axis=0).repeat(pixels, axis=1)


class TestThresholds:
    @pytest.mark.parametrize(
        ("shade", "state"),
        # Occupied with probability (255 - shade) / 255 above 0.65: at most 89 (0.651), not 90 (0.647). Free below
        # 0.196: at least 206 (0.192), not 205 (0.1961), which map_saver writes for unknown.
        [(0, 100), (89, 100), (90, -1), (205, -1), (206, 0), (254, 0), (255, 0)],
    )
    def test_shades_as_worked_by_hand(self, shade, state, tmp_path):
        path = write_map(tmp_path, np.full((5, 5), shade, np.uint8))
        assert (read_occupancy(path).states == state).all()

    @pytest.mark.parametrize(
        ("mode", "metadata", "states"),
        [
            ("trinary", {"negate": 1}, {0: 0, 49: 0, 50: -1, 165: -1, 166: 100, 255: 100}),
            ("trinary", {"occupied_thresh": 1.0, "free_thresh": 0.0}, {0: 100, 1: -1, 254: -1, 255: 0}),
            # Per cent between the thresholds, rounded: within half a per cent of a threshold, it is reached.
            ("scale", {"occupied_thresh": 0.9, "free_thresh": 0.1}, {26: 100, 27: -1, 228: -1, 229: 0}),
            # Shades are percentages: occupied from 65, free to 19; above 100 is unknown.
            ("raw", {}, {0: 0, 19: 0, 20: -1, 64: -1, 65: 100, 100: 100, 101: -1, 255: -1}),
        ],
    )
    def test_shades_of_other_modes_and_thresholds_as_worked_by_hand(self, mode, metadata, states, tmp_path):
        path = write_map(tmp_path, np.array([list(states)], np.uint8), mode=mode, **metadata)
        assert read_occupancy(path).states.ravel().tolist() == list(states.values())

    @pytest.mark.parametrize("mode", ["trinary", "scale"])
    def test_colours_count_by_their_luminance_and_what_is_not_opaque_is_unknown(self, mode, tmp_path):
        picture = np.zeros((5, 5, 4), dtype=np.uint8)
        picture[:] = (80, 80, 80, 255)  # occupied with 0.69; with the opacity as a fourth shade, 0.51
        picture[0] = (255, 255, 255, 254)
        picture[1] = (0, 0, 255, 255)  # red in OpenCV's order: a luminance of 76, occupied with 0.70
        picture[2] = (0, 255, 255, 255)  # yellow: a luminance of 226, free
        path = write_map(tmp_path, picture, image="map.png", mode=mode)
        assert read_occupancy(path).states[:, 0].tolist() == [-1, 100, 0, 100, 100]


@pytest.mark.parametrize(
    "image", ["file://{folder}/map.pgm", "package://maps/map.pgm", "/home/ann/maps/map.pgm", "C:\\maps\\map.pgm"]
)
def test_a_picture_beside_is_taken_for_one_that_is_not_there(image, tmp_path, remarks):
    path = write_map(tmp_path, drawn("##### #...# #...# #...# #####"))
    path.write_text(path.read_text().replace("map.pgm", image.format(folder=tmp_path)))
    assert read_maze(path).size == 5
    assert [line.partition(";")[0] for line in remarks()] == (
        [] if "{" in image else [f"map: image {image} taken from {tmp_path}"]
    )


BUILDING = "??????? ?#####? ?#...#? ?#.?.#? ?#...#? ?#####? ???????"


def test_a_yaw_that_is_no_number_and_a_map_without_walls_get_a_line(tmp_path, remarks):
    picture = drawn(BUILDING)
    picture[picture == 0] = 205
    path = write_map(tmp_path, picture, origin=[0.0, 0.0, float("nan")])
    assert read_located(path).origin[2] == 0.0
    assert remarks()[0].startswith("map: yaw nan read as 0; nothing on it is wall; ")


@pytest.mark.parametrize("white", [100, 1000])
def test_a_binary_pgm_is_scaled_by_its_largest_number(tmp_path, white):
    numbers = (drawn(BUILDING) / 255 * white).round().astype(np.uint8 if white < 256 else ">u2")
    path = write_map(tmp_path, drawn(BUILDING))
    expected = read_occupancy(path).states
    head = f"P5\n# scaled\n{numbers.shape[1]} {numbers.shape[0]}\n{white}\n"
    (tmp_path / METADATA["image"]).write_bytes(head.encode() + numbers.tobytes())
    np.testing.assert_array_equal(read_occupancy(path).states, expected)


class TestMapSaver:
    """map_saver of ROS 2 wrote `free_thresh: 0.25`, with which map_server takes its own shade for unknown as free."""

    @pytest.mark.parametrize(
        "picture",
        [
            drawn(BUILDING),
            cv2.cvtColor(drawn(BUILDING), cv2.COLOR_GRAY2BGR),
            cv2.cvtColor(drawn(BUILDING), cv2.COLOR_GRAY2BGRA),  # as map_saver writes a PNG
        ],
        ids=["gray", "colour", "opacity"],
    )
    def test_its_unknown_is_read_as_unknown_whatever_the_threshold(self, picture, tmp_path, remarks):
        path = write_map(tmp_path, picture, image="map.png", free_thresh=0.25)
        assert (read_occupancy(path).states == -1).sum() == 25
        assert read_maze(path) == parse_maze("#####\n#...#\n#.#.#\n#...#\n#####")
        assert remarks()[0].startswith("map: shade 205 read as unknown, as map_saver means it, though free_thresh 0.25")


def test_the_shade_of_unknown_is_read_so_in_a_retouched_map_but_not_where_it_is_rare(tmp_path, remarks):
    picture = drawn("???????? ??####?? ??#..#?? ??#..#?? ??####?? ????????", pixels=4)
    picture[10, 10:13] = 255, 90, 128  # of an eraser and of soft lines
    path = write_map(tmp_path, picture, free_thresh=0.25)
    assert (read_occupancy(path).states == -1).sum() == (48 - 16) * 16 + 2
    rare = np.full((20, 20), 254, dtype=np.uint8)
    rare[0], rare[1], rare[2, :4] = 0, 255, 205
    assert (read_occupancy(write_map(tmp_path, rare, free_thresh=0.25)).states == -1).sum() == 0


SURROUNDED = "????????? ??#####?? ??#...#?? ??#.?.#?? ??#...#?? ??#####?? ?????????"


class TestMaze:
    @pytest.mark.parametrize(
        ("rows", "metadata", "options", "maze", "origin"),
        [
            ("##### #...# ###.# #...# #####", {}, {}, "##### #...# ###.# #...# #####", (0, 0)),
            # A column and a row of wall are added on the left and above, two rows below.
            (
                "...#. ...#. ####.",
                {"origin": [-3.0, 2.0, 0.0]},
                {},
                "###### #...## #...## ###### ###### ######",
                (-4, 0),
            ),
            # Unknown surroundings are cut off; inside, unknown cells are wall or free.
            (SURROUNDED, {}, {}, "##### #...# #.#.# #...# #####", (2, 1)),
            (SURROUNDED, {}, {"unknown": "free"}, "##### #...# #...# #...# #####", (2, 1)),
            # Around the building they are wall in any case.
            (
                "##### #...# #.?.# #...# ##### ???#?",
                {},
                {"unknown": "free"},
                "###### #...## #...## #...## ###### ######",
                (0, 0),
            ),
        ],
    )
    def test_rows_of_pixels_become_a_maze_with_a_closed_border(self, rows, metadata, options, maze, origin, tmp_path):
        path = write_map(tmp_path, drawn(rows), resolution=1.0, **metadata)
        read = read_located(path, **options)
        assert read.maze == parse_maze(maze.replace(" ", "\n"))
        assert read.origin == (*origin, 0.0)

    def test_pixels_are_coarsened_to_cells_that_are_wall_if_one_pixel_is(self, tmp_path, remarks):
        picture = drawn("##### #...# #...# #...# #####", pixels=8)
        picture[8, 31] = 0  # in the corner of cell (1, 3)
        path = write_map(tmp_path, picture, resolution=0.05, origin=[1.0, 1.0, 0.0])
        expected = parse_maze("#####\n#..##\n#...#\n#...#\n#####").walls
        assert read_maze(path) == Maze(expected, cell_size=0.4)
        assert remarks() == [
            "map: 40 x 40 pixels of 0.05 m as cells of 0.4 m; "
            "the maze's lower left corner is (1, 1) m on the map, so its point (x, y) is (x - 1, y - 1) m in the maze",
        ]
        assert read_maze(path, cell_size=0.5).size == 5

    @pytest.mark.parametrize(("cell_size", "nearest"), [(0.07, "0.4"), (0.33, "0.4"), (0.2, "0.4"), (0.52, "0.5")])
    def test_a_size_of_cells_that_cannot_be_made_is_answered_with_one_that_can(self, cell_size, nearest, tmp_path):
        path = write_map(tmp_path, drawn("##### #...# #...# #...# #####", pixels=10), resolution=0.05)
        with pytest.raises(InputError, match=rf"of pixels of 0\.05 m, such as {nearest}, found {cell_size}"):
            read_maze(path, cell_size=cell_size)
        assert read_maze(path, cell_size=float(nearest)).cell_size == float(nearest)

    def test_a_door_that_no_cell_fits_into_is_opened_and_this_is_said(self, tmp_path, remarks):
        picture = drawn("########### #....#....# #....#....# #....#....# #....#....# ###########", pixels=10)
        picture[20:29, 50:60] = 254  # a door of 0.9 m, which is no whole cell of 0.5 m wide
        path = write_map(tmp_path, picture, resolution=0.05)
        assert len(read_maze(path, cell_size=0.5).free_cells) == 16 + 16 + 1
        (line,) = remarks()
        assert "; 1 cell opened where a body 0.3 m wide passes on the map; 6 x 11" in line

    def test_rooms_that_are_lost_are_named_with_their_place_and_the_width_of_the_way(self, tmp_path, remarks):
        picture = drawn("######### #...#...# #...#...# #...#...# #########", pixels=20)
        picture[40:43, 80:100] = 254  # 0.15 m wide
        read_maze(write_map(tmp_path, picture, resolution=0.05, origin=[5.0, 5.0, 0.0]))
        assert remarks()[-1] == "map: not in the maze: 7.3 m2 at (11.5, 7.5) m, by a way 0.15 m wide"

    def test_walls_are_inflated_by_metres(self, tmp_path):
        picture = np.full((9, 9), 254, np.uint8)
        picture[[0, -1]] = picture[:, [0, -1]] = picture[4, 4] = 0
        path = write_map(tmp_path, picture, resolution=0.4)
        walls = read_maze(path, inflate=0.6).walls  # the centres of diagonal neighbours are 0.566 m away
        assert walls[3:6, 3:6].all()
        assert walls[1, 1:-1].all()
        assert not walls[2, 2:7].any()
        assert read_maze(path, inflate=0.4).walls[3:6, 3:6].sum() == 5

    def test_a_large_map_gets_larger_cells_unless_their_size_is_given(self, tmp_path):
        picture = np.full((600, 300), 254, np.uint8)
        picture[[0, -1]] = picture[:, [0, -1]] = 0
        path = write_map(tmp_path, picture, resolution=0.5)
        assert (read_maze(path).size, read_maze(path).cell_size) == (200, 1.5)
        assert read_maze(path, cell_size=0.5).size == 600
        picture = cv2.resize(picture, (600, 1200), interpolation=cv2.INTER_NEAREST)
        path = write_map(tmp_path, picture, resolution=0.5)
        with pytest.raises(MazeError, match=r"at most 1024 cells a side, found 1198 of 0\.5 m; give a larger"):
            read_maze(path, cell_size=0.5)


class TestFrame:
    @hypothesis.given(
        st.integers(0, 2**32 - 1), st.sampled_from([0.05, 0.1, 1.0]), st.floats(-3, 3), st.sampled_from([None, 2.0])
    )
    @hypothesis.settings(max_examples=30, deadline=None)
    def test_a_free_cell_lies_where_its_pixels_lie(self, tmp_path_factory, seed, resolution, yaw, cell_size):
        rng = np.random.default_rng(seed)
        picture = np.full(rng.integers(40, 90, size=2), 205, np.uint8)
        top, left = rng.integers(0, 20, size=2)
        known = picture[top : top + 40, left : left + 40]
        known[rng.random(known.shape) < 0.9] = 254
        picture = cv2.medianBlur(picture, 3)
        origin = [*rng.uniform(-50, 50, size=2).tolist(), yaw]
        path = write_map(tmp_path_factory.mktemp("ros"), picture, resolution=resolution, origin=origin)
        try:
            maze, (x0, y0, read_yaw) = read_located(path, cell_size=cell_size)
        except MazeError:  # nothing is left at this size of cells
            return
        points = cell_to_point(maze.free_cells, maze.size) * maze.cell_size
        x = x0 + points[:, 0] * math.cos(read_yaw) - points[:, 1] * math.sin(read_yaw)
        y = y0 + points[:, 0] * math.sin(read_yaw) + points[:, 1] * math.cos(read_yaw)
        # Back to pixels by the definition of the origin: the pose of the lower left corner of the picture.
        grid = read_occupancy(path)
        dx, dy = x - grid.origin[0], y - grid.origin[1]
        columns = np.floor((dx * math.cos(yaw) + dy * math.sin(yaw)) / resolution + 1e-6).astype(int)
        rows = len(picture) - 1 - np.floor((dy * math.cos(yaw) - dx * math.sin(yaw)) / resolution + 1e-6).astype(int)
        assert (picture[rows, columns] == 254).all()


class TestRoundTrip:
    def test_the_command_keeps_the_frame(self, tmp_path):
        source = write_map(tmp_path, drawn(BUILDING), origin=[-7.35, -4.2, 0.0])
        located = next(make_mazes(None, 1, 0, "dfs", source, ReadOptions()))
        write_maze(located, tmp_path / "out", ["ros"])
        assert yaml.safe_load((tmp_path / "out" / "map.yaml").read_text())["origin"] == [-6.35, -3.2, 0.0]


def two_rooms(margin: int = 0) -> np.ndarray:
    """A floor plan of 4 x 2.4 m with 50 pixels a metre: walls of 4 pixels and a door of 0.9 m between two rooms."""
    plan = np.full((120, 200), 255, np.uint8)
    plan[[*range(4), *range(-4, 0)]] = plan[:, [*range(4), *range(-4, 0)]] = 0
    plan[:, 100:104] = 0
    plan[40:85, 100:104] = 255
    return np.pad(plan, margin, constant_values=255)


class TestFloorPlan:
    EXPECTED = "#{}#\n#....#....#\n#....#....#\n#.........#\n#....#....#\n#....#....#\n{}".format(
        "#" * 9, 5 * f"{'#' * 11}\n"
    )

    def write(self, folder, plan, name="plan.png"):
        cv2.imwrite(str(folder / name), plan)
        return folder / name

    def test_a_plan_is_read_as_a_map_of_ros_with_such_pixels(self, tmp_path, remarks):
        maze = read_maze(self.write(tmp_path, two_rooms()), pixel_size=0.02)
        assert maze == Maze(parse_maze(self.EXPECTED).walls, cell_size=0.4)
        assert remarks() == [
            "plan: 200 x 120 pixels of 0.02 m as cells of 0.4 m; wall added along its border; "
            "7 x 11 cells padded with wall to 11 x 11; the maze's lower left corner is (-0.28, -1.72) m on the map, "
            "so its point (x, y) is (x + 0.28, y + 1.72) m in the maze",
        ]
        assert maze == read_maze(write_map(tmp_path, two_rooms(), resolution=0.02))
        assert read_maze(tmp_path / "plan.png", pixel_size=0.02, cell_size=0.8).size == 6

    def test_the_paper_around_a_plan_is_cut_off(self, tmp_path):
        path = self.write(tmp_path, two_rooms(margin=33))
        located = read_located(path, pixel_size=0.02)
        assert located.maze == read_maze(self.write(tmp_path, two_rooms(), "cut.png"), pixel_size=0.02)
        assert located.origin == pytest.approx((0.66 - 0.28, 0.66 - 1.72, 0.0))

    def test_the_ground_beside_a_building_of_another_shape_is_no_floor(self, tmp_path):
        plan = np.full((500, 500), 255, np.uint8)
        corners = np.array([[20, 20], [220, 20], [220, 220], [420, 220], [420, 420], [20, 420]])
        cv2.polylines(plan, [corners], True, 0, 5)
        plan[480:484, 480:484] = 0  # a speck
        maze = read_maze(self.write(tmp_path, plan), pixel_size=0.02)
        assert maze.is_free((15, 3))
        assert maze.is_free((15, 15))
        assert not maze.is_free((3, 15))
        assert maze.size == 21

    @pytest.mark.parametrize("margin", [0, 36])
    @pytest.mark.parametrize("kind", ["house", "dfs"])
    def test_a_plan_with_soft_edges_has_the_walls_of_its_maze(self, kind, margin, tmp_path):
        walls = generate(kind, 21, np.random.default_rng(0)).walls
        paper = np.pad(
            np.where(walls, 0, 255).astype(np.uint8).repeat(18, 0).repeat(18, 1), margin, constant_values=255
        )
        plans = [cv2.GaussianBlur(paper, (0, 0), sigma) for sigma in (0.5, 0.8, 1.0, 1.2)]
        halved = cv2.resize(paper, None, fx=1 / 9, fy=1 / 9, interpolation=cv2.INTER_AREA)
        plans += [
            cv2.resize(halved, None, fx=9, fy=9, interpolation=how) for how in (cv2.INTER_CUBIC, cv2.INTER_LINEAR)
        ]
        for plan in plans:
            maze = read_maze(self.write(tmp_path, plan), pixel_size=0.03, cell_size=0.54)
            np.testing.assert_array_equal(maze.walls, walls)

    def test_thin_lines_of_a_blurred_plan_stay_closed(self, tmp_path):
        plan = two_rooms()
        plan[40:85, 101:103] = 0  # the door, closed by a line of 2 pixels
        maze = read_maze(self.write(tmp_path, cv2.GaussianBlur(plan, (0, 0), 1.0)), pixel_size=0.02)
        assert maze.walls[:, 5].all()

    def test_marks_in_colour_are_floor_and_gray_is_unknown(self, tmp_path):
        plan = cv2.cvtColor(two_rooms(), cv2.COLOR_GRAY2BGR)
        plan[45:55, 45:55] = (0, 0, 255)
        path = self.write(tmp_path, plan)
        assert read_maze(path, pixel_size=0.02) == Maze(parse_maze(self.EXPECTED).walls, cell_size=0.4)
        plan[45:55, 45:55] = 128
        path = self.write(tmp_path, plan)
        assert read_maze(path, pixel_size=0.02).walls[2, 2]
        assert not read_maze(path, pixel_size=0.02, unknown="free").walls[2, 2]

    def test_a_plan_without_a_pixel_size_is_answered_with_its_width(self, tmp_path, remarks):
        walls = np.zeros((90, 120), dtype=bool)
        walls[[0, -1]] = walls[:, [0, -1]] = walls[40, 3:] = True
        path = self.write(tmp_path, np.where(walls, 0, 255).astype(np.uint8))
        width = "plan: read as 120 m wide and 90 m high, with a cell of 1 m for the width of a wall; if it is"
        read_maze(path)
        assert any(line.startswith(width) for line in remarks())
        read_maze(path, cell_size=0.5)
        assert not any("read as" in line for line in remarks())
        write_image(draw_maze(generate("dfs", 121, np.random.default_rng(0)), 4), tmp_path / "dfs.png")
        read_maze(tmp_path / "dfs.png")
        assert remarks() == []


class TestRefusal:
    @pytest.mark.parametrize(
        ("content", "message"),
        [
            ("", "expected the YAML file of a ROS map, with keys such as image and resolution, found an empty file"),
            ("hello", "with keys such as image and resolution, found no keys but 'hello'"),
            ("image: map.pgm", "with resolution (the side of a pixel, 0.001 to 100 m), found only image"),
            *(
                (yaml.safe_dump(METADATA | {"resolution": side}), f"pixel, 0.001 to 100 m), found {side}")
                for side in (0, -1.0, 1e-300, 1e-4, 101.0, 1e300, float("inf"), float("nan"))
            ),
            (yaml.safe_dump(METADATA | {"origin": [0, 0]}), "origin (three finite numbers, [x, y, yaw]), found [0, 0]"),
            (yaml.safe_dump(METADATA | {"origin": [0.0, float("inf"), 0.0]}), "found [0.0, inf, 0.0]"),
            (yaml.safe_dump(METADATA | {"occupied_thresh": 65}), "occupied_thresh (a number from 0 to 1), found 65"),
            (yaml.safe_dump(METADATA | {"free_thresh": 0.9}), "(a number from 0 to occupied_thresh), found 0.9"),
            ("a: &a [x, x]\nb: [*a, *a]\n", "found an alias, which no such file needs"),
            ("[" * 3000, "expected the YAML file of a ROS map, found maximum recursion depth"),
            (f"image: a.pgm\nresolution: 0x{'f' * 9000}\n", "found a number of too many digits"),
            (yaml.safe_dump(METADATA | {"image": "a\0b.pgm"}), "with image (the name of a picture), found 'a"),
            (yaml.safe_dump(METADATA | {"image": "~nobody-here/a.pgm"}), "~nobody-here/a.pgm: can't read the picture"),
            (yaml.safe_dump(METADATA), "map.yaml: {folder}/map.pgm: can't read the picture: No such file"),
        ],
    )
    def test_a_damaged_map_is_named_in_one_line(self, content, message, tmp_path):
        (tmp_path / "map.yaml").write_text(content)
        with pytest.raises(InputError) as caught:
            read_maze(tmp_path / "map.yaml")
        assert message.replace("{folder}", str(tmp_path)) in str(caught.value)

    def test_a_cell_larger_than_the_map_takes_no_memory(self, tmp_path):
        path = write_map(tmp_path, drawn("##### #...# #...# #...# #####"), resolution=0.001)
        with pytest.raises(MazeError, match="expected a free cell of 100 m, found none"):
            read_maze(path, cell_size=100)

    def test_a_picture_in_a_folder_is_no_maze_of_its_own_however_it_is_named(self, tmp_path, monkeypatch):
        path = write_map(tmp_path, drawn("##### #...# #...# #...# #####"), image="plan.png")
        path.write_text(path.read_text().replace("plan.png", str(tmp_path / "plan.png")))
        monkeypatch.chdir(tmp_path.parent)
        assert [maze.name for maze in read_mazes(tmp_path.name)] == ["map"]

    def test_the_picture_alone_is_answered_with_the_file_to_give(self, tmp_path):
        path = write_map(tmp_path, drawn("##### #...# #...# #...# #####"))
        with pytest.raises(
            InputError, match=r"map\.pgm: expected a maze, found the picture of a ROS map; give .*map\.yaml"
        ):
            read_maze(tmp_path / "map.pgm")
        path.write_text("a: 1")  # another file that has the name by chance
        assert read_maze(tmp_path / "map.pgm").size == 5


@pytest.mark.parametrize("name", ["plant_keepout", "speed_mask", "plant-speed", "keepout"])
def test_a_mask_of_a_costmap_filter_is_told_from_a_map(name, tmp_path, remarks):
    for each in ("plant", name):
        write_ros_map(Maze(generate("dfs", 7, np.random.default_rng(0)).walls, each), tmp_path / f"{each}.yaml")
    read_maze(tmp_path / f"{name}.yaml")
    assert "read as a building, though by its name it is a mask of a costmap filter" in remarks()[0]
    assert [maze.name for maze in read_mazes(tmp_path)] == ["plant"]
    assert f"{name}.yaml: left out" in remarks()[0]


def test_a_folder_of_maps_reads_each_once(tmp_path):
    mazes = [generate("dfs", 7, np.random.default_rng(seed)) for seed in range(2)]
    for maze, name in zip(mazes, "ab", strict=True):
        write_ros_map(Maze(maze.walls, name, 0.5), tmp_path / f"{name}.yaml")
        write_text_maze(maze, tmp_path / f"{name}.txt")
    content = (tmp_path / "b.yaml").read_text()
    (tmp_path / "c.pgm").write_bytes((tmp_path / "b.pgm").read_bytes())
    (tmp_path / "b.yaml").write_text(content.replace("b.pgm", "c.pgm"))
    found = read_mazes(tmp_path)
    assert [(maze.name, maze.cell_size) for maze in found] == [("a", 0.5), ("b", 0.5)]
    assert mazebench.Task.of(mazes=tmp_path, distances=[2]).mazes == found
