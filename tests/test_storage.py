"""Files on disk: read up to a limit, written whole, and never unpickled."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest

from mazebench.errors import InputError
from mazebench.storage.arrays import read_arrays
from mazebench.storage.files import open_whole, read_at_most
from mazebench.storage.json_files import parse_json, read_json, repair_and_read_lines, to_line, write_json
from mazebench.storage.locks import FolderLock

DTYPES = {"a": np.dtype(np.float32), "b": np.dtype(np.int64)}


def read_archive(path, max_bytes=1000):
    with path.open("rb") as file:
        return read_arrays(file, DTYPES, max_bytes)


def test_a_file_is_read_up_to_its_limit(tmp_path):
    (tmp_path / "x").write_bytes(b"12345")
    assert read_at_most(tmp_path / "x", 5, "thing") == b"12345"
    with pytest.raises(InputError, match="x: expected a thing of at most 4 bytes, found more"):
        read_at_most(tmp_path / "x", 4, "thing")
    with pytest.raises(InputError, match="can't read the thing: Is a directory"):
        read_at_most(tmp_path, 5, "thing")


def test_the_file_from_before_is_kept_when_writing_fails(tmp_path):
    path = tmp_path / "x.json"
    write_json(path, [1])
    with contextlib.suppress(ZeroDivisionError), open_whole(path) as file:
        file.write(b"half")
        raise ZeroDivisionError
    assert read_json(path) == [1]
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("text", ["NaN", "[Infinity]", "1e999", "", "{'a': 1}", b"\xff"])
def test_json_that_could_not_be_written_again_is_refused(text):
    with pytest.raises(ValueError, match=r"\w"):
        parse_json(text)


def test_a_last_line_cut_short_is_removed(tmp_path):
    path = tmp_path / "x.jsonl"
    whole = [{"episode": number} for number in range(3)]
    text = "".join(map(to_line, whole))
    path.write_text(text + '{"epis')
    assert repair_and_read_lines(path) == whole
    assert path.read_text() == text
    assert repair_and_read_lines(tmp_path / "none.jsonl") == []


@pytest.mark.parametrize("line", ["[]", "7", "{", ""])
def test_a_whole_line_that_is_no_record_is_named(tmp_path, line):
    path = tmp_path / "x.jsonl"
    path.write_text(f'{{"episode": 0}}\n{line}\n')
    with pytest.raises(InputError, match=r"x\.jsonl: expected a record in line 2, found"):
        repair_and_read_lines(path)


def test_arrays_come_back(tmp_path):
    arrays = {"a": np.ones((2, 3), np.float32), "b": np.arange(4)}
    np.savez_compressed(tmp_path / "x.npz", **arrays, other=np.zeros(2))
    found = read_archive(tmp_path / "x.npz")
    assert found.keys() == arrays.keys()
    assert all(np.array_equal(found[name], arrays[name]) for name in arrays)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"a": np.ones(3, np.float32)}, "b.npy"),
        ({"a": np.ones(3), "b": np.arange(4)}, "a of type float64"),
        ({"a": np.array([None]), "b": np.arange(4)}, "Object arrays cannot be loaded"),
        ({"a": np.zeros(10**7, np.float32), "b": np.arange(4)}, "more than"),
    ],
    ids=["one is missing", "another type", "pickled", "unpacks to 40 MB"],
)
def test_arrays_that_are_not_as_expected_are_refused(tmp_path, arrays, message):
    np.savez_compressed(tmp_path / "x.npz", **arrays)
    with pytest.raises(ValueError, match=message):
        read_archive(tmp_path / "x.npz")


def test_a_folder_is_locked_by_one_at_a_time(tmp_path):
    with FolderLock(tmp_path), pytest.raises(InputError, match="is in use by another process"):
        FolderLock(tmp_path)
    with FolderLock(tmp_path):
        assert list(tmp_path.iterdir()) == []
