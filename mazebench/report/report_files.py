"""The folder of a report: the names of its files, and how an earlier one makes room."""

from __future__ import annotations

import contextlib
import pathlib
from collections.abc import Iterator

from mazebench.errors import InputError
from mazebench.storage.files import make_folder, writing_to

DOCUMENT, PAGE, TABLES, FIGURES = "report.md", "report.html", "tables", "figures"
_SUFFIXES = (".md", ".csv", ".tex", ".png", ".pdf")  # of tables and figures


@contextlib.contextmanager
def new_report(out: pathlib.Path) -> Iterator[None]:
    """Makes the folder of a report, without an earlier report's files.

    Raises:
      InputError: if it holds something else, or can't be written in the block.
    """
    make_folder(out)
    with writing_to(out):
        others = sorted({path.name for path in out.iterdir()} - {DOCUMENT, PAGE, TABLES, FIGURES})
        if others:
            raise InputError(f"{out}: expected an empty folder or a report's, found {others[0]!r} in it")
        (out / PAGE).unlink(missing_ok=True)
        for folder in (out / TABLES, out / FIGURES):
            folder.mkdir(exist_ok=True)
            for path in folder.iterdir():
                if path.suffix in _SUFFIXES:
                    path.unlink()
        yield
