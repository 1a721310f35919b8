"""The provenance of a result: versions, benchmark, checkpoint, options, command and machine."""

from __future__ import annotations

import functools
import hashlib
import inspect
import json
import os
import pathlib
import platform
import struct
import sys
from collections.abc import Sequence
from importlib import metadata
from typing import Any, NamedTuple

from mazebench.agent import Agent
from mazebench.agent_loading import package_of
from mazebench.constants import TASK_VERSION
from mazebench.errors import InputError, one_line
from mazebench.evaluation.checked_agent import calling
from mazebench.evaluation.eval_options import EvalOptions
from mazebench.maps.benchmark import manifest_hash
from mazebench.results.played import mazes_hash
from mazebench.results.records import Provenance
from mazebench.storage.files import open_file
from mazebench.storage.json_files import parse_json
from mazebench.tasks.task import Task
from mazebench.world.looks import LOOKS_VERSION, VARIED

_PACKAGES = (
    *("mazebench-mujoco", "mujoco", "dm-control", "dm-env", "gymnasium", "numpy", "scipy"),
    *("opencv-python-headless", "torch"),
)
_STANDARD, _INSTALLED = pathlib.Path(os.__file__).parent, {"site-packages", "dist-packages"}  # folders of libraries
_OTHERS = {"__main__", "mazebench", "mazebench_agents"}  # of the modules next to an agent's file: no part of it
# Of a checkpoint. What they hold must leave a summary that can be read again, where it takes up to ten times the bytes.
_MAX_HEADER_BYTES = 2**18


def provenance(options: EvalOptions, task: Task, agent_class: type[Agent]) -> Provenance:
    """Returns what lets someone else repeat the run; the version of a package that is not installed is None."""
    checkpoint = options.checkpoint
    if checkpoint and checkpoint == str(agent_class.default_checkpoint()):
        checkpoint = pathlib.Path(checkpoint).name  # the folder depends on the installation
    if ":" in options.agent:
        names = _distributions().get(agent_class.__module__.partition(".")[0])
        package = f"{names[0]} {_version(names[0])}" if names else None
    else:
        package = package_of(options.agent)
    with calling(options.agent, "map_reader"):
        reader = agent_class.map_reader(task.interface)
    content = {
        "benchmark_manifest_sha256": manifest_hash(task.options.benchmark),
        "task_version": TASK_VERSION,
        "looks_version": LOOKS_VERSION if task.options.look == VARIED else None,
        "checkpoint": None if checkpoint is None else one_line(checkpoint),
        "checkpoint_sha256": file_hash(options.checkpoint),
        "map_reader_sha256": file_hash(None if reader is None else str(reader)),
        "checkpoint_metadata": checkpoint_metadata(options.checkpoint),
        "agent_class": f"{agent_class.__module__}:{agent_class.__qualname__}",
        "agent_package": package,
        "agent_code_sha256": code_hash(options.agent, agent_class),
        "seed": options.seed,
        "episodes_per_distance": options.episodes_per_distance,
        "command": [one_line(word) for word in (pathlib.Path(sys.argv[0]).name, *sys.argv[1:])],
        "python": platform.python_version(),
        "packages": package_versions(),
        "machine": {
            "system": platform.system(),
            "release": platform.release(),
            "processor": platform.machine(),
            "cores": os.cpu_count(),
        },
        "mazes_sha256": mazes_hash(task),
    }
    return Provenance.model_validate_json(json.dumps(content))  # as a reader will find it


class Files(NamedTuple):
    """Python files, and the folder in which they have their names."""

    paths: Sequence[pathlib.Path]
    folder: pathlib.Path


def code_hash(agent: str, agent_class: type[Agent]) -> str | None:
    """Returns the SHA-256 of the names and contents of an agent's files, which may be edited before a resume.

    None for a class in no file, as of a notebook or an archive.
    """
    files = agent_files(agent, agent_class)
    return None if files is None else files_hash(*files)


def agent_files(agent: str, agent_class: type[Agent]) -> Files | None:
    """Returns an agent's Python files; None for a class in no file.

    Of an installed agent, they are all files of its package. Of a `module:Class`, they are the files of those modules
    that are loaded from its package or, of a single file, from the folder that it lies in and those below.
    """
    try:
        file = pathlib.Path(inspect.getfile(agent_class)).absolute()
    except (TypeError, OSError):
        return None
    if not file.is_file():
        return None
    name = agent_class.__module__.partition(".")[0]
    folders = tuple(map(pathlib.Path, getattr(sys.modules[name], "__path__", ())))
    if folders and ":" not in agent:
        return _package_files(folders)

    # The loaded files of the package, or those next to a single file that are no installed ones.
    loaded = {
        pathlib.Path(path).absolute(): each.partition(".")[0]
        for each, module in list(sys.modules.items())
        if (path := getattr(module, "__file__", None)) and path.endswith(".py")
    }
    if folders:
        files = {path for path, package in loaded.items() if package == name}
    else:
        beside = {path for path, package in loaded.items() if file.parent in path.parents and package not in _OTHERS}
        files = {path for path in beside if _STANDARD not in path.parents and not _INSTALLED & set(path.parts)}
    files = {path for path in files if path.is_file()} | {file}
    return Files(sorted(files), folders[0].absolute() if folders else file.parent)


def own_files() -> Files:
    """Returns the files of mazebench itself, without its agents."""
    return _package_files((pathlib.Path(__file__).parents[1],))


@functools.cache
def _package_files(folders: tuple[pathlib.Path, ...]) -> Files:
    return Files([path for folder in folders for path in sorted(folder.rglob("*.py"))], folders[0])


def files_hash(files: Sequence[pathlib.Path], folder: pathlib.Path) -> str:
    """Returns the SHA-256 of the names in a folder and the contents of files."""
    digest = hashlib.sha256()
    for path in files:
        content = path.read_bytes()
        digest.update(f"{os.path.relpath(path, folder)} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def file_hash(path: str | None) -> str | None:
    """Returns the SHA-256 of a file; None for None."""
    if path is None:
        return None
    with open_file(path, "checkpoint") as file:
        try:
            return hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:
            raise InputError(f"{path}: can't read the checkpoint: {error.strerror}") from error


def checkpoint_metadata(path: str | None) -> dict[str, Any] | None:
    """Returns a checkpoint's metadata, the config and training; None if it is no safetensors file with JSON.

    Only the file's header is read; the agent itself checks the rest.
    """
    if path is None:
        return None
    with open_file(path, "checkpoint") as file:
        start = file.read(8)
        length = struct.unpack("<Q", start)[0] if len(start) == 8 else 0
        header = file.read(length) if length <= _MAX_HEADER_BYTES else b""
    try:
        found = {key: parse_json(text) for key, text in parse_json(header)["__metadata__"].items()}
        json.dumps(found, allow_nan=False)  # as a summary will hold it
        return found
    except (ValueError, KeyError, TypeError, AttributeError):
        return None


_distributions = functools.cache(metadata.packages_distributions)  # takes 0.4 s


def package_versions(*others: str) -> dict[str, str | None]:
    """Returns the versions of the packages that results may depend on; None of one that is not installed."""
    return {name: _version(name) for name in (*_PACKAGES, *others)}


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None
