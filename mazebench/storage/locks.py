"""Folder locks: one process at a time writes to a folder."""

from __future__ import annotations

import fcntl
import os
import pathlib

from mazebench.errors import InputError


class FolderLock:
    """A lock that keeps other processes out of a folder while it is held; a context manager.

    The system releases it when its process ends, by a kill too.
    """

    def __init__(self, folder: pathlib.Path):
        """Takes the lock.

        Raises:
          InputError: if another process holds it, or the file system has no locks.
        """
        self._descriptor = os.open(folder, os.O_RDONLY)  # a lock on the folder itself leaves no file in it
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(self._descriptor)
            if isinstance(error, BlockingIOError):
                raise InputError(f"{folder}: is in use by another process") from None
            raise InputError(f"{folder}: expected a file system that can lock, found: {error.strerror}") from error

    def __enter__(self) -> FolderLock:
        return self

    def __exit__(self, *exception: object) -> None:
        os.close(self._descriptor)
