"""Whole models of mazes; `python tests/test_world_models.py` rewrites the golden file."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest

from mazebench.errors import InputError
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.maps.text import parse_maze
from mazebench.world import mjcf, models
from mazebench.world.bodies import SLIDER
from mazebench.world.export import write_mjcf

GOLDEN = pathlib.Path(__file__).parent / "golden" / "maze-5.xml"


def golden_maze() -> Maze:
    return parse_maze("#####\n#..##\n##..#\n#...#\n#####", "maze-5")


class TestMazeModels:
    def test_models_that_were_used_last_are_kept(self, monkeypatch):
        monkeypatch.setattr(models, "_MOST_GEOMS", 20)
        whole = models.MazeModels([golden_maze(), generate("dfs", 13, np.random.default_rng(0)), golden_maze()], SLIDER)
        first, second = whole[0], whole[1]
        assert whole[1] is second
        whole[2]
        assert whole[0] is not first

    def test_a_maze_of_too_many_boxes_is_refused_in_a_line(self, monkeypatch):
        monkeypatch.setattr(mjcf, "MAX_BOXES", 3)
        with pytest.raises(InputError, match="maze-5: expected a maze of at most 3 wall boxes"):
            mjcf.maze_spec(golden_maze())


class TestMjcf:
    def test_the_mjcf_file_is_the_golden_one(self, tmp_path):
        write_mjcf(golden_maze(), tmp_path / "maze-5.xml")
        assert (tmp_path / "maze-5.xml").read_text(encoding="utf-8") == GOLDEN.read_text(encoding="utf-8")


if __name__ == "__main__":
    GOLDEN.parent.mkdir(exist_ok=True)
    write_mjcf(golden_maze(), GOLDEN)
