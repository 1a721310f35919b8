"""Files as a stranger might send them: strategies that break good ones, makers of bad ones, and a process to read them.

As a script it reads the files that it is told of on standard input, and prints what came of each.
"""

from __future__ import annotations

import copy
import io
import json
import os
import pathlib
import pickle
import resource
import stat
import struct
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from hypothesis import strategies as st

MEGABYTE = 2**20

# JSON texts that no reader expects somewhere.
NASTY = (
    *("null", "true", "-1", "0", "0.5", "7", "9007199254740993", "1e400", "-1e400", "NaN", "Infinity", "1.5e-320"),
    *("1" + "0" * 400, "1" + "0" * 5000, '""', '"1"', '"nan"', '"\\ud800"', '"a\\nb"', '"\\u001b[2J"', '"\\u0000"'),
    *('"</script><!--"', '"$\\\\frac{"', '"../../x"', '"' + "x" * 70_000 + '"', "[]", "{}", "[[]]", "[1,2,3]"),
    *("[0,0]", '{"a":1,"a":2}', "[" * 40 + "]" * 40, "[" * 50_000, '{"a":' * 900 + "1" + "}" * 900, "\u00e9", "'x'"),
)
_PLACE = "@here@"


@st.composite
def damaged(draw: Callable[..., Any], content: bytes) -> bytes:
    """`content` with some bytes changed, cut, moved or put in."""
    spoilt = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, len(spoilt)))
        kind = draw(st.sampled_from(["flip", "cut", "insert", "remove", "repeat", "number"]))
        if kind == "flip" and place < len(spoilt):
            spoilt[place] ^= 1 << draw(st.integers(0, 7))
        elif kind == "cut":
            del spoilt[place:]
        elif kind == "insert":
            spoilt[place:place] = draw(st.sampled_from(INSERTED) | st.binary(max_size=8))
        elif kind == "remove":
            del spoilt[place : place + draw(st.integers(1, 64))]
        elif kind == "repeat":
            spoilt[place:place] = spoilt[place : place + draw(st.integers(1, 200))]
        elif kind == "number":  # of four bytes, little or big end first
            number = draw(st.sampled_from([0, 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1]))
            spoilt[place : place + 4] = number.to_bytes(4, draw(st.sampled_from(["little", "big"])))
    return bytes(spoilt)


# What text editors, other systems and wrong encodings leave in a file.
INSERTED = (b"\0", b"\r\n", b"\n", b"\r", b"\xef\xbb\xbf", b"\xff\xfe", b"\x1a", b"\x80", b" " * 300, b"\xe2\x80\xa8")

recoded = st.sampled_from(
    [
        lambda content: content.decode("latin-1").encode("utf-16"),
        lambda content: b"\xef\xbb\xbf" + content,
        lambda content: content.replace(b"\n", b"\r\n"),
        lambda content: content.replace(b"\n", b"\r"),
        lambda content: content.replace(b"\n", b""),
        lambda content: content + b"\0" * 1000,
        lambda content: content.rstrip(b"\n"),
        lambda content: b"",
        lambda content: zlib.compress(content),
        lambda content: pickle.dumps(content),
    ]
)


def broken(content: bytes) -> st.SearchStrategy[bytes]:
    """`content` damaged or recoded."""
    return damaged(content) | recoded.map(lambda recode: recode(content))


@st.composite
def broken_json(draw: Callable[..., Any], value: Any) -> str:
    """The JSON text of `value` with one to three of its parts replaced, removed, renamed or named twice."""
    value = copy.deepcopy(value)
    texts = []
    for _ in range(draw(st.integers(1, 3))):
        places = list(_places(value))
        if not places:
            break
        holder, key = draw(st.sampled_from(places))
        kind = draw(st.sampled_from(["replace", "replace", "replace", "remove", "rename"]))
        if kind == "remove":
            del holder[key]
        elif kind == "rename" and isinstance(holder, dict):
            holder[draw(st.sampled_from(["", "x", "\n", "1" * 20, "\ud800", *map(str, holder)]))] = holder.pop(key)
        else:
            holder[key] = f"{_PLACE}{len(texts)}"
            texts.append(draw(st.sampled_from(NASTY)))
    whole = json.dumps(value)
    for number, text in enumerate(texts):
        whole = whole.replace(f'"{_PLACE}{number}"', text)
    return whole


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in list(items):
        yield value, key
        yield from _places(inner)


