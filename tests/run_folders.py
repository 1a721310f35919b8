"""Files that evaluations leave in their folders, and agents in modules of their own."""

from __future__ import annotations

import json
import pathlib
from typing import Any

FEW = {"distances": (1, 2), "episodes_per_distance": 1}  # 40 episodes, two in each of 20 mazes
FILES = {"config.json", "episodes.jsonl", "summary.json"}
RECORDED = {*FILES, "trajectories.npz"}

# Agents in a module of its own, with which it begins: `module_at_hand` adds what follows.
IMPORTS = "import numpy as np\nfrom mazebench import Agent, SingleAgent\n"


class Killed(BaseException):
    """Ends an evaluation as a kill would, after what it wrote."""


def kill_after(num_episodes: int):
    """Returns a `progress` that ends the evaluation once so many episodes have ended."""

    def progress(ended: int, of: int) -> None:
        if ended >= num_episodes:
            raise Killed

    return progress


def files_of(folder: pathlib.Path) -> dict[str, bytes]:
    """Returns all files below a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def results_of(folder: pathlib.Path) -> dict[str, bytes]:
    """Returns the files that are the same however a run came to its end: not the summary, which tells the command."""
    return {name: content for name, content in files_of(folder).items() if not name.endswith("summary.json")}


def records_of(folder: pathlib.Path) -> list[dict[str, Any]]:
    """Returns the records of an evaluation."""
    return [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]


def summary_of(folder: pathlib.Path) -> dict[str, Any]:
    """Returns the summary of an evaluation."""
    return json.loads((folder / "summary.json").read_text())
