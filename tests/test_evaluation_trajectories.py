"""Trajectories on disk: what was driven and shown; a damaged file is named."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest
from run_folders import FEW, FILES, RECORDED, records_of

from mazebench.agent import SingleAgent
from mazebench.errors import InputError
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.trajectories import (
    TRAJECTORIES,
    Trajectory,
    load_trajectories,
    pack_trajectories,
    save_trajectories,
)
from mazebench.evaluation.trials import frozen_trials
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.maze import cell_to_point, point_to_cell
from mazebench.tasks.registry import make_spec
from mazebench.tasks.shown_map import show_map

HALF = np.float16(0.5)


def episode(index: int, size: int = 5) -> Trajectory:
    """Returns a made-up trajectory whose arrays all tell its index."""
    shown = np.arange(size * size).reshape(size, size) % (index + 2) == 0
    pose = np.full((index + 2, 3), index, dtype=np.float16) + np.arange(index + 2, dtype=np.float16)[:, None] * HALF
    return Trajectory(pose, shown, np.arange(index % 3 + 1, dtype=np.int32) + index)


def assert_same(found: Trajectory, expected: Trajectory) -> None:
    for name in ("pose", "shown", "landmarks"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), strict=True)


def arrays_of(path: pathlib.Path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as content:
        return {name: content[name] for name in content.files}


@pytest.fixture
def file(tmp_path) -> pathlib.Path:
    save_trajectories(tmp_path / "x.npz", pack_trajectories([episode(0), episode(1), episode(2)]))
    return tmp_path / "x.npz"


class TestFile:
    def test_numpy_alone_can_read_it(self, file):
        arrays = arrays_of(file)
        assert {name: (value.dtype.str, value.shape) for name, value in arrays.items()} == {
            "format": ("<U24", ()),
            "length": ("<i4", (3,)),
            "pose": ("<f2", (2 + 3 + 4, 3)),
            "shown": ("|u1", (3, 4)),  # 25 cells in 4 bytes
            "num_landmarks": ("<i4", (3,)),
            "landmark": ("<i4", (1 + 2 + 3,)),
        }
        assert str(arrays["format"]) == "mazebench-trajectories-1"
        assert arrays["length"].tolist() == [2, 3, 4]
        assert arrays["landmark"].tolist() == [0, 1, 2, 2, 3, 4]
        # Every other cell, row by row: 1010 1010 ..., and the 25th alone in its byte.
        assert arrays["shown"][0].tolist() == [0b10101010] * 3 + [0b10000000]

    def test_what_is_read_is_what_was_written(self, file, tmp_path):
        trajectories = load_trajectories(file, 3)
        assert (len(trajectories), trajectories.size) == (3, 5)
        for index in range(3):
            assert_same(trajectories[index], episode(index))
        save_trajectories(tmp_path / "y.npz", trajectories)
        assert (tmp_path / "y.npz").read_bytes() == file.read_bytes()

    @pytest.mark.parametrize("size", [5, 6, 13, 254, 255])
    def test_the_size_of_the_maps_follows_from_their_bytes(self, tmp_path, size):
        save_trajectories(tmp_path / "x.npz", pack_trajectories([episode(1, size)]))
        trajectories = load_trajectories(tmp_path / "x.npz", 1)
        assert trajectories.size == size
        assert_same(trajectories[0], episode(1, size))


class TestDamage:
    @pytest.mark.parametrize(
        ("name", "value", "said"),
        [
            ("format", np.array("mazebench-trajectories-2"), "another format"),
            ("length", np.array([2, 3], dtype=np.int32), "expected trajectories of 3 episodes, found 2"),
            ("length", np.array([2, 3, 5], dtype=np.int32), r"expected pose of shape \(10, 3\), found \(9, 3\)"),
            ("length", np.array([10, -3, 2], dtype=np.int32), "expected a pose and a goal in every episode"),
            ("pose", np.full((9, 3), np.nan, dtype=np.float16), "expected finite poses"),
            ("landmark", np.array([0, 1, 2, 2, 3, 25], dtype=np.int32), "expected landmarks from 0 to 24"),
            ("shown", None, "damaged file"),
        ],
    )
    def test_an_array_that_cannot_be_is_refused(self, file, name, value, said):
        arrays = arrays_of(file) | {name: value}
        np.savez(file, **{name: value for name, value in arrays.items() if value is not None})
        with pytest.raises(InputError, match=rf"x\.npz: (expected .*)?{said}"):
            load_trajectories(file, 3)

    def test_a_file_that_is_missing_or_no_archive_is_named(self, tmp_path):
        with pytest.raises(InputError, match=r"none\.npz: can't read the trajectories: No such file"):
            load_trajectories(tmp_path / "none.npz", 1)
        (tmp_path / "empty.npz").touch()
        with pytest.raises(InputError, match=r"empty\.npz: expected trajectories .*, found a damaged file"):
            load_trajectories(tmp_path / "empty.npz", 1)


class Turning(SingleAgent):
    """Turns left on the spot."""

    def act(self, observation):
        return 4


class TestRecording:
    @pytest.mark.parametrize(
        ("agent", "options"),
        [
            ("random", FEW),
            ("planner", {"task": "hierarchical", "landmark_distance": 3}),
            ("planner-closed-loop", {"distances": (4,), "position_noise": 0.3}),
        ],
        ids=["local", "hierarchical", "noise"],
    )
    def test_poses_are_those_that_the_records_tell_of(self, tmp_path, agent, options):
        summary = evaluate(agent, tmp_path, record=True, num_envs=11, **options)
        trajectories = load_trajectories(tmp_path / TRAJECTORIES, summary.episodes)
        walls = {maze.name: maze.walls for maze in load_mazes(13, "eval")}
        for record, found in zip(records_of(tmp_path), trajectories, strict=True):
            position = found.pose[:, :2].astype(float)
            assert len(position) == record["steps"] + 1
            np.testing.assert_array_equal(position[0], cell_to_point(tuple(record["start"]), 13))
            # As it truly was, without the noise; float16 rounds to 4 mm at most here, at either end of a step.
            driven = np.linalg.norm(np.diff(position, axis=0), axis=1).sum()
            assert driven == pytest.approx(record["path_length"], abs=0.012 * record["steps"])
            last = tuple(point_to_cell(position[-1], 13).tolist())
            # A rounded position may lie on the border of the cell.
            is_there = last == tuple(record["goal"]) or np.abs(position[-1] - np.round(position[-1])).min() < 0.01
            assert is_there or not record["success"]
            assert not walls[record["maze"]][tuple(point_to_cell(position, 13).T)].any()
            np.testing.assert_array_equal(found.shown, walls[record["maze"]])
            assert found.landmarks[-1] == record["goal"][0] * 13 + record["goal"][1]
            assert len(found.landmarks) == (-(-record["distance"] // 3) if record["task"] == "hierarchical" else 1)
            assert np.abs(found.pose[:, 2]).max() <= np.pi

    @pytest.mark.parametrize("level", [{"map_flip": 0.2}, {"map_warp": 0.2}], ids=["flip", "warp"])
    def test_the_map_is_the_one_that_the_agent_was_shown(self, tmp_path, level):
        evaluate("random", tmp_path, record=True, task="hierarchical", **level)
        spec = make_spec("hierarchical", 13, "eval", **level)
        trajectories = load_trajectories(tmp_path / TRAJECTORIES, 20)
        num_changed = 0
        for trial, found in zip(frozen_trials("hierarchical", 13), trajectories, strict=True):
            np.testing.assert_array_equal(found.shown, show_map(spec, trial.episode).seen_walls())
            assert found.landmarks[-1] == 11 * 13 + 1  # the goal stays where it is in the world
            num_changed += (found.shown != spec.mazes[trial.episode.maze].walls).sum()
        assert num_changed > 100

    def test_yaw_follows_the_body(self, tmp_path):
        evaluate(Turning, tmp_path, record=True, distances=(2,), episodes_per_distance=1)
        yaw = load_trajectories(tmp_path / TRAJECTORIES, 20)[0].pose[:, 2].astype(float)
        turned = np.angle(np.exp(1j * np.diff(yaw)))
        # To the left by 21.12 degrees a step, once it has got going.
        np.testing.assert_allclose(np.degrees(turned[2:]), 21.12, atol=0.25)

    def test_records_are_the_same_without_trajectories(self, tmp_path):
        for name, record, files in (("with", True, RECORDED), ("without", False, FILES)):
            evaluate("random", tmp_path / name, record=record, **FEW)
            assert {path.name for path in (tmp_path / name).iterdir()} == files
        assert records_of(tmp_path / "with") == records_of(tmp_path / "without")
