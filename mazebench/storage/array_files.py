"""Arrays in .npz files."""

from __future__ import annotations

import pathlib
import struct
import tokenize
import zipfile
import zlib
from typing import Any

import numpy as np

from mazebench.errors import InputError
from mazebench.storage.files import open_file

# What NumPy raises for an archive that is damaged, encrypted or packed in another way, and for the head of an array,
# which it reads as Python.
_BAD_HEAD = (SyntaxError, tokenize.TokenError, TypeError, LookupError, OverflowError, struct.error)
UNREADABLE = (OSError, EOFError, ValueError, MemoryError, RuntimeError, zipfile.BadZipFile, zlib.error, *_BAD_HEAD)
_MAX_BYTES = 2**31  # that an archive may unpack to


def unpack(archive: Any, num_bytes: int = _MAX_BYTES) -> dict[str, np.ndarray]:
    """Returns the arrays of an open `NpzFile` by name.

    Raises:
      ValueError: if they unpack to more than `num_bytes`.
    """
    if (found := sum(entry.file_size for entry in archive.zip.infolist())) > num_bytes:
        raise ValueError(f"expected at most {num_bytes} bytes when unpacked, found {found}")
    arrays = dict(archive)
    for name, array in arrays.items():
        if not isinstance(array, np.ndarray):
            raise ValueError(f"expected arrays only, found {name!r}")
    return arrays


def read_arrays(path: pathlib.Path, kind: str) -> dict[str, np.ndarray]:
    """Returns the arrays of an .npz file by name; nothing in it is unpickled.

    Raises:
      InputError: if the file can't be read or is damaged; the message calls it a `kind`.
    """
    with open_file(path, kind) as file:
        try:
            with np.load(file, allow_pickle=False) as arrays:
                return unpack(arrays)
        except UNREADABLE as error:
            raise InputError(f"{path}: expected a {kind}, found a damaged file: {error}") from error
