"""Trajectories on disk: where the body was; a damaged file is named."""

from __future__ import annotations

import numpy as np
import pytest
from run_folders import FEW, FILES, RECORDED, records_of

from mazebench.errors import InputError
from mazebench.evaluation.evaluate import evaluate
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.maze import cell_to_point, point_to_cell
from mazebench.results.trajectories import TRAJECTORIES, Trajectory, load_trajectories, save_trajectories

POSES = np.arange(15, dtype=np.float32).reshape(5, 3)


@pytest.mark.parametrize("observed", [None, -POSES], ids=["paper", "track"])
def test_what_is_read_is_what_was_written_and_numpy_alone_can_read_it(tmp_path, observed):
    parts = [slice(2), slice(2, 5)]
    save_trajectories(
        tmp_path / "x.npz", [Trajectory(POSES[part], None if observed is None else observed[part]) for part in parts]
    )
    with np.load(tmp_path / "x.npz", allow_pickle=False) as arrays:
        assert arrays["length"].tolist() == [2, 3]
        assert (arrays["pose"] == POSES).all()
    for part, found in zip(parts, load_trajectories(tmp_path / "x.npz"), strict=True):
        np.testing.assert_array_equal(found.pose, POSES[part], strict=True)
        if observed is not None:
            np.testing.assert_array_equal(found.observed, observed[part], strict=True)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "can't read the file of trajectories: No such file"),
        (b"", "expected a file of trajectories, found a damaged file"),
    ],
)
def test_a_file_that_is_missing_or_damaged_is_named(tmp_path, content, said):
    if content is not None:
        (tmp_path / "x.npz").write_bytes(content)
    with pytest.raises(InputError, match=rf"x\.npz: {said}"):
        load_trajectories(tmp_path / "x.npz")


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
        evaluate(agent, out=tmp_path, record=True, num_envs=11, **options)
        trajectories = load_trajectories(tmp_path / TRAJECTORIES)
        walls = {maze.name: maze.walls for maze in load_mazes(13, "eval")}
        for record, found in zip(records_of(tmp_path), trajectories, strict=True):
            position = found.pose[:, :2].astype(float)
            assert len(position) == record["steps"] + 1
            np.testing.assert_array_equal(position[0], cell_to_point(tuple(record["start"]), 13))
            # As it truly was, without the noise.
            driven = np.linalg.norm(np.diff(position, axis=0), axis=1).sum()
            assert driven == pytest.approx(record["path_length"], abs=1e-5 * record["steps"])
            assert point_to_cell(position[-1], 13).tolist() == record["goal"] or not record["success"]
            assert not walls[record["maze"]][tuple(point_to_cell(position, 13).T)].any()
            assert np.abs(found.pose[:, 2]).max() <= np.pi

    def test_the_observed_path_is_the_true_one_in_the_frame_of_the_first_pose(self, tmp_path):
        evaluate("random", out=tmp_path, record=True, task="adrift", distances=(15,), odometry_noise=0.0)
        for found in load_trajectories(tmp_path / TRAJECTORIES):
            true, observed = found.pose.astype(float), found.observed.astype(float)
            assert not observed[0].any()
            cosine, sine = np.cos(true[0, 2]), np.sin(true[0, 2])
            expected = (true - true[0])[:, :2] @ [[cosine, -sine], [sine, cosine]]
            np.testing.assert_allclose(observed[:, :2], expected, atol=0.02)

    def test_records_are_the_same_without_trajectories(self, tmp_path):
        for name, record, files in (("with", True, RECORDED), ("without", False, FILES)):
            evaluate("random", out=tmp_path / name, record=record, **FEW)
            assert {path.name for path in (tmp_path / name).iterdir()} == files
        assert records_of(tmp_path / "with") == records_of(tmp_path / "without")
