"""Trajectories on disk: what was driven and shown, whole after a kill at any byte, and no harm from damaged files."""

from __future__ import annotations

import contextlib
import io
import json
import pathlib
import shutil
import zipfile

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies

from mazebench.errors import InputError
from mazebench.evaluation.harness import EvalOptions, evaluate, is_finished
from mazebench.evaluation.protocol import frozen_trials
from mazebench.evaluation.trajectories import (
    JOURNAL,
    TRAJECTORIES,
    Trajectory,
    TrajectoryLog,
    load_trajectories,
    pack_trajectories,
    save_trajectories,
)
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.maze import cell_to_point, point_to_cell
from mazebench.tasks.context import GLOBAL_MAP
from mazebench.tasks.registry import make_spec

HALF = np.float16(0.5)


def episode(index: int, size: int = 5) -> Trajectory:
    """A made-up one whose arrays all tell its index."""
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
    def test_arrays_when_read_with_numpy_alone(self, file):
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

    def test_episodes_when_read(self, file):
        trajectories = load_trajectories(file, 3)
        assert (len(trajectories), trajectories.size) == (3, 5)
        for index in range(3):
            assert_same(trajectories[index], episode(index))

    @pytest.mark.parametrize("size", [*range(5, 22), 254, 255])
    def test_size_when_only_bytes_tell_it(self, tmp_path, size):
        save_trajectories(tmp_path / "x.npz", pack_trajectories([episode(1, size)]))
        trajectories = load_trajectories(tmp_path / "x.npz", 1)
        assert trajectories.size == size
        assert_same(trajectories[0], episode(1, size))

    def test_bytes_when_written_again(self, file, tmp_path):
        save_trajectories(tmp_path / "y.npz", load_trajectories(file, 3))
        assert (tmp_path / "y.npz").read_bytes() == file.read_bytes()


class TestDamage:
    @pytest.mark.parametrize(
        ("name", "value", "said"),
        [
            ("format", np.array("mazebench-trajectories-2"), "another format"),
            ("format", np.array(7), "an array of int64"),
            ("length", np.array([2, 3], dtype=np.int32), "expected trajectories of 3 episodes, found 2"),
            ("length", np.array([2, 3, 4]), "an array of int64"),
            ("length", np.array([2, 3, 5], dtype=np.int32), r"expected pose of shape \(10, 3\), found \(9, 3\)"),
            ("length", np.array([10, -3, 2], dtype=np.int32), "expected a pose and a goal in every episode"),
            ("length", np.array([2**31 - 1] * 3, dtype=np.int32), r"expected pose of shape \(6442450941, 3\)"),
            ("num_landmarks", np.array([0, 3, 3], dtype=np.int32), "expected a pose and a goal in every episode"),
            ("pose", np.zeros((9, 2), dtype=np.float16), r"found \(9, 2\)"),
            ("pose", np.full((9, 3), np.nan, dtype=np.float16), "expected finite poses"),
            ("pose", np.zeros((9, 3), dtype=np.float16, order="F"), "an array of float16"),
            ("pose", np.array([[None] * 3] * 9), "an array of object"),
            ("shown", np.zeros((3, 3), dtype=np.uint8), r"expected 3 maps of N x N cells, found shape \(3, 3\)"),
            ("shown", np.zeros((2, 4), dtype=np.uint8), r"found shape \(2, 4\)"),
            ("shown", np.zeros(12, dtype=np.uint8), r"found shape \(12,\)"),
            ("landmark", np.array([0, 1, 2, 2, 3, 25], dtype=np.int32), "expected landmarks from 0 to 24"),
            ("landmark", np.array([0, 1, 2, 2, 3, -1], dtype=np.int32), "expected landmarks from 0 to 24"),
        ],
    )
    def test_file_when_an_array_is_wrong(self, file, name, value, said):
        np.savez(file, **{**arrays_of(file), name: value})
        with pytest.raises(InputError, match=rf"x\.npz: (expected .*)?{said}"):
            load_trajectories(file, 3)

    def test_file_when_an_array_is_missing(self, file):
        arrays = arrays_of(file)
        del arrays["shown"]
        np.savez(file, **arrays)
        with pytest.raises(InputError, match=r"x\.npz: expected trajectories .*found a damaged file: .*shown\.npy"):
            load_trajectories(file, 3)

    def test_file_when_missing_or_no_archive(self, tmp_path):
        with pytest.raises(InputError, match=r"none\.npz: can't read the trajectories: No such file"):
            load_trajectories(tmp_path / "none.npz", 1)
        with pytest.raises(InputError, match="can't read the trajectories: Is a directory"):
            load_trajectories(tmp_path, 1)
        (tmp_path / "empty.npz").touch()
        with pytest.raises(InputError, match="found a damaged file"):
            load_trajectories(tmp_path / "empty.npz", 1)

    def test_file_when_it_would_unpack_to_gigabytes(self, tmp_path):
        with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
            for index in range(5):
                archive.writestr(f"{index}.npy", bytes(2**26))
        assert (tmp_path / "bomb.npz").stat().st_size < 2**21
        with pytest.raises(InputError, match="bytes of content, more than 268435456"):
            load_trajectories(tmp_path / "bomb.npz", 1)

    def test_file_when_a_header_promises_more_than_there_is(self, file):
        content = io.BytesIO()
        np.lib.format.write_array_header_1_0(content, {"descr": "<f2", "fortran_order": False, "shape": (2**40, 3)})
        with zipfile.ZipFile(file) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        with zipfile.ZipFile(file, "w") as archive:
            for name, member in {**members, "pose.npy": content.getvalue()}.items():
                archive.writestr(name, member)
        with pytest.raises(InputError, match="0 bytes for an array of shape"):
            load_trajectories(file, 3)

    @hypothesis.settings(max_examples=200, deadline=None)
    @hypothesis.given(strategies.integers(0, 2**32 - 1))
    def test_file_when_bytes_are_changed_or_cut(self, tmp_path_factory, seed):
        rng = np.random.default_rng(seed)
        path = tmp_path_factory.getbasetemp() / "changed.npz"
        save_trajectories(path, pack_trajectories([episode(index) for index in range(4)]))
        content = bytearray(path.read_bytes())
        for place in rng.integers(len(content), size=int(rng.integers(0, 4))).tolist():
            content[place] = int(rng.integers(256))
        path.write_bytes(content[: int(rng.integers(len(content) + 1))] if rng.random() < 0.5 else content)
        with contextlib.suppress(InputError):
            trajectories = load_trajectories(path, 4)
            # Only what no checksum guards was hit.
            for index in range(4):
                assert_same(trajectories[index], episode(index))


