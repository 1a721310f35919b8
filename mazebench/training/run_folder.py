"""The folder of a training run: its config, metrics and checkpoints.

A checkpoint is a milestone, where the agent is evaluated, or a savepoint, from which a run that was stopped goes on.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import pathlib
import re
import shutil
from collections.abc import Callable, Mapping
from typing import Any, Self

import pydantic

from mazebench.errors import InputError, RunError, describe_fault
from mazebench.storage.files import locked, make_folder, open_whole, writing_to
from mazebench.storage.json_files import read_json, read_lines, to_line, write_json
from mazebench.training.counters import Counters

CONFIG = "config.json"
METRICS = "metrics.jsonl"
CHECKPOINTS = "checkpoints"
_COUNTERS = "counters.json"
_CHECKPOINT_NAME = re.compile(r"[0-9]{12,}")  # agent steps; older checkpoints are deleted, so no other folder may match


class RunFolder:
    """The folder of a run, in which no other training writes until it is closed; a context manager."""

    def __init__(self, path: pathlib.Path):
        """Makes the folder.

        Raises:
          InputError: if it can't be written, holds something else, or another training writes there.
        """
        self.path = path = path.absolute()  # agents may change the working folder
        self._board: Any = None
        make_folder(path)
        found = sorted(item.name for item in self.path.iterdir())
        if CONFIG not in found and set(found) - {f"{CONFIG}.tmp", CHECKPOINTS}:
            raise InputError(f"{self.path}: expected an empty folder or a training run's, found {found[0]!r} in it")
        make_folder(self.path / CHECKPOINTS)
        self._lock = contextlib.ExitStack()
        self._lock.enter_context(locked(path, "training"))
        for half_written in (self.path / CHECKPOINTS).glob("*.tmp"):
            if _CHECKPOINT_NAME.fullmatch(half_written.stem):
                shutil.rmtree(half_written, ignore_errors=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._board is not None:
            self._board.close()
        self._lock.close()

    def save_checkpoint(self, counters: Counters, save: Callable[[pathlib.Path], None]) -> None:
        """Lets `save` fill a new checkpoint, which then takes its place at once; the last milestone is kept beside it.

        Raises:
          RunError: if it can't be written; the checkpoints before are intact.
        """
        final = self._checkpoint(counters)
        temporary = final.with_suffix(".tmp")
        try:
            temporary.mkdir()
            save(temporary)
            write_json(temporary / _COUNTERS, dataclasses.asdict(counters))
            os.replace(temporary, final)
        except OSError as error:
            shutil.rmtree(temporary, ignore_errors=True)
            raise self._cannot("save", final, error) from error
        for checkpoint in checkpoints(self.path):
            if int(checkpoint.name) not in (counters.env_steps, counters.milestone_steps):
                shutil.rmtree(checkpoint, ignore_errors=True)

    def make_milestone(self, counters: Counters, metrics: Mapping[str, float]) -> None:
        """Logs the metrics of the checkpoint at `counters`, which then is a milestone."""
        self.log(counters, metrics)
        path = self._checkpoint(counters) / _COUNTERS
        try:
            write_json(path, dataclasses.asdict(counters.at_milestone()))
        except OSError as error:
            raise self._cannot("save", path, error) from error

    def log(self, counters: Counters, metrics: Mapping[str, float]) -> None:
        """Appends a line to the metrics, and writes them for TensorBoard."""
        values = {"env_steps": counters.env_steps, "updates": counters.updates, **metrics}
        try:
            with (self.path / METRICS).open("a", encoding="utf-8") as file:
                file.write(to_line(values))
            if self._board is None:
                from tensorboardX import SummaryWriter

                # What another run wrote of later steps will not be shown. Two commands may begin in one second, so the
                # process's id is in the name.
                self._board = SummaryWriter(
                    str(self.path / "tensorboard"),
                    purge_step=counters.env_steps,
                    flush_secs=10,
                    filename_suffix=f".{os.getpid()}",
                )
            for name, value in values.items():
                self._board.add_scalar(name, value, counters.env_steps)
        except OSError as error:
            raise self._cannot("write", self.path, error) from error

    def forget_metrics_after(self, counters: Counters) -> None:
        """Removes the metrics that a run writes again when it is resumed from the checkpoint at `counters`."""
        path = self.path / METRICS
        with writing_to(self.path):
            kept = [line for line in read_metrics(self.path) if line["env_steps"] <= counters.logged_steps]
            with open_whole(path) as file:
                file.write("".join(map(to_line, kept)).encode("utf-8"))

    def check_config(self, config: dict[str, Any]) -> None:
        """Writes the config, or raises an `InputError` if the folder holds a run of another one."""
        path = self.path / CONFIG
        if not path.exists():
            with writing_to(self.path):
                write_json(path, config)
            return
        before, now = read_json(path), json.loads(json.dumps(config))
        if before != now:
            names = sorted(set(before) | set(now)) if isinstance(before, dict) else []
            name = next((name for name in names if before.get(name) != now.get(name)), "content")
            raise InputError(f"{path}: holds another run, differing in {name!r}")

    def _checkpoint(self, counters: Counters) -> pathlib.Path:
        return self.path / CHECKPOINTS / f"{counters.env_steps:012d}"

    def _cannot(self, do: str, what: pathlib.Path, error: OSError) -> RunError:
        last = next(reversed(checkpoints(self.path)), "none yet")
        return RunError(f"{what}: can't {do}: {error.strerror}; last checkpoint: {last}; go on with --resume")


def checkpoints(path: pathlib.Path) -> list[pathlib.Path]:
    """Returns the complete checkpoints of the run folder `path`, oldest first."""
    return sorted(folder for folder in path.glob(f"{CHECKPOINTS}/*") if _CHECKPOINT_NAME.fullmatch(folder.name))


class _Metrics(pydantic.BaseModel):
    """A line of metrics by their names."""

    model_config = pydantic.ConfigDict(extra="allow", strict=True)
    __pydantic_extra__: dict[str, int | float]
    env_steps: int


def read_metrics(path: pathlib.Path) -> list[dict[str, Any]]:
    """Returns the lines of metrics of the run folder `path`.

    Raises:
      InputError: if a line holds something else.
    """
    return [line.model_dump() for line in read_lines(path / METRICS, _Metrics)]


def read_counters(checkpoint: pathlib.Path) -> Counters:
    """Returns the counters of a checkpoint.

    Raises:
      InputError: if the file holds others.
    """
    path = checkpoint / _COUNTERS
    content = read_json(path)
    try:
        counters = pydantic.TypeAdapter(Counters).validate_python(content)
    except pydantic.ValidationError as error:
        raise InputError(f"{path}: expected the counters of a training, found {describe_fault(error)}") from error
    if dataclasses.asdict(counters) != content or counters.env_steps != int(checkpoint.name):
        raise InputError(f"{path}: expected the counters at {int(checkpoint.name)} agent steps, found others")
    return counters