def special_files(folder: pathlib.Path) -> dict[str, Callable[[pathlib.Path], object]]:
    """What may stand in place of a file, by name: each is made at a path. `folder` is for what links lead to."""
    (folder / "victim").write_text("mine\n")
    return {
        "missing": lambda path: None,
        "folder": lambda path: path.mkdir(),
        "pipe": os.mkfifo,
        "device": lambda path: path.symlink_to("/dev/zero"),
        "terminal": lambda path: path.symlink_to("/dev/tty"),
        "dangling link": lambda path: path.symlink_to(folder / "nothing"),
        "circular link": lambda path: path.symlink_to(path),
        "link": lambda path: path.symlink_to(folder / "victim"),
        "socket": lambda path: os.mknod(path, stat.S_IFSOCK | 0o600),
        "hole": lambda path: sparse(path, 10**11),
        "empty": lambda path: path.touch(),
        "unreadable": lambda path: path.touch(0),
    }


def sparse(path: pathlib.Path, num_bytes: int, start: bytes = b"") -> None:
    """A file that takes no room on the disk but would in memory."""
    path.write_bytes(start)
    os.truncate(path, num_bytes)


class Touch:
    """Unpickling it makes a file."""

    def __init__(self, path: pathlib.Path):
        self._path = str(path)

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (self._path,)


def pickles(mark: pathlib.Path) -> dict[str, bytes]:
    """Files that would make a folder `mark` if anything in them were unpickled."""
    plain, array, archive = pickle.dumps(Touch(mark)), io.BytesIO(), io.BytesIO()
    np.save(array, np.array([Touch(mark)], dtype=object), allow_pickle=True)
    with zipfile.ZipFile(archive, "w") as members:  # as torch.save lays it out
        members.writestr("archive/data.pkl", plain)
        members.writestr("archive/version", "3\n")
    return {"pickle": plain, "array": array.getvalue(), "archive": archive.getvalue()}


def pickled_npz(path: pathlib.Path, names: list[str], mark: pathlib.Path) -> None:
    """An archive of object arrays."""
    np.savez(path, **{name: np.array([Touch(mark)], dtype=object) for name in names})


def npz(path: pathlib.Path, members: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> None:
    """An archive of any members."""
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def array_header(shape: tuple[int, ...], dtype: str = "<f4") -> bytes:
    """What NumPy writes before an array's numbers."""
    content = io.BytesIO()
    np.lib.format.write_array_header_1_0(content, {"descr": dtype, "fortran_order": False, "shape": shape})
    return content.getvalue()


def safetensors(header: Any, data: bytes = b"", length: int | None = None) -> bytes:
    """A safetensors file; `header` is text, or put into JSON, and `length` is what it says of its length."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return struct.pack("<Q", len(text) if length is None else length) + text + data


def png_chunk(kind: bytes, data: bytes) -> bytes:
    """A chunk with the right checksum."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width: int, height: int, bits: int = 8, colour: int = 0, rows: bytes = b"", *chunks: bytes) -> bytes:
    """A PNG that declares a size, whatever `rows`, deflated, and other `chunks` hold."""
    header = png_chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, 0))
    data = png_chunk(b"IDAT", zlib.compress(rows))
    return b"\x89PNG\r\n\x1a\n" + header + b"".join(chunks) + data + png_chunk(b"IEND", b"")


