"""Mazes as text: round trip, DeepMind Lab's characters, and what is refused with its position."""

from __future__ import annotations

import os

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies

from mazebench.errors import InputError
from mazebench.maps.generators import STYLES, generate
from mazebench.maps.maze import MAX_SIZE, Maze, MazeError
from mazebench.maps.text import format_maze, parse_maze, read_text_maze, write_text_maze

PLAN = """\
#####
#..##
##.##
##..#
#####
"""
LARGEST = Maze(np.pad(np.zeros((MAX_SIZE - 2,) * 2, dtype=bool), 1, constant_values=True))


class TestRoundTrip:
    def test_format_when_worked_by_hand(self):
        walls = np.ones((5, 5), dtype=bool)
        walls[[1, 1, 2, 3, 3], [1, 2, 2, 2, 3]] = False
        assert format_maze(Maze(walls)) == PLAN
        np.testing.assert_array_equal(parse_maze(PLAN).walls, walls)

    @pytest.mark.parametrize("style", sorted(STYLES))
    @pytest.mark.parametrize("size", [5, 13, MAX_SIZE])
    def test_file_when_written_and_read(self, style, size, tmp_path):
        maze = generate(style, size, np.random.default_rng(3), "some-name")
        write_text_maze(maze, tmp_path / "other-name.txt")
        read = read_text_maze(tmp_path / "other-name.txt")
        assert read == maze
        assert read.name == "other-name"

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
    def test_parse_when_other_dialect(self, text):
        assert parse_maze(text) == parse_maze(PLAN)

    def test_parse_when_named(self):
        assert parse_maze(PLAN, "plan").name == "plan"

    def test_file_when_largest_with_two_byte_line_ends(self, tmp_path):
        path = tmp_path / "largest.txt"
        path.write_bytes(format_maze(LARGEST).replace("\n", "\r\n").encode("ascii"))
        assert read_text_maze(path) == LARGEST


class TestRefusal:
    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("#####\n#..x#\n", r"^m: expected one of '#\*1' \(wall\) or '\. 0PG' \(free\), found 'x' at \(1, 3\)$"),
            (PLAN.replace(".", "·"), r"found '·' at \(1, 1\)$"),
            (PLAN.replace(".", "\t"), r"found '\\t' at \(1, 1\)$"),
            (PLAN.replace("\n", "\r"), r"found '\\r' at \(0, 5\)$"),
            (PLAN.replace("\n", "\n\r"), r"expected rows of 5 cells like the first, found 6 in row 1$"),
            (PLAN.replace("\n", "\u2028"), r"found '\\u2028' at \(0, 5\)$"),
            ("#####\n#..##\n####\n", r"^m: expected rows of 5 cells like the first, found 4 in row 2$"),
            ("#####\n\n#####\n", r"^m: expected rows of 5 cells like the first, found 0 in row 1$"),
            ("######\n#....#\n######\n", r"^m: expected a square grid, found shape \(3, 6\)$"),
            ("", r"^m: expected a square grid, found shape \(1, 0\)$"),
            (PLAN.replace("#..##", "...##"), r"^m: expected a closed border, found cell \(1, 0\) free$"),
            ("####\n#..#\n#..#\n####\n", r"^m: expected 5 to 255 cells a side, found 4$"),
            ("#" * 65_536, r"^m: expected a map of at most 255 x 255 cells, found 65536 characters$"),
        ],
    )
    def test_parse_when_illegal(self, text, message):
        with pytest.raises(MazeError, match=message):
            parse_maze(text, "m")

    def test_read_when_file_is_missing(self, tmp_path):
        with pytest.raises(InputError, match=r"none\.txt: can't read the map: No such file or directory$"):
            read_text_maze(tmp_path / "none.txt")

    def test_read_when_file_is_a_folder(self, tmp_path):
        with pytest.raises(InputError, match="can't read the map: Is a directory"):
            read_text_maze(tmp_path)

    def test_read_when_file_is_not_ascii(self, tmp_path):
        path = tmp_path / "utf8.txt"
        path.write_bytes(PLAN.replace(".", "·").encode("utf-8"))
        with pytest.raises(MazeError, match=r"utf8\.txt: expected a text map, found byte 0xc2 at 7$"):
            read_text_maze(path)

    def test_read_when_file_is_binary(self, tmp_path):
        path = tmp_path / "zeros.txt"
        path.write_bytes(bytes(100))
        with pytest.raises(MazeError, match=r"found '\\x00' at \(0, 0\)"):
            read_text_maze(path)

    def test_read_when_file_is_huge(self, tmp_path):
        path = tmp_path / "huge.txt"
        path.touch()
        os.truncate(path, 10**11)
        with pytest.raises(
            MazeError, match=r"huge\.txt: expected a map of at most 65535 bytes .255 x 255 cells., found"
        ):
            read_text_maze(path)


@hypothesis.settings(max_examples=200, deadline=None)
@hypothesis.given(
    strategies.one_of(
        strategies.binary(max_size=200),
        strategies.lists(strategies.sampled_from([b"#", b".", b"\n", b"\r\n", b"x"]), max_size=60).map(b"".join),
    )
)
def test_read_when_bytes_are_arbitrary(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "arbitrary.txt"
    path.write_bytes(content)
    try:
        maze = read_text_maze(path)
    except InputError:
        return
    assert parse_maze(format_maze(maze)) == maze
