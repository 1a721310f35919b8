"""The user's cache: files of arrays that took long to compute. A file or folder with a fault is passed over."""

from __future__ import annotations

import hashlib
import os
import pathlib
import sys
from collections.abc import Iterable
from typing import Any

import numpy as np

from mazebench.errors import InputError, remark
from mazebench.storage.array_files import read_arrays
from mazebench.storage.files import open_whole

NO_CACHE = "MAZEBENCH_NO_CACHE"  # an environment variable; unless it is empty, the cache is left out


def users_cache() -> pathlib.Path:
    """Returns the folder of mazebench in the user's cache, which need not exist."""
    of_platform = {"darwin": "~/Library/Caches", "win32": os.environ.get("LOCALAPPDATA") or "~/AppData/Local"}
    users = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser(of_platform.get(sys.platform, "~/.cache"))
    return pathlib.Path(users) / "mazebench"


def file_for(kind: str, code: Iterable[pathlib.Path], *values: object) -> pathlib.Path | None:
    """Returns the file, in the folder `kind`, of what source files compute from values that `repr` tells apart.

    Its name also stands for the contents of the files and for NumPy's version. It is None if nothing is to be kept.
    """
    if os.environ.get(NO_CACHE) or not users_cache().is_absolute():
        return None
    try:
        contents = [path.read_bytes() for path in code]
    except OSError:  # a program without its source files
        return None
    digest = hashlib.sha256(repr((np.__version__, contents, values)).encode()).hexdigest()
    return users_cache() / kind / f"{digest}.npz"


def load(file: pathlib.Path | None) -> dict[str, np.ndarray]:
    """Returns the arrays that `keep` wrote by name; none if there are none, or damaged or another file's."""
    if file is None:
        return {}
    try:
        arrays = read_arrays(file, "file of the cache")
    except InputError:
        return {}
    names = arrays.pop("names", np.zeros(0))  # without which damage could leave out an array unseen
    return arrays if names.tolist() == [file.stem, *arrays] else {}


def keep(file: pathlib.Path | None, **arrays: Any) -> None:
    """Writes NumPy arrays, none of which is called `names`; remarks if it can't."""
    if file is None:
        return
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with open_whole(file) as opened:
            np.savez_compressed(opened, names=np.array([file.stem, *arrays]), **arrays)
    except OSError as error:
        if not os.path.isfile(file):  # which another process has written meanwhile
            remark(f"{file.parent}: can't keep there what took long to make: {error.strerror}")
