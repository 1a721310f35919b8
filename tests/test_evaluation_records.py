"""Records on disk: in order whatever the order of arrival, and whole again after a kill at any byte."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import shutil

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies

from mazebench.errors import InputError
from mazebench.records import EPISODES, JOURNAL, FolderLock, RecordLog, read_json, to_line, write_json


def record(index: int) -> dict:
    return {"episode": index, "success": index % 2 == 0, "path_length": index / 7}


def lines(*indices: int) -> str:
    return "".join(to_line(record(index)) for index in indices)


class TestLog:
    def test_files_when_episodes_end_out_of_order(self, tmp_path):
        with RecordLog(tmp_path, 5) as log:
            assert log.missing == [0, 1, 2, 3, 4]
            log.add([record(3), record(1)])
            assert (tmp_path / EPISODES).read_text() == ""
            assert (tmp_path / JOURNAL).read_text() == lines(3, 1)
            log.add([record(0)])
            assert (tmp_path / EPISODES).read_text() == lines(0, 1)
            log.add([record(2)])
            assert (tmp_path / EPISODES).read_text() == lines(0, 1, 2, 3)
            assert log.missing == [4]
            log.add([record(4)])
            assert log.missing == []
            assert log.records == [record(index) for index in range(5)]
            log.finish()
        assert (tmp_path / EPISODES).read_text() == lines(0, 1, 2, 3, 4)
        assert not (tmp_path / JOURNAL).exists()

    def test_journal_when_an_episode_follows_in_the_same_step(self, tmp_path):
        with RecordLog(tmp_path, 3) as log:
            log.add([record(1), record(0)])
            assert (tmp_path / EPISODES).read_text() == lines(0, 1)
            # What is in its place need not wait in the journal.
            assert (tmp_path / JOURNAL).read_text() == ""

    def test_log_when_resumed(self, tmp_path):
        with RecordLog(tmp_path, 6) as log:
            log.add([record(0), record(4), record(2)])
        with RecordLog(tmp_path, 6) as log:
            assert log.missing == [1, 3, 5]
            assert log.records == [record(0), record(2), record(4)]
            log.add([record(1)])
            assert (tmp_path / EPISODES).read_text() == lines(0, 1, 2)
            log.add([record(5), record(3)])
            log.finish()
        assert (tmp_path / EPISODES).read_text() == lines(*range(6))

    def test_log_when_killed_between_journal_and_episodes(self, tmp_path):
        # Episode 2 is in both files, 1 in the journal only.
        (tmp_path / EPISODES).write_text(lines(0))
        (tmp_path / JOURNAL).write_text(lines(2, 1))
        with RecordLog(tmp_path, 4) as log:
            assert log.missing == [3]
        assert (tmp_path / EPISODES).read_text() == lines(0, 1, 2)
        with RecordLog(tmp_path, 4) as log:
            log.add([record(3)])
            log.finish()
        assert (tmp_path / EPISODES).read_text() == lines(0, 1, 2, 3)

    def test_files_when_journal_goes(self, tmp_path):
        # All that is left to do on resuming is to put the journal's records in their places.
        (tmp_path / JOURNAL).write_text(lines(1, 0))
        with RecordLog(tmp_path, 2) as log:
            log.finish()
            # A kill could come now.
            assert (tmp_path / EPISODES).read_text() == lines(0, 1)

    def test_log_when_finished_run_is_opened(self, tmp_path):
        (tmp_path / EPISODES).write_text(lines(0, 1))
        with RecordLog(tmp_path, 2) as log:
            assert log.missing == []
            log.finish()
        assert (tmp_path / EPISODES).read_text() == lines(0, 1)
        assert not (tmp_path / JOURNAL).exists()

    @pytest.mark.parametrize("name", [EPISODES, JOURNAL])
    @pytest.mark.parametrize("half", ["{", '{"episode":1,"suc', '{"episode":1}', "\x00\x00\x00"])
    def test_last_line_when_cut_short(self, tmp_path, name, half):
        (tmp_path / name).write_text(lines(0) + half)
        with RecordLog(tmp_path, 2) as log:
            assert log.missing == [1]
            log.add([record(1)])
            log.finish()
        assert (tmp_path / EPISODES).read_text() == lines(0, 1)

    @pytest.mark.parametrize("name", [EPISODES, JOURNAL])
    @pytest.mark.parametrize(
        "line", ["rubbish", "{", "[]", "null", "7", "{}", '{"episode":"1"}', '{"episode":null}', ""]
    )
    def test_whole_line_when_corrupted(self, tmp_path, name, line):
        content = lines(0) + line + "\n" + lines(2)
        (tmp_path / name).write_text(content)
        with pytest.raises(InputError, match=rf"{name}: expected a record in line 2, found b'"):
            RecordLog(tmp_path, 3)
        assert (tmp_path / name).read_text() == content

    def test_whole_line_when_not_text(self, tmp_path):
        (tmp_path / EPISODES).write_bytes(b"\xff\xfe\n")
        with pytest.raises(InputError, match=r"episodes\.jsonl: expected a record in line 1, found"):
            RecordLog(tmp_path, 3)

    def test_record_when_not_a_number(self, tmp_path):
        with RecordLog(tmp_path, 1) as log, pytest.raises(ValueError, match="not JSON compliant"):
            log.add([{"episode": 0, "spl": float("nan")}])

    @hypothesis.settings(max_examples=60, deadline=None)
    @hypothesis.given(strategies.integers(0, 2**32 - 1))
    def test_files_when_killed_at_arbitrary_bytes(self, tmp_path_factory, seed):
        rng = np.random.default_rng(seed)
        folder = tmp_path_factory.getbasetemp() / "killed"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        order, missing = rng.permutation(12).tolist(), []
        while order:
            with RecordLog(folder, 12) as log:
                missing = log.missing
                order = [index for index in order if index in missing]
                for index in order[: int(rng.integers(1, 6))]:
                    log.add([record(index)])
            for name in (EPISODES, JOURNAL):
                with (folder / name).open("r+b") as file:
                    file.truncate(max(0, (folder / name).stat().st_size - int(rng.integers(0, 60))))
            with RecordLog(folder, 12) as log:
                order = [index for index in rng.permutation(12).tolist() if index in log.missing]
                assert log.records == [record(index) for index in range(12) if index not in order]
        assert (folder / EPISODES).read_text() == lines(*range(12))


class TestJson:
    def test_json_when_written_and_read(self, tmp_path):
        content = {"a": [1, 2.5, None, "ä"], "b": {"c": True}}
        write_json(tmp_path / "x.json", content)
        assert read_json(tmp_path / "x.json") == content
        assert [path.name for path in tmp_path.iterdir()] == ["x.json"]

    @pytest.mark.parametrize("content", [{"a": object()}, {"a": float("nan")}, {"a": np.float32(1)}])
    def test_old_file_when_new_content_cannot_be_written(self, tmp_path, content):
        write_json(tmp_path / "x.json", {"old": 1})
        with pytest.raises((TypeError, ValueError)):
            write_json(tmp_path / "x.json", content)
        assert read_json(tmp_path / "x.json") == {"old": 1}

    def test_float_when_written_and_read(self, tmp_path):
        values = np.random.default_rng(0).normal(size=100).tolist()
        write_json(tmp_path / "x.json", values)
        assert read_json(tmp_path / "x.json") == values
        assert json.loads(to_line({"values": values}))["values"] == values

    def test_read_when_missing_or_no_json(self, tmp_path):
        with pytest.raises(InputError, match=r"none\.json: can't read the file: No such file or directory$"):
            read_json(tmp_path / "none.json")
        (tmp_path / "half.json").write_text('{"a": ')
        with pytest.raises(InputError, match=r"half\.json: expected JSON, found "):
            read_json(tmp_path / "half.json")
        (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
        with pytest.raises(InputError, match=r"binary\.json: expected JSON, found "):
            read_json(tmp_path / "binary.json")


def test_lock_when_the_file_system_has_none(tmp_path, monkeypatch):
    def flock(descriptor: int, operation: int) -> None:
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    monkeypatch.setattr(fcntl, "flock", flock)
    with pytest.raises(InputError, match="expected a file system that can lock, found: Function not implemented"):
        FolderLock(tmp_path)
