"""Mazes read from files and folders."""

from __future__ import annotations

import os

import numpy as np
import pytest

from mazebench.errors import InputError
from mazebench.maps import files
from mazebench.maps.files import MAX_FILES, read_maze, read_mazes
from mazebench.maps.generators import generate
from mazebench.maps.image import draw_maze, write_image
from mazebench.maps.text import write_text_maze


@pytest.fixture(scope="module")
def mazes():
    rng = np.random.default_rng(0)
    return [generate("dfs", 7, rng) for _ in range(4)]


def write_picture(maze, path):
    write_image(draw_maze(maze, 8), path)


def test_maze_when_suffix_is_in_capitals(mazes, tmp_path):
    write_picture(mazes[0], tmp_path / "a.PNG")
    write_text_maze(mazes[1], tmp_path / "b.TXT")
    assert read_maze(tmp_path / "a.PNG") == mazes[0]
    assert [maze.name for maze in read_mazes(tmp_path)] == ["a", "b"]


def test_maze_when_suffix_is_unknown(mazes, tmp_path):
    write_text_maze(mazes[0], tmp_path / "plan.dat")
    assert read_maze(str(tmp_path / "plan.dat")) == mazes[0]


def test_mazes_when_path_is_a_file(mazes, tmp_path):
    write_text_maze(mazes[0], tmp_path / "plan.txt")
    assert read_mazes(tmp_path / "plan.txt") == (mazes[0],)


def test_mazes_when_path_is_a_folder(mazes, tmp_path):
    write_text_maze(mazes[2], tmp_path / "c.txt")
    write_picture(mazes[1], tmp_path / "b.png")
    write_text_maze(mazes[0], tmp_path / "a.map")
    (tmp_path / "notes.md").write_text("no map")
    (tmp_path / "a.xml").write_text("no map either")
    found = read_mazes(tmp_path)
    assert found == (mazes[0], mazes[1], mazes[2])
    assert [maze.name for maze in found] == ["a", "b", "c"]


def test_mazes_when_stem_is_there_as_text_and_picture(mazes, tmp_path):
    write_text_maze(mazes[0], tmp_path / "a.txt")
    write_picture(mazes[1], tmp_path / "a.png")
    write_picture(mazes[2], tmp_path / "a.bmp")
    assert read_mazes(tmp_path) == (mazes[0],)


def test_mazes_when_sizes_differ(mazes, tmp_path):
    write_text_maze(mazes[0], tmp_path / "a.txt")
    write_text_maze(generate("dfs", 9, np.random.default_rng(0)), tmp_path / "b.txt")
    # A task on them is refused, but reading is not.
    assert [maze.size for maze in read_mazes(tmp_path)] == [7, 9]


@pytest.mark.parametrize("content", [[], ["notes.md", "maze.xml"]])
def test_mazes_when_folder_holds_none(tmp_path, content):
    for name in content:
        (tmp_path / name).touch()
    with pytest.raises(
        InputError, match=r"expected 1 to 10000 maps \(\.txt \.map \.png \.jpg \.jpeg \.bmp\), found 0$"
    ):
        read_mazes(tmp_path)


def test_mazes_when_folder_holds_too_many(tmp_path):
    for index in range(MAX_FILES + 1):
        (tmp_path / f"{index}.txt").touch()
    with pytest.raises(InputError, match=r"expected 1 to 10000 maps .*, found 10001$"):
        read_mazes(tmp_path)


def test_mazes_when_folder_holds_too_much_else(mazes, tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_MAX_ENTRIES", 3)
    write_text_maze(mazes[0], tmp_path / "a.txt")
    for index in range(3):
        assert read_mazes(tmp_path) == (mazes[0],)
        (tmp_path / f"{index}.log").touch()
    with pytest.raises(InputError, match="expected a folder of at most 3 files, found more"):
        read_mazes(tmp_path)


def test_mazes_when_one_of_a_folder_is_broken(mazes, tmp_path):
    write_text_maze(mazes[0], tmp_path / "a.txt")
    (tmp_path / "b.txt").write_text("#####\n#...#\n#.x.#\n#...#\n#####\n")
    with pytest.raises(InputError, match=r"^b: expected one of .*, found 'x' at \(2, 2\)$"):
        read_mazes(tmp_path)


@pytest.mark.parametrize("suffix", ["txt", "png", ""])
def test_maze_when_file_is_missing(tmp_path, suffix):
    with pytest.raises(InputError, match=r"can't read the (map|picture): No such file or directory$"):
        read_mazes(tmp_path / f"none.{suffix}")


@pytest.mark.parametrize("suffix", ["txt", "png"])
def test_maze_when_file_is_huge(tmp_path, suffix):
    path = tmp_path / f"huge.{suffix}"
    path.touch()
    os.truncate(path, 10**11)
    with pytest.raises(InputError, match=rf"huge\.{suffix}: expected a (map|picture) of at most .*, found more$"):
        read_mazes(path)


def test_maze_when_folder_is_named_like_a_map(tmp_path):
    (tmp_path / "a.txt").mkdir()
    with pytest.raises(InputError, match=r"a\.txt: can't read the map: Is a directory$"):
        read_mazes(tmp_path)
