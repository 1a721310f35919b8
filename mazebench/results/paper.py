"""The paper's printed numbers, to compare with measured ones."""

from __future__ import annotations

import functools
import json
from importlib import resources
from typing import Any

from mazebench.results.naming import noise_in_words
from mazebench.results.records import Summary
from mazebench.world.bodies import SLIDER


@functools.cache
def reference() -> dict[str, Any]:
    """Returns the paper's title, authors and tables."""
    return json.loads(resources.files("mazebench_assets").joinpath("paper", "reference.json").read_text("utf-8"))


def printed(task: str, size: int, warped: bool = False) -> dict[str, dict[str, dict[int, float]]]:
    """Returns the numbers printed for a task and size, by agent, metric and distance (or landmark distance)."""
    found: dict[str, dict[str, dict[int, float]]] = {}
    for table in reference()["tables"]:
        if (table["task"], table["size"], table["warped"]) == (task, size, warped):
            for agent, values in table["agents"].items():
                found.setdefault(agent, {})[table["metric"]] = dict(zip(table["rows"], values, strict=True))
    return found


def printed_mmn(summary: Summary) -> dict[int, float]:
    """Success rates of the paper's MMN by distance, or landmark distance, where `summary` can be held against them.

    That is where it is of the slider and of unseen mazes, of no track, with neither perturbations nor noisy senses.
    """
    task = summary.task
    if task.body != SLIDER.name or task.split_in_results != "eval" or not task.is_exact or noise_in_words(task):
        return {}
    return printed(task.task, task.size or 0).get("MMN", {}).get("success_rate", {})
