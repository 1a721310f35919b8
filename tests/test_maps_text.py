"""Mazes as text: the package's own, and the forms that others write."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import mazebench
from mazebench.maps.maze import Maze, MazeError
from mazebench.maps.maze_files import read_maze
from mazebench.maps.readers.occupancy_grid import FREE, OCCUPIED
from mazebench.maps.readers.text_map import grid_of_text
from mazebench.maps.text import format_maze, parse_maze

PLAN = """\
#####
#..##
##.##
##..#
#####
"""
MOVING_AI = "type octile\nheight 5\nwidth 5\nmap\n@@TTT\n@.G@@\n@W.@@\n@@S.O\n@@@@@\n"


def read(tmp_path, content: str | bytes, name: str = "plan.txt") -> Maze:
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_maze(tmp_path / name)


def rows(numbers: np.ndarray) -> list[list[int]]:
    return numbers.astype(int).tolist()


class TestOwn:
    def test_a_maze_is_written_as_worked_by_hand(self):
        walls = np.ones((5, 5), dtype=bool)
        walls[[1, 1, 2, 3, 3], [1, 2, 2, 2, 3]] = False
        assert format_maze(Maze(walls)) == PLAN
        np.testing.assert_array_equal(parse_maze(PLAN).walls, walls)

    @pytest.mark.parametrize("text", [PLAN.replace(".", " "), "#####\n#...#\n#####\n", PLAN.replace("#..##", "#..#")])
    def test_another_text_is_refused(self, text):
        with pytest.raises(MazeError, match="m: expected as many rows as columns, of '#'"):
            parse_maze(text, "m")


class TestReading:
    @pytest.mark.parametrize(
        "text",
        [
            PLAN,
            "\n   \n" + PLAN.rstrip("\n"),
            PLAN.replace("\n", "\r\n"),
            PLAN.replace("\n", "\r"),
            PLAN.replace("##.##", "##.## "),
            PLAN.replace("#", "*").replace(".", " "),
            PLAN.replace("#", "@"),
            PLAN.replace("#", "█").replace(".", " "),
            "┌───┐\n│  ├┤\n├┐ ├┤\n├┤  │\n└┴──┘\n",
            PLAN.replace("#", "1").replace(".", "0"),
            MOVING_AI,
            MOVING_AI.replace("\n", "\r\n"),
            PLAN.strip().replace("\n", "\\").replace(".", "O"),  # D4RL
            "\n".join(" ".join(row) for row in PLAN.split()),
            "\n".join(",".join(row) for row in PLAN.replace("#", "1").replace(".", "0").split()),
            "\n".join("\t".join(str(100 * cell) for cell in row) for row in rows(parse_maze(PLAN).walls)),
            json.dumps(rows(parse_maze(PLAN).walls)),
            json.dumps(rows(parse_maze(PLAN).walls)).replace("[1, 0, 0", "[1, 'r', 'g'"),  # Gymnasium-Robotics
            json.dumps(PLAN.split()),
            str(parse_maze(PLAN).walls.astype(int)),
            f"walls = {parse_maze(PLAN).walls!r}",
        ],
    )
    def test_a_form_that_people_write_is_the_same_maze(self, text, tmp_path):
        assert read(tmp_path, text) == parse_maze(PLAN)

    @pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
    def test_a_byte_order_mark_is_no_error(self, encoding, tmp_path):
        assert read(tmp_path, PLAN.encode(encoding)) == parse_maze(PLAN)

    def test_letters_are_free_and_missing_ends_of_rows_wall_as_in_deepmind_lab(self, tmp_path, remarks):
        assert read(tmp_path, "*****\n*PA*\n**H*\n**.G*\n*****\n\n") == parse_maze(PLAN)
        assert remarks()[0].startswith("plan: A, H read as free; short rows filled with wall; ")

    @pytest.mark.parametrize(("post", "gap"), [("o", 3), ("+", 3), ("+", 2)])
    def test_walls_between_posts_are_cells(self, post, gap, tmp_path):
        line, blank = "-" * gap, " " * gap
        text = (
            f"{post}{line}{post}{line}{post}\n|{blank} {blank}|\n{post}{line}{post}{blank}{post}\n|{blank}|{blank}|\n"
        )
        expected = "#####\n#...#\n###.#\n#.#.#\n#####\n".replace("#.#.#", "###.#")
        text = text.replace(f"|{blank}|{blank}|", f"|{line}|{blank}|") + f"{post}{line}{post}{line}{post}\n"
        assert read(tmp_path, text) == parse_maze(expected)

    @pytest.mark.parametrize(
        "plan",
        [
            "+---+---+\n|...|...|\n|.#.|...|\n|.......|\n+---+---+\n",
            "+---+---+\n|...|...|\n|.......|\n+---+---+\n",
            "+-------+\n|  #    |\n|     - |\n+-------+\n",
            "+-------+\n|  |    |\n+       +\n|    |  |\n+-------+\n",
            "+---+---+\n|...|...|\n+---+...+\n|...|...|\n+---+---+\n",
        ],
    )
    def test_a_plan_of_lines_is_read_as_it_is_drawn(self, plan, tmp_path):
        maze = read(tmp_path, plan)
        drawn = [[letter in "+-|#" for letter in line] for line in plan.splitlines()]
        for row, line in enumerate(maze.walls[: len(drawn)]):
            assert (line >= np.array(drawn[row])).all()  # what can't be reached is closed
        assert maze.size == len(drawn[0])

    @pytest.mark.parametrize(
        "rows",
        ["o---o---o\n|       |\no---o--o ", "+---+\n|   |\n+---+\n|   |", "o---o\n| # |\no---o", "o---o\n|-- |\no-  o"],
    )
    def test_posts_that_are_missing_are_named(self, rows, tmp_path):
        with pytest.raises(
            MazeError,
            match=r"expected rows of posts and of rooms in turns, found (none in row 2|4 rows|a wall in a room)",
        ):
            read(tmp_path, rows)

    @given(walls=arrays(bool, (5, 7)), separator=st.sampled_from(",;\t"), quote=st.sampled_from(["", '"']))
    def test_a_table_is_the_array_that_was_written(self, walls, separator, quote):
        table = "\n".join(separator.join(f"{quote}{int(cell)}{quote}" for cell in row) for row in walls)
        np.testing.assert_array_equal(grid_of_text(table, "m").states, np.where(walls, OCCUPIED, FREE))

    def test_characters_of_double_width_and_squares_are_read(self, tmp_path):
        for wall, free in ("＃．", "■□", "⬛⬜", ("⬛\ufe0f", "⬜\ufe0f")):
            assert read(tmp_path, PLAN.replace("#", wall).replace(".", free)) == parse_maze(PLAN)

    def test_the_grid_of_a_json_object_is_read(self, tmp_path):
        content = {"name": "plan", "grid": rows(parse_maze(PLAN).walls), "start": [1, 1]}
        assert read(tmp_path, json.dumps(content), "plan.json") == parse_maze(PLAN)

    def test_a_name_of_other_bytes_is_escaped(self, tmp_path):
        maze = read(tmp_path, PLAN, "gr\udcf6\x1b.txt")
        assert maze.name == "gr\\udcf6\\x1b"
        assert mazebench.load(mazes=maze, distances=[2]).physics is not None


class TestRefusal:
    @pytest.mark.parametrize(
        ("content", "message"),
        [
            ("#####\n#.!.#\n#####\n", r"^plan: expected '#\*1@%' or a block for wall.*, found '!' at \(1, 2\)$"),
            ("# my office\n" + PLAN, r"^plan: expected rows of cells, found the word 'office' in row 0"),
            ("XXX\nXoX\nXXX\n", "found only X o$"),
            ("11111\n10231\n11111\n", "found int64 with the values 0, 1, 2, 3"),
            ("0.5,0.5,0.5\n0.1,0.2,0.3\n", "found float64 with the values 0.1, 0.2, 0.3, 0.5"),
            (PLAN + "\n" + PLAN, "expected one maze, found 2 with blank lines between"),
            (2 * "1,1,1\n1,0,1\n1,1,1\n\n", "expected one maze, found 2 with blank lines between"),
            (MOVING_AI.replace("height 5", "height 6"), "expected a MovingAI map of 6 rows of 5 cells"),
            ('{"rooms": [], "id": 3}', "expected JSON with one list of rows, found the keys rooms, id$"),
            ('{"type": "FeatureCollection", "features": []}', "found the keys type, features; draw the plan"),
            ('{"grid": ' + "[" * 100_000, "expected JSON with one list of rows"),
            ("1,0,1\n1,,1\n1,1,1\n", r"expected a value in each field, found none at \(1, 1\)$"),
            ("1,0,1\n1,0\n1,1,1\n", r"expected 3 fields in each row, found 2 in row 1$"),
            ("#####\n#,,,#\n#,,,#\n#,,,#\n#####\n", r"found ',' at \(1, 1\)$"),
            ("1;0;1\n1;wall;1\n1;1;1\n", r"cells of one character, found 'wall' at \(1, 1\)$"),
            ("####\n#..#\n####\n", r"^plan: expected 5 to \d+ cells a side, found 4$"),
            (b"\xff\xff\xff", "found byte 0xff at 0; text, pictures such as PNG"),
            (b"AB\0", "found byte 0x00 at 2; text, pictures such as PNG"),
            (b"\0\0\0 ftypheic", r"plan\.txt: expected a text map, found a HEIC picture; convert it to PNG$"),
            (b"%PDF-1.7\n", "found a PDF; export it as PNG and give its scale by --pixel-size$"),
            (b"  0\nSECTION\n", "found a DXF drawing; export"),
            (b"version https://git-lfs.github.com/spec/v1\n", "found a Git LFS pointer; run git lfs pull$"),
            (b"<!DOCTYPE html>\n<p>", "found an HTML page; download the file itself$"),
            (b"", "found an empty file$"),
        ],
    )
    def test_what_is_not_read_is_named(self, content, message, tmp_path):
        with pytest.raises(MazeError, match=message):
            read(tmp_path, content)

    def test_a_map_of_movingai_is_never_taken_for_an_inverted_one(self, tmp_path):
        rows = "type octile\nheight 4\nwidth 4\nmap\n....\n.@@.\n.@@.\n....\n"
        assert read(tmp_path, rows).walls[2:4, 2:4].all()