class TestLog:
    def test_files_when_episodes_end_out_of_order(self, tmp_path):
        with TrajectoryLog(tmp_path, 3, 5) as log:
            log.add({2: episode(2)})
            log.add({0: episode(0)})
            assert log.missing == [1]
        assert [path.name for path in tmp_path.iterdir()] == [JOURNAL]
        with TrajectoryLog(tmp_path, 3, 5) as log:
            assert log.missing == [1]
            log.add({1: episode(1)})
            log.finish()
        assert [path.name for path in tmp_path.iterdir()] == [TRAJECTORIES]
        trajectories = load_trajectories(tmp_path / TRAJECTORIES, 3)
        for index in range(3):
            assert_same(trajectories[index], episode(index))

    def test_log_when_finished_run_is_opened(self, tmp_path):
        with TrajectoryLog(tmp_path, 2, 5) as log:
            log.add({0: episode(0), 1: episode(1)})
            log.finish()
        before = (tmp_path / TRAJECTORIES).read_bytes()
        with TrajectoryLog(tmp_path, 2, 5) as log:
            assert log.missing == []
            log.finish()
        assert (tmp_path / TRAJECTORIES).read_bytes() == before

    def test_log_when_its_trajectories_are_of_other_episodes(self, tmp_path):
        save_trajectories(tmp_path / TRAJECTORIES, pack_trajectories([episode(0)]))
        with pytest.raises(InputError, match=r"trajectories\.npz: expected trajectories of 2 episodes, found 1"):
            TrajectoryLog(tmp_path, 2, 5)

    @hypothesis.settings(max_examples=60, deadline=None)
    @hypothesis.given(strategies.integers(0, 2**32 - 1))
    def test_journal_when_cut_or_changed_anywhere(self, tmp_path_factory, seed):
        rng = np.random.default_rng(seed)
        folder = tmp_path_factory.getbasetemp() / "journal"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        order = rng.permutation(8).tolist()
        with TrajectoryLog(folder, 8, 5) as log:
            for index in order:
                log.add({index: episode(index)})
        content = bytearray((folder / JOURNAL).read_bytes())
        if rng.random() < 0.5:
            content[int(rng.integers(len(content)))] ^= 1 << int(rng.integers(8))
        (folder / JOURNAL).write_bytes(content[: int(rng.integers(len(content) + 1))])
        with TrajectoryLog(folder, 8, 5) as log:
            # A beginning of what was added is left.
            assert set(log.missing) == set(order[8 - len(log.missing) :])
            log.add({index: episode(index) for index in log.missing})
            log.finish()
        trajectories = load_trajectories(folder / TRAJECTORIES, 8)
        for index in range(8):
            assert_same(trajectories[index], episode(index))


RANDOM = EvalOptions("random", distances=(1, 3), episodes_per_distance=1)
RECORDED = {"config.json", "episodes.jsonl", "summary.json", TRAJECTORIES}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("runs") / "random"
    evaluate(RANDOM, folder, record=True)
    return folder


def records_of(folder: pathlib.Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]


