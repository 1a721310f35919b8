"""Where results came from, in words: one row for each agent and command."""

from __future__ import annotations

import os
from collections.abc import Sequence

from mazebench.report.results import ReportedResult

HEAD = ("agent", "results", "episodes", "in", "checkpoint", "seed", "versions", "machine", "command")
_PACKAGES = ("mazebench-mujoco", "mujoco", "numpy", "torch")


def benchmark_versions(results: Sequence[ReportedResult]) -> str:
    """Returns the versions of the benchmark that results are of, in words."""
    return " and ".join(sorted({result.summary.benchmark for result in results}))


def provenance_rows(results: Sequence[ReportedResult]) -> list[tuple[str, ...]]:
    """Returns rows of texts under `HEAD`; results that differ only in what was played share a row."""
    groups: dict[tuple[str, ...], list[ReportedResult]] = {}
    for result in results:
        groups.setdefault((result.label, *_origin(result)), []).append(result)
    return [
        (
            label,
            str(len(group)),
            f"{sum(len(result.episodes) for result in group):,}",
            _common_folder([str(result.folder) for result in group]),
            *origin,
        )
        for (label, *origin), group in groups.items()
    ]


def _common_folder(paths: Sequence[str]) -> str:
    try:
        return os.path.commonpath(paths) or "."
    except ValueError:  # some are absolute, some are not
        return os.path.commonpath([os.path.abspath(path) for path in paths])


def _origin(result: ReportedResult) -> tuple[str, ...]:
    """Returns checkpoint, seed, versions, machine and command; empty texts for what the result does not say."""
    provenance = result.summary.provenance
    said = provenance.model_extra or {}
    machine, command = said.get("machine"), said.get("command")
    versions = [f"{name} {provenance.packages[name]}" for name in _PACKAGES if provenance.packages.get(name)]
    return (
        result.checkpoint[:12] if result.checkpoint else "none",
        str(result.seed),
        ", ".join([*versions, *([f"Python {said['python']}"] if "python" in said else [])]),
        ", ".join(f"{key} {value}" for key, value in machine.items()) if isinstance(machine, dict) else "",
        " ".join(map(str, command)) if isinstance(command, list) else "",
    )
