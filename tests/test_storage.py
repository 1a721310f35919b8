"""Files on disk: read up to a limit, written whole, and never unpickled."""

from __future__ import annotations

import contextlib
import os
import zipfile

import numpy as np
import pydantic
import pytest

from mazebench.errors import InputError
from mazebench.maps.readers.arrays import read_array_file
from mazebench.storage.array_files import read_arrays
from mazebench.storage.files import open_whole, read_at_most
from mazebench.storage.json_files import read_json, read_lines, to_line, write_json


class Line(pydantic.BaseModel):
    episode: int


def test_a_file_is_read_up_to_its_limit(tmp_path):
    (tmp_path / "x").write_bytes(b"12345")
    assert read_at_most(tmp_path / "x", 5, "thing") == b"12345"
    with pytest.raises(InputError, match="x: expected a thing of at most 4 bytes, found more"):
        read_at_most(tmp_path / "x", 4, "thing")
    with pytest.raises(InputError, match="can't read the thing: Is a directory"):
        read_at_most(tmp_path, 5, "thing")


def test_a_pipe_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "x")
    for path, found in ((tmp_path / "x", "found a pipe or a device"), ("/dev/zero", "found a pipe"), ("a\0b", "null")):
        with pytest.raises(InputError, match=found):
            read_at_most(path, 5, "thing")


def test_a_link_in_the_place_of_a_new_file_is_not_followed(tmp_path):
    (tmp_path / "other").write_text("kept")
    (tmp_path / "x.json.tmp").symlink_to(tmp_path / "other")
    write_json(tmp_path / "x.json", [1])
    assert (tmp_path / "other").read_text() == "kept"
    assert not (tmp_path / "x.json").is_symlink()


def test_an_archive_is_bounded_by_what_it_unpacks_to(tmp_path):
    np.savez_compressed(tmp_path / "x.npz", a=np.zeros(2**28, np.uint8))
    assert (tmp_path / "x.npz").stat().st_size < 2**20
    with pytest.raises(InputError, match="expected at most 33554432 bytes when unpacked, found 2684"):
        read_array_file(tmp_path / "x.npz")


def test_a_member_that_is_no_array_is_named(tmp_path):
    np.savez(tmp_path / "x.npz", a=np.zeros(2))
    with zipfile.ZipFile(tmp_path / "x.npz", "a") as archive:
        archive.writestr("readme.txt", "hello")
    with pytest.raises(InputError, match=r"expected arrays only, found 'readme\.txt'"):
        read_arrays(tmp_path / "x.npz", "thing")


def test_values_that_are_nested_too_deeply_are_named(tmp_path):
    (tmp_path / "x.json").write_text("[" * 100_000)
    with pytest.raises(InputError, match="expected JSON, found values that are nested too deeply"):
        read_json(tmp_path / "x.json")


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
    assert [line.model_dump() for line in read_lines(path, Line)] == whole
    assert read_lines(tmp_path / "none.jsonl", Line) == []
    path.write_text('{"episode": 1}\n[]\n')
    with pytest.raises(InputError, match=r"x\.jsonl: expected another line 2, found "):
        read_lines(path, Line)


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
