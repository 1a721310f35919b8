"""Names that agents had before, for what was written under them.

`mmn` was the name of what is `belief-planner` now, and `mmn-paper` that of what is `mmn` now.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple


class _Former(NamedTuple):
    """An agent as it was called before."""

    name: str
    now: str
    classes: tuple[str, ...]  # that its finished results name
    config_key: str  # in the config of all of its runs and checkpoints, and in that of no other agent of this name


_FORMER = (
    _Former(
        "mmn",
        "belief-planner",
        ("mazebench_agents.mmn.belief.agent:MMN", "mazebench_agents.mmn.mmn:MMN"),
        "num_distances",
    ),
    _Former("mmn-paper", "mmn", ("mazebench_agents.mmn.mmn:MMNPaper",), "rows"),
)


def present_name(name: str) -> str | None:
    """Returns what an agent is called whose former name no agent has now; None for all other names."""
    return {"mmn-paper": "mmn"}.get(name)


def name_of_class(agent_class: str | None) -> str | None:
    """Returns what the agent of a finished result is called now, by the class that the result names.

    None for a class that no renamed agent had.
    """
    return next((former.now for former in _FORMER if agent_class in former.classes), None)


def describe_unfinished(config: Mapping[str, Any]) -> str | None:
    """Describes the agent of an evaluation by the content of its `config.json`, which names no class.

    Returns:
      The present name and when it was written, in words; None for what was written under a present name. Since the
      rename, the hash of an installed agent's code is written, too.
    """
    now = next((former.now for former in _FORMER if config.get("agent") == former.name), None)
    return f"{now!r}, written before the rename" if now and not config.get("agent_code_sha256") else None


def describe_former(agent: Any, config: Any) -> str | None:
    """Describes the agent that wrote a run or a checkpoint before it was renamed.

    Args:
      agent: the name of the agent, as it was written.
      config: the config of the agent, as it was written.

    Returns:
      The present name and when it was written, in words; None for what was written under a present name.
    """
    for former in _FORMER:
        if agent == former.name and isinstance(config, Mapping) and former.config_key in config:
            return f"{former.now!r}, written before the rename"
    return None
