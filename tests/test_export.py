"""Exports for other tools: a watertight mesh of the walls, and a model that plain MuJoCo opens."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import trimesh

from mazebench.maps.covering import cover
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze, point_to_cell
from mazebench.maps.text import parse_maze
from mazebench.world.export import wall_mesh, write_mesh, write_mjcf

# Walls that touch at a corner only: without care an edge of the mesh would have four faces.
DIAGONAL = parse_maze("#######\n#....##\n#.#...#\n#..#..#\n#...#.#\n#.#...#\n#######", "diagonal")
MAZES = [
    DIAGONAL,
    *(
        generate(kind, size, np.random.default_rng(size))
        for kind in ("dfs", "rooms", "obstacles")
        for size in (5, 13, 21)
    ),
]


def winding_numbers(mesh: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """`[P]`: 1 inside a closed surface, 0 outside; the sum of solid angles (Van Oosterom and Strackee 1983) by 4 pi."""
    a, b, c = (mesh.triangles[None, :, i] - points[:, None] for i in range(3))
    length_a, length_b, length_c = (np.linalg.norm(corner, axis=-1) for corner in (a, b, c))
    volume = np.einsum("pti,pti->pt", a, np.cross(b, c))
    scale = length_a * length_b * length_c
    scale += (a * b).sum(-1) * length_c + (b * c).sum(-1) * length_a + (c * a).sum(-1) * length_b
    return 2 * np.arctan2(volume, scale).sum(axis=1) / (4 * np.pi)


@pytest.mark.parametrize("maze", MAZES, ids=lambda maze: maze.name)
class TestMesh:
    @pytest.mark.parametrize("suffix", ["glb", "obj", "stl"])
    def test_the_mesh_is_watertight_and_stands_upright(self, maze, suffix, tmp_path):
        write_mesh(maze, tmp_path / f"walls.{suffix}")
        mesh = trimesh.load(tmp_path / f"walls.{suffix}", force="mesh")
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert mesh.volume == pytest.approx(maze.walls.sum(), rel=0.01)
        # glTF has y up, so the map's upper side lies at -z.
        size = maze.size
        bounds = [[0, 0, -size], [size, 1, 0]] if suffix == "glb" else [[0, 0, 0], [size, size, 1]]
        np.testing.assert_allclose(mesh.bounds, bounds, atol=0.002)

    def test_the_mesh_is_solid_where_walls_are(self, maze):
        rows, columns = np.indices(maze.walls.shape)
        centres = np.stack([columns + 0.5, maze.size - rows - 0.5, np.full(rows.shape, 0.5)], axis=-1)
        windings = winding_numbers(wall_mesh(maze), centres.reshape(-1, 3)).reshape(rows.shape)
        np.testing.assert_allclose(windings, maze.walls, atol=1e-6)


@pytest.mark.parametrize("maze", MAZES, ids=lambda maze: maze.name)
class TestModel:
    def test_plain_mujoco_opens_the_model(self, maze, tmp_path, monkeypatch):
        write_mjcf(maze, tmp_path / "maze.xml")
        monkeypatch.chdir("/")  # no other file is needed
        model = mujoco.MjModel.from_xml_path(str(tmp_path / "maze.xml"))
        boxes = model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
        assert boxes.sum() == len(cover(maze.walls))
        # Boxes don't overlap, so their areas add up to the walls'.
        assert (4 * model.geom_size[boxes, 0] * model.geom_size[boxes, 1]).sum() == pytest.approx(maze.walls.sum())
        np.testing.assert_allclose(model.geom_pos[boxes, 2] + model.geom_size[boxes, 2], 1.0)
        np.testing.assert_allclose(model.geom_pos[boxes, 2] - model.geom_size[boxes, 2], 0.0, atol=1e-12)

    def test_the_body_starts_free_and_can_drive(self, maze, tmp_path):
        write_mjcf(maze, tmp_path / "maze.xml")
        model = mujoco.MjModel.from_xml_path(str(tmp_path / "maze.xml"))
        data = mujoco.MjData(model)
        assert model.nkey >= 1
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        row, column = point_to_cell(data.body("agent").xpos[:2], maze.size).tolist()
        assert maze.is_free((row, column))
        assert data.ncon == 0
        before = data.body("agent").xpos.copy()
        data.ctrl[:4] = 1.0  # opposite drives cancel out
        mujoco.mj_step(model, data, 20)
        np.testing.assert_allclose(data.body("agent").xpos, before, atol=1e-9)
        data.ctrl[:] = np.eye(5)[0]
        mujoco.mj_step(model, data, 20)
        assert np.isfinite(data.qpos).all()


@pytest.mark.parametrize("name", ['a&b<c>"d', "ümläut", "two words"])
def test_a_name_is_escaped(name, tmp_path):
    write_mjcf(Maze(DIAGONAL.walls, name), tmp_path / "maze.xml")
    assert mujoco.MjSpec.from_file(str(tmp_path / "maze.xml")).modelname == name
