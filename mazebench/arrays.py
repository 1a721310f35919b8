"""Arrays read from .npz files of outside: known names and types, no more bytes than expected, never pickled."""

from __future__ import annotations

import io
import math
import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from typing import BinaryIO

import numpy as np

# What zipfile, zlib and NumPy's header reader raise for content that is damaged or made up.
_DAMAGE = (
    *(OSError, zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError, EOFError, SyntaxError),
    *(ValueError, KeyError, TypeError, RuntimeError, OverflowError, MemoryError),
)
_MAX_HEADER = 1000  # bytes that describe an array; Python's parser may run out of stack in ten times as many
_MAX_DIRECTORY = 2**16  # bytes that name an archive's members; zipfile makes an object of every 50
_MAX_OVERHEAD = 2**20  # bytes of a file that are no arrays
_END = struct.Struct("<4s8xIIH")  # of an archive: signature, bytes of the directory, where it is, bytes of a comment
_END_64 = struct.Struct("<4s36xQQ4s16x")  # before it, where numbers are large: signature, ..., a locator's signature


def read_arrays(file: BinaryIO, dtypes: Mapping[str, np.dtype | None], max_bytes: int) -> dict[str, np.ndarray]:
    """The arrays `dtypes` of an .npz file, read-only; others that it holds are not looked at.

    Args:
      file: open to read.
      dtypes: of each array by name; None for a short text.
      max_bytes: of all arrays that the file holds.

    Raises:
      ValueError: if it is damaged, holds more, or lacks one of them.
    """
    try:
        return _read_arrays(file, dtypes, max_bytes)
    except _DAMAGE as error:
        raise ValueError(str(error)[:120] or type(error).__name__) from error


def _read_arrays(file: BinaryIO, dtypes: Mapping[str, np.dtype | None], max_bytes: int) -> dict[str, np.ndarray]:
    if os.fstat(file.fileno()).st_size > max_bytes + _MAX_OVERHEAD:
        raise ValueError(f"more than {max_bytes} bytes")
    _check_directory(file)
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        num_bytes = sum(member.file_size for member in members)
        if num_bytes > max_bytes + _MAX_OVERHEAD:
            raise ValueError(f"{num_bytes} bytes of content, more than {max_bytes}")
        if any(member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) for member in members):
            raise ValueError("a compression that NumPy does not use")
        return {name: _to_array(archive.read(f"{name}.npy"), dtype) for name, dtype in dtypes.items()}


def _check_directory(file: BinaryIO) -> None:
    """Refuses an archive with more members than arrays have names: zipfile would list them all."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - _END.size - _END_64.size))
    tail = file.read().rjust(_END.size + _END_64.size, b"\0")
    signature, num_bytes, _, num_comment_bytes = _END.unpack(tail[_END_64.size :])
    if signature != b"PK\5\6" or num_comment_bytes:
        raise ValueError("no archive that ends as NumPy's do")
    signature_64, num_bytes_64, _, locator = _END_64.unpack(tail[: _END_64.size])
    if (signature_64, locator) == (b"PK\6\6", b"PK\6\7"):  # as zipfile decides which counts
        num_bytes = num_bytes_64
    if num_bytes > _MAX_DIRECTORY:
        raise ValueError(f"{num_bytes} bytes of names, more than {_MAX_DIRECTORY}")


def _to_array(content: bytes, dtype: np.dtype | None) -> np.ndarray:
    """An array in NumPy's file format."""
    file = io.BytesIO(content)
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError("an array of another version of NumPy's format")
    shape, is_fortran, found = np.lib.format.read_array_header_1_0(file, max_header_size=_MAX_HEADER)
    if is_fortran or (found != dtype if dtype is not None else found.kind != "U"):
        raise ValueError(f"an array of {found}")
    num_bytes = math.prod(shape) * found.itemsize
    if min(shape, default=1) < 0 or len(content) - file.tell() != num_bytes:
        raise ValueError(f"{len(content) - file.tell()} bytes for an array of shape {shape}")
    return np.frombuffer(content, found, offset=file.tell()).reshape(shape) if num_bytes else np.empty(shape, found)
