"""Exports for other tools: a watertight mesh of the walls, and a model that plain MuJoCo opens."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import trimesh

from mazebench.maps.covering import cover
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.maps.text import parse_maze
from mazebench.world.export import write_mesh, write_mjcf

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


class TestRobotModel:
    ROBOT = "<mujoco><worldbody><body name='box'><freejoint/><geom size='.1'/></body></worldbody></mujoco>"

    def test_a_body_falls_on_the_floor_and_stays_between_the_walls(self, tmp_path):
        write_mjcf(DIAGONAL, tmp_path / "maze.xml", for_robot=True)
        spec = mujoco.MjSpec.from_file(str(tmp_path / "maze.xml"))
        frame = spec.worldbody.add_frame(pos=[*DIAGONAL.point(DIAGONAL.free_cells[0]), 0.3])
        spec.attach(mujoco.MjSpec.from_string(self.ROBOT), prefix="my_", frame=frame)
        model = spec.compile()
        data = mujoco.MjData(model)
        for velocity in ((0, 0), (3, 0), (-3, 0), (0, 3), (0, -3)):  # it falls, and is thrown at walls
            data.qvel[:2] = velocity
            mujoco.mj_step(model, data, nstep=500)
            x, y, z = data.body("my_box").xpos
            assert z == pytest.approx(0.1, abs=1e-3)
            assert DIAGONAL.is_free(DIAGONAL.cell((x, y)))

    def test_pymjcf_attaches_it(self, tmp_path):
        mjcf = pytest.importorskip("dm_control.mjcf")
        write_mjcf(DIAGONAL, tmp_path / "maze.xml", for_robot=True)
        arena = mjcf.RootElement(model="arena")
        arena.attach(mjcf.from_path(str(tmp_path / "maze.xml")))
        assert mjcf.Physics.from_mjcf_model(arena).model.ngeom == len(cover(DIAGONAL.walls)) + 1


@pytest.mark.parametrize("name", ['a&b<c>"d', "ümläut", "two words"])
def test_a_name_is_escaped(name, tmp_path):
    write_mjcf(Maze(DIAGONAL.walls, name), tmp_path / "maze.xml")
    assert mujoco.MjSpec.from_file(str(tmp_path / "maze.xml")).modelname == name
