"""What the machines of one run must have in common, so that each computes the same: versions, code and checkpoint."""

from __future__ import annotations

import os
import platform
import sys
from typing import Any, NamedTuple

from mazebench.agent import Agent
from mazebench.agent_loading import load_agent_class
from mazebench.errors import InputError
from mazebench.evaluation.provenance import agent_files, file_hash, files_hash, own_files, package_versions


class Common(NamedTuple):
    """What a run has on the machine on which it began."""

    agent: str
    checkpoint: str | None
    names: tuple[str, ...] | None  # of the agent's files, in their folder; None if it is in no file
    working_folder: str
    values: dict[str, Any]  # by what a message calls them


def common_of(agent: str, agent_class: type[Agent], checkpoint: str | None = None) -> Common:
    """Returns what all machines of a run of an agent must have."""
    files = agent_files(agent, agent_class)
    names = None if files is None else tuple(os.path.relpath(path, files.folder) for path in files.paths)
    return Common(agent, checkpoint, names, os.getcwd(), _values(agent, agent_class, names, checkpoint))


def check_node(common: Common) -> str | None:
    """Returns the path of the run's checkpoint on this machine.

    From now on, modules in the folder in which the run began can be imported.

    Raises:
      InputError: if something differs here; the message names the machine and the first difference.
    """
    node, checkpoint = f"node {platform.node()}", common.checkpoint
    if ":" in common.agent and common.working_folder not in sys.path:
        sys.path.insert(0, common.working_folder)
    try:
        agent_class = load_agent_class(common.agent)
        if checkpoint is not None and not os.path.exists(checkpoint):  # perhaps installed elsewhere
            checkpoint = str(agent_class.default_checkpoint() or checkpoint)
        values = _values(common.agent, agent_class, common.names, checkpoint)
    except (InputError, OSError) as error:
        raise InputError(f"{node}: {error}") from error
    for name, expected in common.values.items():
        if values[name] != expected:
            raise InputError(f"{node}: expected {name} {expected}, as where the run began, found {values[name]}")
    return checkpoint


def _values(
    agent: str, agent_class: type[Agent], names: tuple[str, ...] | None, checkpoint: str | None
) -> dict[str, Any]:
    files = None if names is None else agent_files(agent, agent_class)
    code = files and files_hash([files.folder / name for name in names or ()], files.folder)
    return {
        "Python": ".".join(platform.python_version_tuple()[:2]),
        "processor": platform.machine(),
        **package_versions("numba"),
        "code of mazebench": files_hash(*own_files()),
        f"code of agent {agent!r}": code,
        "checkpoint": file_hash(checkpoint),
    }
