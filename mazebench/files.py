"""Files that come from outside and are read with suspicion, and files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import io
import os
import pathlib
import stat
from collections.abc import Iterator
from typing import IO, Any

from mazebench.errors import InputError


class WriteError(InputError):
    """A folder that was given can't be written."""


def open_file(path: str | pathlib.Path, kind: str) -> io.BufferedReader:
    """Opens a file from outside to read; a pipe, which might never end, or a device is refused.

    Raises:
      InputError: if it can't be read; the message calls it a `kind`.
    """
    try:
        file = open(path, "rb", opener=_open_at_once)  # noqa: SIM115 (closed by the caller)
    except (OSError, ValueError) as error:  # ValueError for a name that no file can have
        said = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{path}: can't read the {kind}: {said}") from error
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise InputError(f"{path}: can't read the {kind}: it is a pipe or a device")
    return file


def read_at_most(path: str | pathlib.Path, num_bytes: int, kind: str) -> bytes:
    """The content of a file from outside, cut off one byte after `num_bytes`, so that the caller sees if it is larger.

    Raises:
      InputError: if it can't be read; the message calls it a `kind`.
    """
    with open_file(path, kind) as file:
        size = os.fstat(file.fileno()).st_size
        try:
            return file.read(min(size, num_bytes) + 1)  # more would be reserved at once, whatever there is to read
        except OSError as error:
            raise InputError(f"{path}: can't read the {kind}: {error.strerror}") from error


def open_to_write(path: pathlib.Path, mode: str) -> IO[Any]:
    """Opens a file of a folder that may come from outside, where a link could lead to a file of someone else's.

    Raises:
      WriteError: if it is such a link, or can't be written.
    """
    try:
        return open(path, mode, encoding=None if "b" in mode else "utf-8", opener=_open_no_link)
    except OSError as error:
        said = "it is a link" if path.is_symlink() else error.strerror
        raise WriteError(f"{path}: can't write: {said}") from error


@contextlib.contextmanager
def open_whole(path: str | pathlib.Path) -> Iterator[IO[bytes]]:
    """A file to write that takes its place at `path` when the block has ended, on the disk and with all its content.

    Until then, and if the block raises, the file from before is kept. A kill may leave a `.tmp` beside it, which the
    next writer takes over.

    Raises:
      OSError: if it can't be written; its `filename` is `path`.
    """
    path = pathlib.Path(path)
    temporary = path.with_name(path.name + ".tmp")
    try:
        opened = open(temporary, "wb", opener=_open_no_link)  # noqa: SIM115 (the error of opening it is told here)
        try:
            with opened as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        except BaseException:
            with contextlib.suppress(OSError):
                temporary.unlink()
            raise
    except OSError as error:
        said = f"{temporary.name} is a link" if temporary.is_symlink() else error.strerror
        raise OSError(error.errno, said, str(path)) from error


def make_folder(path: pathlib.Path, within: pathlib.Path | None = None) -> None:
    """Makes a folder to write to, or one `within` such a folder, which may come from outside.

    Raises:
      InputError: if that can't be, or a link on the way from `within` leads somewhere else.
    """
    if within is not None:
        refuse_links(path, within)
    with writing_to(path):
        path.mkdir(parents=True, exist_ok=True)


def refuse_links(path: pathlib.Path, within: pathlib.Path) -> None:
    """Makes sure that nothing on the way from `within` to `path`, in a folder from outside, leads somewhere else.

    Raises:
      InputError: if it does.
    """
    for folder in (path, *path.parents):
        if folder == within:
            return
        if folder.is_symlink():
            raise InputError(f"{folder}: can't write there: it is a link")


@contextlib.contextmanager
def writing_to(folder: pathlib.Path) -> Iterator[None]:
    """Says in a line which folder, or which file in it, can't be written.

    Raises:
      WriteError: if the system says so.
    """
    try:
        yield
    except OSError as error:
        raise WriteError(f"{error.filename or folder}: can't write there: {error.strerror}") from error


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)  # a named pipe would wait for its other end


def _open_no_link(path: str, flags: int) -> int:
    # A pipe without a reader is refused by the system instead of waited for.
    return os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
