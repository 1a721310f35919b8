"""Arrays read from .npz files: known names and types, limited in size, never unpickled."""

from __future__ import annotations

import io
import os
import zipfile
import zlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import BinaryIO

import numpy as np

_MAX_OVERHEAD = 2**20  # bytes of a file beside the numbers in its arrays
# What zipfile and NumPy raise for damaged content.
_DAMAGE = (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)


def read_arrays(
    file: BinaryIO,
    dtypes: Mapping[str, np.dtype | None],
    max_bytes: int,
    optional: Mapping[str, np.dtype | None] = MappingProxyType({}),
) -> dict[str, np.ndarray]:
    """Returns the arrays `dtypes` of an .npz file, and those of `optional` that it has; ignores others.

    Args:
      file: open to read.
      dtypes: the type of each array by name; None for any.
      max_bytes: limit of the size of all arrays in the file, unpacked.
      optional: as `dtypes`, of arrays that may be missing.

    Raises:
      ValueError: if the file is damaged or larger, or lacks one of the arrays.
    """
    try:
        arrays = _read_arrays(file, list(dtypes), list(optional), max_bytes + _MAX_OVERHEAD)
    except _DAMAGE as error:
        raise ValueError(str(error)[:120] or type(error).__name__) from error
    for name, array in arrays.items():
        dtype = dtypes[name] if name in dtypes else optional[name]
        if dtype is not None and array.dtype != dtype:
            raise ValueError(f"{name} of type {array.dtype}, not {dtype}")
    return arrays


def _read_arrays(file: BinaryIO, names: list[str], optional: list[str], max_bytes: int) -> dict[str, np.ndarray]:
    if os.fstat(file.fileno()).st_size > max_bytes:
        raise ValueError(f"more than {max_bytes} bytes")
    with zipfile.ZipFile(file) as archive:
        if sum(member.file_size for member in archive.infolist()) > max_bytes:
            raise ValueError(f"more than {max_bytes} bytes of arrays")
        names = [*names, *(name for name in optional if f"{name}.npy" in archive.namelist())]
        # Each array is read to its end first, where zipfile compares its checksum.
        contents = {name: io.BytesIO(archive.read(f"{name}.npy")) for name in names}
    return {name: np.lib.format.read_array(content, allow_pickle=False) for name, content in contents.items()}
