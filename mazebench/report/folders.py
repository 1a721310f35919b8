"""The evaluation folders below the paths that a user names."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Callable, Iterable

from mazebench.results.reading import EPISODES, JOURNAL, SUMMARY

# Called with one line about something that a report leaves out.
Warn = Callable[[str], None]


def find_folders(paths: Iterable[pathlib.Path], warn: Warn) -> list[pathlib.Path]:
    """Returns the evaluation folders at or below `paths`, each once, in the order of `paths` and then of their names.

    Calls `warn` for every path without one. Hidden folders are left out.
    """
    found: dict[pathlib.Path, pathlib.Path] = {}
    for path in paths:
        folders = _folders_below(path)
        if not folders:
            warn(f"{path}: expected results of `mazebench eval`, found {_describe(path)}; skipped")
        for folder in folders:
            found.setdefault(folder.resolve(), folder)
    return list(found.values())


def _folders_below(path: pathlib.Path) -> list[pathlib.Path]:
    folders = []
    for folder, subfolders, files in os.walk(path):
        subfolders[:] = sorted(name for name in subfolders if not name.startswith("."))
        if {SUMMARY, EPISODES, JOURNAL} & set(files):
            folders.append(pathlib.Path(folder))
    return folders


def _describe(path: pathlib.Path) -> str:
    if path.is_dir():
        return "a folder without any" if any(path.iterdir()) else "an empty folder"
    return "a file" if path.exists() else "nothing there"
