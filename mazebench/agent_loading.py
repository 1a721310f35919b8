"""Finding agents: by the entry points `mazebench.agents`, or as `module:Class`."""

from __future__ import annotations

import contextlib
import importlib
import inspect
import pathlib
import sys
import traceback
from importlib import metadata
from typing import Any

from mazebench.agent import Agent, SingleAgent, as_agent_class
from mazebench.errors import InputError, shortened, unknown
from mazebench.tasks.sensors import SENSORS

ENTRY_POINT_GROUP = "mazebench.agents"
_IMPORTLIB = pathlib.Path(importlib.__file__).parent


def agent_names() -> list[str]:
    """Returns the names of all installed agents."""
    return sorted(_entry_points())


def package_of(name: str) -> str | None:
    """Returns name and version of the distribution that brings an installed agent; None if that is not known."""
    dist = _entry_points()[name].dist
    return f"{dist.name} {dist.version}" if dist else None


def learning_agents() -> list[str]:
    """Returns the names of the installed agents that learn; loads all whose dependencies are installed."""
    found = []
    for name in agent_names():
        with contextlib.suppress(InputError):
            found += [name] if load_agent_class(name).learns else []
    return found


def load_agent_class(name: str) -> type[Agent]:
    """Returns the class of an installed agent, or of `module:Class`; the working directory is searched too.

    A `SingleAgent` comes wrapped as an `Agent`.

    Raises:
      InputError: if there is no such agent, it can't be imported, or it is not a subclass of either.
    """
    if ":" in name:
        return checked_agent_class(name, _import_class(name))
    entry_points = _entry_points()
    if name not in entry_points:
        raise InputError(f"{unknown('agent', name, entry_points)}; one of your own is named as module:Class")
    try:
        loaded = entry_points[name].load()
    except ModuleNotFoundError as error:
        raise InputError(
            f"agent {name!r} needs the module {error.name!r}, which is not installed; "
            "the extra [agents] brings it (docs/start.md)"
        ) from error
    except Exception as error:  # other people's modules may raise anything
        raise _import_error(name, error) from error
    return checked_agent_class(name, loaded)


def checked_agent_class(name: str, loaded: Any) -> type[Agent]:
    """Returns `loaded` as an `Agent` class.

    Raises:
      InputError: unless it is a subclass of `Agent` or `SingleAgent` that defines `act`, builds by a classmethod and
        needs sensors that there are.
    """
    if not isinstance(loaded, type) or not issubclass(loaded, (Agent, SingleAgent)):
        found = " and ".join(base.__name__ for base in loaded.__bases__) if isinstance(loaded, type) else repr(loaded)
        expected = "expected a subclass of mazebench.Agent or mazebench.SingleAgent"
        raise InputError(f"agent {name!r}: {expected}, found {'one of ' if isinstance(loaded, type) else ''}{found}")
    if loaded.act in (Agent.act, SingleAgent.act):
        raise InputError(f"agent {name!r}: expected a class with act(), found none")
    for method in ("build", "context_size", "default_checkpoint"):
        if inspect.isfunction(inspect.getattr_static(loaded, method)):
            raise InputError(f"agent {name!r}: expected {method}() to be a classmethod, found a method of its objects")
    if not (isinstance(loaded.needs_sensors, tuple) and set(loaded.needs_sensors) <= set(SENSORS)):
        expected = f"expected needs_sensors as a tuple of {', '.join(SENSORS)}"
        raise InputError(f"agent {name!r}: {expected}, found {loaded.needs_sensors!r}")
    return as_agent_class(loaded)


def source_line(error: BaseException) -> str:
    """Returns where in an agent's own files `error` arose, as " (FILE:LINE)"; empty if it arose outside of them."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if not _is_ours(frame.filename)]
    if not frames:
        return ""
    # The agent's own files are those beside the first one; below them are the libraries that it calls.
    folder = pathlib.Path(frames[0].filename).parent
    last = [frame for frame in frames if folder in pathlib.Path(frame.filename).parents][-1]
    return f" ({pathlib.Path(last.filename).name}:{last.lineno})"


def _is_ours(filename: str) -> bool:
    """Returns whether a file belongs to mazebench, or to Python's import system."""
    ours = pathlib.Path(__file__).parent
    return filename.startswith("<") or not {ours, _IMPORTLIB}.isdisjoint(pathlib.Path(filename).parents)


def _import_class(name: str) -> Any:
    module_name, _, class_name = name.partition(":")
    if module_name.endswith(".py"):
        file = pathlib.PurePath(module_name).with_suffix("")
        if file.is_absolute() or ".." in file.parts:
            wanted = f"{file.name}:{class_name} with {file.parent} as the working directory"
        else:
            wanted = f"{'.'.join(file.parts)}:{class_name}"
        raise InputError(f"agent {name!r}: expected module:Class, such as {wanted}, found a file's name")
    if "" not in sys.path and "." not in sys.path:
        sys.path.insert(0, "")
    try:
        return getattr(importlib.import_module(module_name), class_name)
    except (ImportError, AttributeError, ValueError, TypeError) as error:
        found = f"{shortened(str(error))}{source_line(error)}"
        raise InputError(f"agent {name!r}: expected module:Class that can be imported, found: {found}") from error
    except Exception as error:  # other people's modules may raise anything
        raise _import_error(name, error) from error


def _import_error(name: str, error: Exception) -> InputError:
    found = f"{shortened(f'{type(error).__name__}: {error}')}{source_line(error)}"
    return InputError(f"agent {name!r}: its module can't be imported: {found}")


def _entry_points() -> dict[str, metadata.EntryPoint]:
    """Returns the entry points by name; raises `InputError` if two distributions claim one name."""
    found: dict[str, metadata.EntryPoint] = {}
    for entry_point in metadata.entry_points(group=ENTRY_POINT_GROUP):
        known = found.setdefault(entry_point.name, entry_point)
        if known.value != entry_point.value:
            raise InputError(
                f"two agents are called {entry_point.name!r}: {known.value} of {_distribution(known)} "
                f"and {entry_point.value} of {_distribution(entry_point)}; uninstall one"
            )
    return found


def _distribution(entry_point: metadata.EntryPoint) -> str:
    return entry_point.dist.name if entry_point.dist else "an unknown distribution"
