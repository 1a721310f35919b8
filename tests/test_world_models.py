"""Models of one set of mazes take each other's place; `python tests/test_world_models.py` rewrites the golden file."""

from __future__ import annotations

import pathlib
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest

from mazebench.constants import ACTIONS, STEPS_PER_ACTION
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.maps.text import parse_maze
from mazebench.world.export import write_mjcf
from mazebench.world.mjcf import action_controls
from mazebench.world.models import MazeModels, copy_maze
from mazebench.world.simulation import MujocoSimulation

CONTROLS = action_controls()
GOLDEN = pathlib.Path(__file__).parent / "golden" / "maze-5.xml"
# In MuJoCo's structs of options, what is no number or array of numbers is a struct of its own.
NESTED = ("opt", "stat", "vis", "global_", "headlight", "map", "quality", "rgba", "scale")


def golden_maze() -> Maze:
    return parse_maze("#####\n#..##\n##..#\n#...#\n#####", "maze-5")


def mazes(seed: int, count: int = 4) -> list[Maze]:
    """Of different kinds, so that the numbers of their wall boxes differ."""
    rng = np.random.default_rng(seed)
    return [generate(kind, 13, rng) for kind in ("dfs", "rooms", "obstacles", "dfs")[:count]]


def fields(struct: object, prefix: str = "") -> Iterator[tuple[str, object]]:
    """The names and values of all that a model holds."""
    for name in dir(struct):
        if name.startswith("_"):
            continue
        value = getattr(struct, name)
        if name in NESTED:
            yield from fields(value, f"{prefix}{name}.")
        elif isinstance(value, (np.ndarray, int, float, bytes)):
            yield f"{prefix}{name}", value


def differences(first: mujoco.MjModel, second: mujoco.MjModel) -> set[str]:
    return {
        name
        for (name, one), (_, other) in zip(fields(first), fields(second), strict=True)
        if not np.array_equal(one, other)
    }


class TestMazeModels:
    def test_padding_does_not_change_a_trajectory(self):
        first, second = sorted(mazes(3, count=2), key=lambda maze: MazeModels([maze])[0].ngeom)
        padded, alone = MazeModels([first, second])[0], MazeModels([first])[0]
        assert padded.ngeom > alone.ngeom
        assert drive(padded) == pytest.approx(drive(alone), abs=1e-9)


def drive(model: mujoco.MjModel) -> np.ndarray:
    """`[200, 2]` positions of a body that acts at random, each action a few steps long."""
    simulation, rng = MujocoSimulation(model), np.random.default_rng(7)
    action, positions = 0, []
    for _ in range(200):
        if rng.random() < 0.3:
            action = int(rng.integers(len(ACTIONS)))
        simulation.set_controls(CONTROLS[action])
        simulation.step(STEPS_PER_ACTION)
        positions.append(simulation.position())
    return np.array(positions)


class TestCopyMaze:
    @pytest.mark.parametrize("textures", [False, True])
    def test_a_copied_maze_is_the_same_model(self, textures):
        models = MazeModels(mazes(4), textures)
        target = MujocoSimulation(models[0]).model
        assert {"geom_pos", "geom_size"} <= differences(models[1], target)
        for index in (1, 2, 3, 0):
            copy_maze(models[index], target)
            assert differences(models[index], target) == set()


class TestMjcf:
    def test_the_mjcf_file_is_the_golden_one(self, tmp_path):
        write_mjcf(golden_maze(), tmp_path / "maze-5.xml")
        assert (tmp_path / "maze-5.xml").read_text(encoding="utf-8") == GOLDEN.read_text(encoding="utf-8")

    def test_plain_mujoco_opens_the_file(self):
        model = mujoco.MjModel.from_xml_path(str(GOLDEN))
        walls = [model.geom(index) for index in range(model.ngeom) if model.geom(index).name.startswith("wall_")]
        volume = sum(8 * np.prod(wall.size) for wall in walls)
        assert volume == pytest.approx(golden_maze().walls.sum())  # each wall cell is 1 m x 1 m x 1 m
        assert model.nu == 5
        np.testing.assert_allclose(model.key_qpos[0], (1.5, 3.5, 0))  # the first free cell, (1, 1)


if __name__ == "__main__":
    GOLDEN.parent.mkdir(exist_ok=True)
    write_mjcf(golden_maze(), GOLDEN)
