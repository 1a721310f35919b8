"""Files of users, which are read up to a limit of size, and files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import fcntl
import io
import os
import pathlib
import stat
from collections.abc import Iterator
from typing import IO

from mazebench.errors import InputError


def open_file(path: str | pathlib.Path, kind: str) -> io.BufferedReader:
    """Opens a file to read its bytes.

    Raises:
      InputError: if it can't be opened; the message calls it a `kind`.
    """
    try:
        if stat.S_ISREG(os.stat(path).st_mode) or os.path.isdir(path):  # of a folder, `open` says so
            return open(path, "rb")
    except (OSError, ValueError) as error:  # ValueError: of a path with a null character
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{path}: can't read the {kind}: {reason}") from error
    raise InputError(f"{path}: expected a {kind} in a file, found a pipe or a device")


def read_at_most(path: str | pathlib.Path, num_bytes: int, kind: str) -> bytes:
    """Returns the content of a file.

    Raises:
      InputError: if it can't be read, or is larger than `num_bytes`; the message calls it a `kind`.
    """
    with open_file(path, kind) as file:
        content = file.read(num_bytes + 1)
    if len(content) > num_bytes:
        raise InputError(f"{path}: expected a {kind} of at most {num_bytes} bytes, found more")
    return content


@contextlib.contextmanager
def open_whole(path: str | pathlib.Path) -> Iterator[IO[bytes]]:
    """Yields a file to write, which replaces the one at `path` when the block ends without an exception.

    The content reaches the disk before the replacement, so that a reader finds the old file or the whole new one. A
    kill may leave a `.tmp` file beside it, which the next writer removes.

    Raises:
      OSError: if it can't be written; its `filename` is `path`.
    """
    path = pathlib.Path(path)
    temporary = path.with_name(path.name + ".tmp")
    try:
        temporary.unlink(missing_ok=True)
        with temporary.open("xb") as file:  # "x" follows no link, which another user may have put there
            yield file
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def make_folder(path: pathlib.Path) -> None:
    """Makes a folder, and those that it lies in, unless it exists."""
    with writing_to(path):
        path.mkdir(parents=True, exist_ok=True)


@contextlib.contextmanager
def locked(folder: pathlib.Path, kind: str) -> Iterator[None]:
    """Makes a folder, and keeps out other processes that lock it, until the block or this process ends.

    Raises:
      InputError: if another one has locked it, which the message calls a `kind`.
    """
    make_folder(folder)
    with writing_to(folder):
        descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(descriptor)
        raise InputError(f"{folder}: another {kind} writes there; end it, or name another folder") from error
    except OSError:  # a file system without locks
        pass
    try:
        yield
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def writing_to(folder: pathlib.Path) -> Iterator[None]:
    """Turns an `OSError` in the block into an `InputError` that names the file, or `folder` if the error names none."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{error.filename or folder}: can't write there: {error.strerror}") from error
