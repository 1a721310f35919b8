"""Files on disk: read up to a limit, written whole, and never unpickled."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest

from mazebench.errors import InputError
from mazebench.storage.array_files import read_arrays
from mazebench.storage.files import open_whole, read_at_most
from mazebench.storage.json_files import read_json, read_lines, to_line, write_json


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


def test_a_line_that_is_not_whole_is_passed_over(tmp_path):
    path = tmp_path / "x.jsonl"
    whole = [{"episode": number} for number in range(3)]
    path.write_text("\n" + "".join(map(to_line, whole)) + '{"epis')
    assert read_lines(path) == whole
    assert read_lines(tmp_path / "none.jsonl") == []


def test_arrays_come_back_and_nothing_is_unpickled(tmp_path):
    path = tmp_path / "x.npz"
    np.savez_compressed(path, a=np.ones((2, 3), np.float32), b=np.arange(4))
    assert {name: array.tolist() for name, array in read_arrays(path, "thing").items()} == {
        "a": [[1.0] * 3] * 2,
        "b": [0, 1, 2, 3],
    }
    for content in (b"", path.read_bytes()[:100]):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"x\.npz: expected a thing, found a damaged file: "):
            read_arrays(path, "thing")
    np.savez_compressed(path, a=np.array([None]))
    with pytest.raises(InputError, match="Object arrays cannot be loaded"):
        read_arrays(path, "thing")