class TestRecording:
    @pytest.mark.parametrize(
        "options",
        [
            RANDOM,
            EvalOptions("planner", task="hierarchical", landmark_distance=3),
            EvalOptions("planner-closed-loop", distances=(4,), position_noise=0.3),
        ],
        ids=["local", "hierarchical", "noise"],
    )
    def test_poses_when_compared_with_records(self, tmp_path, options):
        summary = evaluate(options, tmp_path, record=True, num_envs=11)
        records = records_of(tmp_path)
        trajectories = load_trajectories(tmp_path / TRAJECTORIES, summary["episodes"])
        walls = {maze.name: maze.walls for maze in load_mazes(13, "eval")}
        for index, record in enumerate(records):
            found = trajectories[index]
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
            assert len(found.landmarks) == (1 if options.task == "local" else -(-record["distance"] // 3))
            assert np.abs(found.pose[:, 2]).max() <= np.pi

    @pytest.mark.parametrize("change", [{"map_flip": 0.2}, {"map_warp": 0.2}], ids=["flip", "warp"])
    def test_map_when_it_is_perturbed(self, tmp_path, change):
        options = EvalOptions("random", task="hierarchical", **change)
        evaluate(options, tmp_path, record=True)
        spec = make_spec("hierarchical", 13, "eval", **change)
        trajectories = load_trajectories(tmp_path / TRAJECTORIES, 20)
        num_changed = 0
        for trial, found in zip(frozen_trials("hierarchical", 13), trajectories, strict=True):
            episode = trial.episode
            context = spec.context(spec.show(episode), episode.start, episode.goal)
            np.testing.assert_array_equal(found.shown, context[GLOBAL_MAP])
            assert found.landmarks[-1] == 11 * 13 + 1  # the goal stays where it is in the world
            num_changed += (found.shown != spec.mazes[episode.maze].walls).sum()
        assert num_changed > 100

    def test_yaw_when_agent_turns(self, tmp_path, monkeypatch):
        (tmp_path / "turning_at_hand.py").write_text(
            "import numpy as np\n"
            "class Turning:\n"
            "    @classmethod\n"
            "    def build(cls, interface, *, seed=0, checkpoint=None):\n"
            "        return cls()\n"
            "    def initial_state(self, batch_size):\n"
            "        return None\n"
            "    def act(self, observation, is_first, state, explore=False):\n"
            "        return np.full(len(is_first), 4), state\n"
        )
        monkeypatch.syspath_prepend(tmp_path)
        options = EvalOptions("turning_at_hand:Turning", distances=(2,), episodes_per_distance=1)
        evaluate(options, tmp_path / "out", record=True)
        yaw = load_trajectories(tmp_path / "out" / TRAJECTORIES, 20)[0].pose[:, 2].astype(float)
        turned = np.angle(np.exp(1j * np.diff(yaw)))
        # To the left by 21.12 degrees a step, but for the first one.
        np.testing.assert_allclose(np.degrees(turned[2:]), 21.12, atol=0.25)

    def test_records_when_recorded_or_not(self, recorded, tmp_path):
        evaluate(RANDOM, tmp_path)
        assert {path.name for path in recorded.iterdir()} == RECORDED
        assert {path.name for path in tmp_path.iterdir()} == RECORDED - {TRAJECTORIES}
        assert (tmp_path / "episodes.jsonl").read_bytes() == (recorded / "episodes.jsonl").read_bytes()


class TestResuming:
    @pytest.mark.parametrize("seed", range(4))
    def test_run_when_killed_at_an_arbitrary_place(self, recorded, tmp_path, seed):
        rng = np.random.default_rng(seed)
        shutil.copy(recorded / "config.json", tmp_path)
        lines = (recorded / "episodes.jsonl").read_bytes().splitlines(keepends=True)
        (tmp_path / "episodes.jsonl").write_bytes(b"".join(lines[: int(rng.integers(len(lines)))]))
        whole = load_trajectories(recorded / TRAJECTORIES, len(lines))
        with TrajectoryLog(tmp_path, len(lines), 13) as log:
            log.add({int(index): whole[index] for index in rng.permutation(len(lines))[: int(rng.integers(30))]})
        with (tmp_path / JOURNAL).open("ab") as journal:
            journal.write(rng.bytes(int(rng.integers(50))))
        # What began with trajectories goes on with them, whatever is said now.
        evaluate(RANDOM, tmp_path, resume=True, record=bool(seed % 2))
        assert {path.name for path in tmp_path.iterdir()} == RECORDED
        for name in ("episodes.jsonl", TRAJECTORIES):
            assert (tmp_path / name).read_bytes() == (recorded / name).read_bytes()

    def test_run_when_trajectories_are_wanted_later(self, recorded, tmp_path):
        evaluate(RANDOM, tmp_path)
        assert is_finished(tmp_path)
        assert not is_finished(tmp_path, record=True)
        evaluate(RANDOM, tmp_path, resume=True, record=True)
        assert is_finished(tmp_path, record=True)
        for name in ("episodes.jsonl", TRAJECTORIES):
            assert (tmp_path / name).read_bytes() == (recorded / name).read_bytes()
