"""Finding agents: by the entry points `mazebench.agents`, or as `module:Class`."""

from __future__ import annotations

import importlib
import os
import pathlib
import sys
import traceback
from importlib import metadata
from typing import Any

import numpy as np

from mazebench.agent import Agent, SingleAgent, as_agent_class
from mazebench.constants import DISCRETE, VELOCITIES
from mazebench.errors import InputError, describe_error, unknown
from mazebench.tasks.sensors import SENSORS
from mazebench.tasks.task_options import HIDEABLE

ENTRY_POINT_GROUP = "mazebench.agents"
_DECLARED = {"plays_actions": (*DISCRETE, *VELOCITIES), "needs_sensors": tuple(SENSORS), "needs_shown": HIDEABLE}
_IMPORTLIB = pathlib.Path(importlib.__file__).parent


def agent_names() -> list[str]:
    """Returns the names of all installed agents."""
    return sorted(_entry_points())


def package_of(name: str) -> str | None:
    """Returns name and version of the distribution that brings an installed agent; None if that is not known."""
    dist = _entry_points()[name].dist
    return f"{dist.name} {dist.version}" if dist else None


def load_agent_class(name: str) -> type[Agent]:
    """Returns the class of an installed agent, or of `module:Class`; the working directory is searched too.

    A `SingleAgent` comes wrapped as an `Agent`.

    Raises:
      InputError: if there is no such agent, it can't be imported, or it is not a subclass of either.
    """
    entry_points, hint = _entry_points(), ""
    if ":" in name:
        module, _, class_name = name.partition(":")
        hint = "; expected module:Class, such as my_agent:MyAgent"
        if "/" in module or module.endswith(".py") or not (module and class_name):
            raise InputError(f"agent {name!r}{hint}")
        if not {"", ".", os.getcwd()} & set(sys.path):
            sys.path.insert(0, os.getcwd())  # whole, as agents may change the working folder
        entry_point = metadata.EntryPoint(name, name, ENTRY_POINT_GROUP)
    elif name in entry_points:
        entry_point = entry_points[name]
    else:
        raise InputError(f"{unknown('agent', name, entry_points)}; one of your own is named as module:Class")
    try:
        with np.errstate():  # what the module sets is undone
            loaded = entry_point.load()
    except Exception as error:  # other people's modules may raise anything
        if isinstance(error, ModuleNotFoundError) and not hint:
            hint = "; the extra [agents] brings it (docs/start.md)"
        found = f"{describe_error(error)}{source_line(error)}"
        raise InputError(f"agent {name!r} can't be imported: {found}{hint}") from error
    return checked_agent_class(name, loaded)


def checked_agent_class(name: str, loaded: Any) -> type[Agent]:
    """Returns `loaded` as an `Agent` class.

    Raises:
      InputError: unless it is a subclass of `Agent` or `SingleAgent` whose declarations can be met.
    """
    if not isinstance(loaded, type) or not issubclass(loaded, (Agent, SingleAgent)):
        raise InputError(f"agent {name!r}: expected a subclass of mazebench.Agent or SingleAgent, found {loaded!r}")
    for flag in ("needs_truth", "learns"):
        if not isinstance(found := getattr(loaded, flag), bool):
            raise InputError(f"agent {name!r}: expected {flag} as True or False, found {found!r}"[:200])
    for declared, known in _DECLARED.items():
        found = getattr(loaded, declared)
        are_known = isinstance(found, tuple) and all(item in known for item in found)
        if not are_known or (declared == "plays_actions" and not found):
            raise InputError(f"agent {name!r}: expected {declared} as a tuple of {', '.join(known)}, found {found!r}")
    return as_agent_class(loaded)  # type: ignore[arg-type]  # of mypy, which takes its objects' hash


def source_line(error: BaseException) -> str:
    """Returns where in an agent's own files `error` arose, as " (FILE:LINE)"; empty if it arose outside of them."""
    ours = {pathlib.Path(__file__).parent, _IMPORTLIB}
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith("<") and ours.isdisjoint(pathlib.Path(frame.filename).parents)
    ]
    if not frames:
        return ""
    # The agent's own files are those beside the first one; below them are the libraries that it calls.
    folder = pathlib.Path(frames[0].filename).parent
    last = [frame for frame in frames if folder in pathlib.Path(frame.filename).parents][-1]
    return f" ({pathlib.Path(last.filename).name}:{last.lineno})"


def _entry_points() -> dict[str, metadata.EntryPoint]:
    return {entry_point.name: entry_point for entry_point in metadata.entry_points(group=ENTRY_POINT_GROUP)}
