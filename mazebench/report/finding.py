"""Finds evaluation folders below what a user names."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Iterable, Iterator

from mazebench.records import EPISODES, SUMMARY
from mazebench.report.results import Warn

MAX_DEPTH = 5  # folders below a named one: results/, a suite's run, its agents, their parts, and one to spare
MAX_FOLDERS = 10_000  # looked into below a named one, which was then hardly meant


def find_results(paths: Iterable[pathlib.Path], warn: Warn) -> list[pathlib.Path]:
    """The evaluation folders at or below `paths`, each once, in the order of `paths` and then of their names.

    `warn` is told of every path that holds none.
    """
    found: dict[str, pathlib.Path] = {}
    for path in paths:
        if not path.is_dir():
            found_instead = "a file" if path.exists() else "nothing there"
            warn(f"{path}: expected a folder of results, found {found_instead}; skipped")
            continue
        here = list(_evaluations(path, warn))
        if not here:
            empty = next(path.iterdir(), None) is None
            warn(f"{path}: expected a folder of results, found {'it empty' if empty else 'none in it'}; skipped")
        for folder in here:
            found.setdefault(os.path.realpath(folder), folder)
    return list(found.values())


def _evaluations(path: pathlib.Path, warn: Warn) -> Iterator[pathlib.Path]:
    for looked_into, (folder, folders, files) in enumerate(os.walk(path)):
        if looked_into == MAX_FOLDERS:
            warn(f"{path}: has more than {MAX_FOLDERS} folders; looked for results in these only")
            return
        if {EPISODES, SUMMARY} & set(files):
            folders.clear()
            yield pathlib.Path(folder)
        elif len(pathlib.Path(folder).relative_to(path).parts) >= MAX_DEPTH:
            folders.clear()
        folders[:] = sorted(name for name in folders if not name.startswith("."))
