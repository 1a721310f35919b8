"""Mazes as text: DeepMind Lab's characters, and what is refused with its position."""

from __future__ import annotations

import numpy as np
import pytest

from mazebench.errors import InputError
from mazebench.maps.maze import Maze, MazeError
from mazebench.maps.text import format_maze, parse_maze, read_text_maze

PLAN = """\
#####
#..##
##.##
##..#
#####
"""


class TestReading:
    def test_a_maze_is_written_as_worked_by_hand(self):
        walls = np.ones((5, 5), dtype=bool)
        walls[[1, 1, 2, 3, 3], [1, 2, 2, 2, 3]] = False
        assert format_maze(Maze(walls)) == PLAN
        np.testing.assert_array_equal(parse_maze(PLAN).walls, walls)

    @pytest.mark.parametrize(
        "text",
        [
            PLAN.replace("#", "*").replace(".", " "),  # DeepMind Lab and labmaze
            PLAN.replace("#", "1").replace(".", "0"),
            "*****\n*P ##\n##0#1\n##.G*\n1***#\n",
            PLAN.rstrip("\n"),
            "\n\n" + PLAN + "\n\n",
            PLAN.replace("\n", "\r\n"),
            "\r\n" + PLAN.replace("\n", "\r\n").rstrip("\r\n"),
        ],
    )
    def test_other_characters_and_line_ends_are_read(self, text):
        assert parse_maze(text) == parse_maze(PLAN)

    @pytest.mark.parametrize("encoding", ["ascii", "utf-8-sig", "utf-16"])
    def test_a_byte_order_mark_is_no_error(self, encoding, tmp_path):
        (tmp_path / "plan.txt").write_bytes(PLAN.encode(encoding))
        assert read_text_maze(tmp_path / "plan.txt") == parse_maze(PLAN)


class TestRectangle:
    @pytest.mark.parametrize(
        ("text", "padded", "line"),
        [
            (
                "######\n#....#\n######\n",
                "######\n#....#\n######\n######\n######\n######\n",
                "m: 3 x 6 cells, padded with wall at the bottom to 6 x 6",
            ),
            (
                "###\n#.#\n#.#\n#.#\n###\n",
                "#####\n#.###\n#.###\n#.###\n#####\n",
                "m: 5 x 3 cells, padded with wall on the right to 5 x 5",
            ),
        ],
    )
    def test_a_text_is_padded_with_wall_to_a_square_and_one_line_says_so(self, text, padded, line, remarks):
        assert format_maze(parse_maze(text, "m")) == padded
        assert remarks() == [line]


class TestRefusal:
    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("#####\n#..x#\n", r"^m: expected one of '#\*1' \(wall\) or '\. 0PG' \(free\), found 'x' at \(1, 3\)$"),
            (PLAN.replace(".", "·"), r"found '·' at \(1, 1\)$"),
            ("#####\n#..##\n####\n", r"^m: expected rows of 5 cells like the first, found 4 in row 2$"),
            ("#..#\n####\n####\n", r"^m: expected a closed border, found cell \(0, 1\) free$"),
            ("####\n#..#\n####\n", r"^m: expected 5 to 1024 cells a side, found 4$"),
            (PLAN.replace("#..##", "...##"), r"^m: expected a closed border, found cell \(1, 0\) free$"),
        ],
    )
    def test_an_illegal_text_is_refused(self, text, message):
        with pytest.raises(MazeError, match=message):
            parse_maze(text, "m")

    def test_a_missing_file_is_named(self, tmp_path):
        with pytest.raises(InputError, match=r"none\.txt: can't read the map: No such file or directory$"):
            read_text_maze(tmp_path / "none.txt")

    def test_a_file_that_is_not_ascii_is_named(self, tmp_path):
        path = tmp_path / "utf8.txt"
        path.write_bytes(PLAN.replace(".", "·").encode("utf-8"))
        with pytest.raises(MazeError, match=r"utf8\.txt: expected a text map, found byte 0xc2 at 7$"):
            read_text_maze(path)
