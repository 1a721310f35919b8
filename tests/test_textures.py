"""The textured models that `generate` writes, whose look depends on the walls alone."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mazebench.maps.benchmark import load_mazes
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze, point_to_cell
from mazebench.world.export import write_mjcf
from mazebench.world.textures import Face, wall_faces

MAZES = [
    generate(kind, size, np.random.default_rng(size)) for kind in ("dfs", "rooms", "obstacles") for size in (5, 15)
]


def facing(face: Face) -> np.ndarray:
    return np.array([-np.sin(face.yaw), np.cos(face.yaw)])


@pytest.mark.parametrize("maze", MAZES, ids=lambda maze: maze.name)
class TestWallFaces:
    def test_faces_are_the_sides_of_walls_that_border_free_cells(self, maze):
        free = ~maze.walls
        num_sides = (free[1:] ^ free[:-1]).sum() + (free[:, 1:] ^ free[:, :-1]).sum()
        faces = wall_faces(maze)
        assert sum(2 * face.half_length for face in faces) == pytest.approx(num_sides)
        for face in faces:
            normal = facing(face)
            along = np.array([normal[1], -normal[0]])
            for part in np.arange(0.5 - face.half_length, face.half_length):
                point = np.array([face.x, face.y]) + part * along
                assert maze.is_free(tuple(point_to_cell(point + 0.1 * normal, maze.size)))
                assert not maze.is_free(tuple(point_to_cell(point - 0.1 * normal, maze.size)))


def test_the_look_depends_on_the_walls_alone():
    maze, other = load_mazes(13, "eval")[:2]
    assert wall_faces(Maze(maze.walls, "another name")) == wall_faces(maze)
    assert wall_faces(other) != wall_faces(maze)


def test_a_surface_says_nothing_about_the_place_on_the_map():
    # The most frequent surface of the upper left corner's walls, over all mazes of the benchmark's size 13.
    corners = [
        face.surface for maze in load_mazes(13, "train") + load_mazes(13, "eval") for face in wall_faces(maze)[:1]
    ]
    assert np.bincount(corners).max() < len(corners) / 3


class TestMjcf:
    def test_plain_mujoco_opens_the_textured_file_from_anywhere(self, tmp_path, monkeypatch):
        write_mjcf(MAZES[1], tmp_path / "maze.xml", textures=True)
        monkeypatch.chdir("/")  # no other file is needed
        model = mujoco.MjModel.from_xml_path(str(tmp_path / "maze.xml"))
        faces = [model.geom(index) for index in range(model.ngeom) if model.geom(index).name.startswith("face_")]
        assert len(faces) == len(wall_faces(MAZES[1]))
        for face, expected in zip(faces, wall_faces(MAZES[1]), strict=True):
            assert model.mat(face.matid.item()).name == f"face_{expected.surface}"
            np.testing.assert_allclose(face.pos, (expected.x, expected.y, 0.5), atol=1e-9)
            rotation = np.zeros(9)
            mujoco.mju_quat2Mat(rotation, face.quat)
            _, up, outwards = rotation.reshape(3, 3).T
            np.testing.assert_allclose(outwards, (*facing(expected), 0), atol=1e-9)
            np.testing.assert_allclose(up, (0, 0, 1), atol=1e-9)