def jpeg_of_scans(side: int, num_scans: int) -> bytes:
    """A progressive JPEG, gray, that goes over all of its picture in each of many scans of a hundred bytes or less."""

    def segment(marker: int, data: bytes) -> bytes:
        return struct.pack(">BBH", 0xFF, marker, len(data) + 2) + data

    def coded(bits: str) -> bytes:
        bits += "1" * (-len(bits) % 8)
        return int(bits, 2).to_bytes(len(bits) // 8, "big").replace(b"\xff", b"\xff\0")

    num_blocks = (side // 8) ** 2
    table = bytes([1] + [0] * 15)  # one code of one bit
    start = b"\xff\xd8" + segment(0xDB, bytes(1) + bytes([1] * 64))
    start += segment(0xC2, struct.pack(">BHHB", 8, side, side, 1) + bytes([1, 0x11, 0]))
    start += segment(0xC4, b"\x00" + table + b"\x00") + segment(0xC4, b"\x10" + table + b"\xe0")
    first = segment(0xDA, bytes([1, 1, 0, 0, 0, 0])) + coded("0" * num_blocks)
    run = "0" + format(2**14 - 1, "014b")  # of 32,767 blocks without anything in them
    scan = segment(0xDA, bytes([1, 1, 0, 1, 1, 0])) + coded(run * -(-num_blocks // 32767))
    return start + first + scan * num_scans + b"\xff\xd9"


def read_limited(
    paths: dict[str, list[pathlib.Path]], gigabytes: float = 4, seconds: int = 60
) -> tuple[dict[str, list[str | None]], float]:
    """What comes of reading files, by reader, in a process that gets so much address space and processor time.

    Returns:
      the refusals, None for what was read, and the most memory taken, in MiB beyond what the readers' modules take.
    """

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (int(gigabytes * 2**30),) * 2)
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))

    threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # the stack of each counts as address space
    result = subprocess.run(
        [sys.executable, __file__],
        input=json.dumps({reader: [str(path) for path in some] for reader, some in paths.items()}),
        capture_output=True,
        text=True,
        preexec_fn=limit,
        env=os.environ | threads,
        check=False,
    )
    assert result.returncode == 0, f"exit status {result.returncode}: {result.stderr[-2000:]}"
    said, megabytes = json.loads(result.stdout)
    return said, megabytes


def _reader(name: str) -> Callable[[pathlib.Path], object]:
    """A function that reads a path, with all that it needs imported."""
    if name == "maps":
        from mazebench.maps.files import read_mazes

        return read_mazes
    if name == "result":
        from mazebench.evaluation.results import load_result

        return load_result
    if name == "report":
        from mazebench.report.reading import read_result

        return lambda path: read_result(path, print_nothing)
    if name == "suite":
        from mazebench.evaluation.results import read_suite

        return read_suite
    if name == "resume":
        from mazebench.evaluation.harness import EvalOptions, evaluate

        return lambda path: evaluate(EvalOptions("random", distances=(1,), episodes_per_distance=1), path, resume=True)
    if name == "trajectories":
        from mazebench.evaluation.trajectories import load_trajectories

        return lambda path: load_trajectories(path, 20)
    if name == "checkpoint":
        from mazebench_agents.dqn import MAH

        from mazebench.agent import Interface

        return lambda path: MAH.build(Interface("local", 13, 13), checkpoint=path)
    assert name == "replay"
    from mazebench_agents.replay import Replay

    return lambda path: Replay(8, 4000).load(path)


def print_nothing(line: str) -> None:
    """Takes a warning."""


def _main() -> None:
    from mazebench.errors import InputError

    paths = json.load(sys.stdin)
    readers = {name: _reader(name) for name in paths}
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    said: dict[str, list[str | None]] = {name: [] for name in paths}
    for name, read in readers.items():
        for path in paths[name]:
            try:
                read(pathlib.Path(path))
                said[name].append(None)
            except InputError as error:
                said[name].append(str(error))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(json.dumps([said, (peak - before) / 1024]))


if __name__ == "__main__":
    _main()
