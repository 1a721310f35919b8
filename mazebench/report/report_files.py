"""The folder of a report: the names of its files, and how they are written."""

from __future__ import annotations

import contextlib
import pathlib
from collections.abc import Iterator

from mazebench.errors import InputError
from mazebench.storage.files import make_folder, open_whole, writing_to

DOCUMENT, PAGE, TABLES, FIGURES = "report.md", "report.html", "tables", "figures"
_SUFFIXES = {TABLES: (".md", ".csv", ".tex"), FIGURES: (".png", ".pdf")}


@contextlib.contextmanager
def new_report(out: pathlib.Path) -> Iterator[None]:
    """Makes the folder of a report, without an earlier report's files, also those that a kill left half-written.

    Raises:
      InputError: if it holds something else, or can't be written in the block.
    """
    make_folder(out)
    with writing_to(out):
        ours = {DOCUMENT, PAGE, TABLES, FIGURES}
        others = sorted(path.name for path in out.iterdir() if path.name.removesuffix(".tmp") not in ours)
        if others:
            raise InputError(f"{out}: expected an empty folder or a report's, found {others[0]!r} in it")
        (out / PAGE).unlink(missing_ok=True)
        for folder, suffixes in _SUFFIXES.items():
            make_folder(out / folder)
            for path in (out / folder).iterdir():
                if path.name.removesuffix(".tmp").endswith(suffixes):
                    path.unlink()
        yield


def write_text(path: pathlib.Path, text: str) -> None:
    """Writes a file of a report. Names of folders and words of commands need not be legal Unicode."""
    with open_whole(path) as file:
        file.write(text.encode("utf-8", errors="replace"))
