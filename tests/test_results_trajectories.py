"""Trajectories on disk: what was driven and shown; a damaged file is named."""

from __future__ import annotations

import dataclasses
import pathlib

import numpy as np
import pytest
from run_folders import FEW, FILES, RECORDED, records_of

from mazebench.agent import SingleAgent
from mazebench.errors import InputError
from mazebench.evaluation.evaluate import evaluate
from mazebench.maps.benchmark import KINDS_VERSION, load_mazes
from mazebench.maps.maze import cell_to_point, point_to_cell
from mazebench.results.trajectories import (
    TRAJECTORIES,
    Trajectory,
    from_json,
    load_trajectories,
    pack_trajectories,
    save_trajectories,
    to_json,
)
from mazebench.tasks.build import make_spec
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START
from mazebench.tasks.shown_map import leg_context, show_map
from mazebench.tasks.trials import frozen_trials

HALF = np.float16(0.5)


def episode(index: int, size: int = 5) -> Trajectory:
    """Returns a made-up trajectory whose arrays all tell its index."""
    shown = np.arange(size * size).reshape(size, size) % (index + 2) == 0
    pose = np.full((index + 2, 3), index, dtype=np.float16) + np.arange(index + 2, dtype=np.float16)[:, None] * HALF
    return Trajectory(pose, shown, np.arange(index % 3 + 1, dtype=np.int32) + index)


def track_episode(index: int) -> Trajectory:
    """Returns a made-up trajectory of a track on which the map is drawn and the pose is odometry."""
    made = episode(index)
    marks = np.array([-1, index], dtype=np.int32)
    picture = np.full((6, 6), 40 * index, dtype=np.uint8)
    return dataclasses.replace(made, marks=marks, picture=picture, observed=-made.pose)


def assert_same(found: Trajectory, expected: Trajectory) -> None:
    for field in dataclasses.fields(Trajectory):
        ours, theirs = getattr(found, field.name), getattr(expected, field.name)
        assert (ours is None) == (theirs is None)
        if ours is not None:
            np.testing.assert_array_equal(ours, theirs, strict=True)


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

    def test_on_tracks_it_has_arrays_more(self, tmp_path):
        save_trajectories(tmp_path / "x.npz", pack_trajectories([track_episode(0), track_episode(1)]))
        arrays = arrays_of(tmp_path / "x.npz")
        assert {name: (arrays[name].dtype.str, arrays[name].shape) for name in [*arrays][6:]} == {
            "marks": ("<i4", (2, 2)),
            "picture": ("|u1", (2, 6, 6)),
            "observed": ("<f2", (2 + 3, 3)),
        }
        trajectories = load_trajectories(tmp_path / "x.npz", 2)
        for index in range(2):
            assert_same(trajectories[index], track_episode(index))

    @pytest.mark.parametrize(
        ("made", "more"), [(episode(2), []), (track_episode(2), ["marks", "picture", "observed"])], ids=["v1", "track"]
    )
    def test_a_line_of_the_journal_holds_one_episode(self, made, more):
        content = to_json(made)
        assert list(content) == ["pose", "shown", "landmarks", *more]
        assert_same(from_json(content, 5), made)

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

    @pytest.mark.parametrize(
        ("name", "value", "said"),
        [
            ("marks", np.array([[-1, 0], [-1, 36], [0, 0]], dtype=np.int32), "expected marks from -1 to 35"),
            ("marks", np.zeros((2, 2), dtype=np.int32), r"expected marks of shape \(3, 2\), found \(2, 2\)"),
            ("picture", np.zeros((3, 6, 7), dtype=np.uint8), "expected 3 pictures of M x M pixels, found shape"),
            ("picture", np.zeros((3, 6, 6)), "damaged file: picture of type float64, not uint8"),
            ("observed", np.zeros((8, 3), dtype=np.float16), "expected 9 finite observed poses"),
        ],
    )
    def test_an_array_of_a_track_that_cannot_be_is_refused(self, tmp_path, name, value, said):
        save_trajectories(tmp_path / "x.npz", pack_trajectories([track_episode(index) for index in range(3)]))
        np.savez(tmp_path / "x.npz", **arrays_of(tmp_path / "x.npz") | {name: value})
        with pytest.raises(InputError, match=said):
            load_trajectories(tmp_path / "x.npz", 3)

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

    @pytest.mark.parametrize(("track", "level"), [("rebuilt", 1), ("adrift", 1), ("adrift", 2), ("rough", 3)])
    def test_on_a_track_it_is_what_the_agent_was_given(self, tmp_path, track, level):
        summary = evaluate("random", tmp_path, record=True, track=track, level=level, distances=(15,))
        spec = make_spec(track, split="eval", level=level)
        trials = [trial for trial in frozen_trials("local", 31, KINDS_VERSION) if trial.distance == 15]
        trajectories = load_trajectories(tmp_path / TRAJECTORIES, summary.episodes)
        for trial, found in list(zip(trials, trajectories, strict=True))[:2]:
            shown = show_map(spec, trial.episode)
            context = leg_context(spec, shown, trial.episode.start, trial.episode.goal)
            np.testing.assert_array_equal(found.shown, shown.walls)
            if track == "rough":
                np.testing.assert_array_equal(found.picture, np.rint(context[GLOBAL_MAP] * 255))
            else:
                assert found.picture is None
            assert found.marks[1] == context[GOAL].argmax()
            assert found.marks[0] == (-1 if level > 1 else context[START].argmax())
            assert (found.observed is not None) == (track != "rebuilt")

    def test_the_observed_path_is_the_true_one_in_the_frame_of_the_first_pose(self, tmp_path):
        summary = evaluate("random", tmp_path, record=True, track="adrift", distances=(15,), odometry_noise=0.0)
        for found in load_trajectories(tmp_path / TRAJECTORIES, summary.episodes):
            true, observed = found.pose.astype(float), found.observed.astype(float)
            assert not observed[0].any()
            cosine, sine = np.cos(true[0, 2]), np.sin(true[0, 2])
            expected = (true - true[0])[:, :2] @ [[cosine, -sine], [sine, cosine]]
            np.testing.assert_allclose(observed[:, :2], expected, atol=0.02)

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
