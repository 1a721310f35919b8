"""What a training run keeps on disk: config, metrics, checkpoints; one process at a time, whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
import pathlib
import re
import shutil
import time
from collections.abc import Callable
from typing import Any

from mazebench.errors import InputError, RunError
from mazebench.files import WriteError, make_folder, open_to_write, open_whole, writing_to
from mazebench.records import FolderLock, read_json, repair_and_read_lines, to_line, write_json

CONFIG = "config.json"
METRICS = "metrics.jsonl"
CHECKPOINTS = "checkpoints"
COUNTERS = "counters.json"
_BOARD = "tensorboard"
_KEPT_CHECKPOINTS = 2
_CHECKPOINT_NAME = re.compile(r"[0-9]{12,}")  # agent steps; older ones are removed, so nothing else must look alike


class RunFolder:
    """A folder that this process alone writes to; a context manager."""

    def __init__(self, path: pathlib.Path):
        """Makes and locks the folder.

        Raises:
          InputError: if it can't be written, or another process uses it.
        """
        self.path = path
        self._board: _Board | None = None
        make_folder(path)
        with contextlib.ExitStack() as opened:
            opened.enter_context(FolderLock(path))
            self._prepare()
            self._opened = opened.pop_all()

    def _prepare(self) -> None:
        found = sorted(item.name for item in self.path.iterdir())
        if CONFIG not in found and set(found) - {f"{CONFIG}.tmp", CHECKPOINTS}:
            raise InputError(f"{self.path}: expected an empty folder or a training run's, found {found[0]!r} in it")
        make_folder(self.path / CHECKPOINTS, within=self.path)
        for half_written in (self.path / CHECKPOINTS).glob("*.tmp"):
            if _CHECKPOINT_NAME.fullmatch(half_written.stem):
                shutil.rmtree(half_written, ignore_errors=True)
        if CONFIG not in found and self.checkpoints():
            raise InputError(f"{self.path}: expected {CONFIG} beside the checkpoints, found none")

    def checkpoints(self) -> list[pathlib.Path]:
        """The complete checkpoints, oldest first."""
        return checkpoints(self.path)

    def save_checkpoint(self, env_steps: int, counters: dict[str, Any], save: Callable[[pathlib.Path], None]) -> None:
        """Lets `save` fill a new checkpoint, which then takes its place at once; the last two are kept.

        Raises:
          RunError: if it can't be written; the checkpoints before are intact.
        """
        final = self.path / CHECKPOINTS / f"{env_steps:012d}"
        temporary = final.with_suffix(".tmp")
        try:
            temporary.mkdir()
            save(temporary)
            write_json(temporary / COUNTERS, counters)
            for path in temporary.iterdir():
                _sync(path)
            shutil.rmtree(final, ignore_errors=True)
            os.replace(temporary, final)
        except OSError as error:
            shutil.rmtree(temporary, ignore_errors=True)
            raise self._cannot("save", final, error) from error
        for old in self.checkpoints()[:-_KEPT_CHECKPOINTS]:
            shutil.rmtree(old, ignore_errors=True)

    def log(self, metrics: dict[str, Any]) -> None:
        """Appends a line to the metrics.

        Raises:
          RunError: if it can't be written; the checkpoints are intact.
        """
        try:
            with open_to_write(self.path / METRICS, "a") as file:
                file.write(to_line(metrics))
            if self._board is None:
                make_folder(self.path / _BOARD, within=self.path)
                self._board = _Board(self.path / _BOARD, metrics["env_steps"])
            self._board.add(metrics, metrics["env_steps"])
        except (OSError, WriteError) as error:
            raise self._cannot("write", self.path, error) from error

    def forget_metrics_after(self, env_steps: int) -> None:
        """Removes the metrics of steps that a resumed run takes again."""
        path = self.path / METRICS
        with writing_to(self.path):
            kept = [line for line in repair_and_read_lines(path, "env_steps") if line["env_steps"] <= env_steps]
            with open_whole(path) as file:
                file.write("".join(map(to_line, kept)).encode("utf-8"))

    def check_config(self, config: dict[str, Any]) -> None:
        """Writes the config, or compares it with the one there.

        Raises:
          InputError: if the folder holds a run of another config.
        """
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

    def __enter__(self) -> RunFolder:
        return self

    def __exit__(self, *exception: object) -> None:
        self._opened.close()

    def _cannot(self, do: str, what: pathlib.Path, error: OSError | WriteError) -> RunError:
        last = next(reversed(self.checkpoints()), "none yet")
        said = error.strerror if isinstance(error, OSError) else str(error)
        return RunError(f"{what}: can't {do}: {said}; last checkpoint: {last}; go on with --resume")


def checkpoints(path: pathlib.Path) -> list[pathlib.Path]:
    """The complete checkpoints of the run folder `path`, oldest first."""
    return sorted(folder for folder in path.glob(f"{CHECKPOINTS}/*") if _CHECKPOINT_NAME.fullmatch(folder.name))


class _Board:
    """What TensorBoard shows of a sitting.

    Written by tensorboardX's inner writer: its outer one writes in a thread, whose errors reach nobody.
    """

    def __init__(self, folder: pathlib.Path, step: int):
        from tensorboardX.event_file_writer import EventsWriter
        from tensorboardX.proto.event_pb2 import Event, SessionLog

        # With the process, as the clock may go back to the second of another sitting.
        self._writer = EventsWriter(str(folder / "events"), f".{os.getpid()}")
        # A resumed run takes steps again: what TensorBoard shows of them from before is purged.
        self._writer.write_event(Event(step=step, session_log=SessionLog(status=SessionLog.START)))

    def add(self, values: dict[str, Any], step: int) -> None:
        """Writes them to the disk."""
        from tensorboardX.proto.event_pb2 import Event
        from tensorboardX.summary import scalar

        for name, value in values.items():
            self._writer.write_event(Event(step=step, wall_time=time.time(), summary=scalar(name, value)))
        self._writer.flush()


def _sync(path: pathlib.Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())
