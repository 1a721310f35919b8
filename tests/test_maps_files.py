"""Mazes read from files and folders: as they were written, in every format."""

from __future__ import annotations

import dataclasses
import pathlib
import tempfile
import warnings

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies

from mazebench.errors import InputError
from mazebench.maps.kinds import KINDS, generate
from mazebench.maps.maze_files import read_maze, read_mazes
from mazebench.maps.pictures import draw_maze, write_image
from mazebench.maps.readers.ros import write_ros_map
from mazebench.maps.text import write_text_maze


@pytest.fixture(scope="module")
def mazes():
    rng = np.random.default_rng(0)
    return [generate("dfs", 7, rng) for _ in range(4)]


def write_picture(maze, path):
    write_image(draw_maze(maze, 8), path)


WRITERS = {
    "txt": write_text_maze,
    "png": write_picture,
    "npy": lambda maze, path: np.save(path, maze.walls),
    "yaml": write_ros_map,  # with a picture beside it, and the size of a cell
}


@pytest.mark.parametrize("suffix", WRITERS)
@hypothesis.given(
    strategies.integers(0, 2**32 - 1),
    strategies.sampled_from(sorted(KINDS)),
    strategies.integers(2, 20).map(lambda half: 2 * half + 1),
    strategies.sampled_from([1.0, 0.5, 0.7]),
)
@hypothesis.example(0, "obstacles", 255, 1.0)
@hypothesis.example(0, "obstacles", 40, 0.5)
@hypothesis.settings(max_examples=25, deadline=None)
def test_a_maze_is_read_as_it_was_written_without_remarks(suffix, seed, kind, size, cell_size):
    size = max(size, KINDS[kind].smallest)
    maze = dataclasses.replace(generate(kind, size, np.random.default_rng(seed), "other"), cell_size=cell_size)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        path = pathlib.Path(folder) / f"plan.{suffix}"
        WRITERS[suffix](maze, path)
        read = read_maze(path) if suffix == "yaml" else read_maze(path, cell_size=cell_size)
    assert (read, read.name) == (maze, "plan")


def test_a_folders_maps_are_read_by_name_and_each_once(mazes, tmp_path):
    write_text_maze(mazes[2], tmp_path / "c.TXT")
    write_picture(mazes[1], tmp_path / "b.PNG")
    write_text_maze(mazes[0], tmp_path / "a.map")
    write_picture(mazes[3], tmp_path / "a.png")  # the text is the maze
    (tmp_path / "notes.md").write_text("no map")
    (tmp_path / "a.xml").write_text("no map either")
    found = read_mazes(tmp_path)
    assert found == (mazes[0], mazes[1], mazes[2])
    assert [maze.name for maze in found] == ["a", "b", "c"]
    assert read_maze(tmp_path / "b.PNG") == mazes[1]


def test_what_is_no_map_is_left_out_of_a_folder_with_a_line_and_all_remarks_are_shown(mazes, tmp_path, remarks):
    (tmp_path / "a.txt").write_text("#####\n#...#\n#####\n")
    (tmp_path / "b.csv").write_text("1,1,1,1,1\n1,0,2,0,1\n1,1,1,1,1\n".replace("2", "0"))
    (tmp_path / "params.yaml").write_text("planner: {speed: 1}\n")
    (tmp_path / "results.csv").write_text("name,steps\noracle,12\n")
    assert [maze.name for maze in read_mazes(tmp_path)] == ["a", "b"]
    starts = [f"{tmp_path}/params.yaml: left out", f"{tmp_path}/results.csv: left out", "a: 3 x 5 cells", "b: 3 x 5"]
    assert all(line.startswith(start) for line, start in zip(remarks(), starts, strict=True))


@pytest.mark.parametrize("content", [[], ["notes.md", "maze.xml"]])
def test_a_folder_without_maps_is_refused(tmp_path, content):
    for name in content:
        (tmp_path / name).touch()
    with pytest.raises(InputError, match=r"expected maps \(\.yaml \.yml \.txt .*\), found none$"):
        read_mazes(tmp_path)


def test_a_broken_map_of_a_folder_is_named(mazes, tmp_path):
    write_text_maze(mazes[0], tmp_path / "a.txt")
    (tmp_path / "b.txt").write_text("#####\n#...#\n#.!.#\n#...#\n#####\n")
    with pytest.raises(InputError, match=r"^b: expected .*, found '!' at \(2, 2\)$"):
        read_mazes(tmp_path)
