"""What a training run keeps on disk: config, metrics, checkpoints; one process at a time, whole or not at all."""

from __future__ import annotations

import json
import os
import pathlib
import re
import shutil
from collections.abc import Callable
from typing import Any

from mazebench.errors import InputError, RunError
from mazebench.records import (
    FolderLock,
    make_folder,
    open_to_write,
    read_json,
    repair_and_read_lines,
    to_line,
    write_json,
)

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
        self._board: Any = None
        found = sorted(item.name for item in path.iterdir()) if path.is_dir() else []
        if CONFIG not in found and set(found) - {f"{CONFIG}.tmp", CHECKPOINTS}:
            raise InputError(f"{path}: expected an empty folder or a training run's, found {found[0]!r} in it")
        make_folder(path)
        self._lock = FolderLock(path)
        (path / CHECKPOINTS).mkdir(exist_ok=True)
        if CONFIG not in found and self.checkpoints():
            raise InputError(f"{path}: expected {CONFIG} beside the checkpoints, found none")

    def checkpoints(self) -> list[pathlib.Path]:
        """The complete checkpoints, oldest first."""
        folders = (self.path / CHECKPOINTS).iterdir()
        return sorted(path for path in folders if _CHECKPOINT_NAME.fullmatch(path.name))

    def save_checkpoint(self, env_steps: int, counters: dict[str, Any], save: Callable[[pathlib.Path], None]) -> None:
        """Lets `save` fill a new checkpoint, which then takes its place at once; the last two are kept.

        Raises:
          RunError: if it can't be written; the checkpoints before are intact.
        """
        final = self.path / CHECKPOINTS / f"{env_steps:012d}"
        temporary = final.with_suffix(".tmp")
        shutil.rmtree(temporary, ignore_errors=True)
        try:
            temporary.mkdir()
            save(temporary)
            write_json(temporary / COUNTERS, counters)
            shutil.rmtree(final, ignore_errors=True)
            os.replace(temporary, final)
        except OSError as error:
            shutil.rmtree(temporary, ignore_errors=True)
            last = next(reversed(self.checkpoints()), None)
            raise RunError(f"{final}: can't save: {error.strerror}; the last checkpoint is {last}") from error
        for old in self.checkpoints()[:-_KEPT_CHECKPOINTS]:
            shutil.rmtree(old)

    def log(self, metrics: dict[str, Any]) -> None:
        """Appends a line to the metrics."""
        with open_to_write(self.path / METRICS, "a") as file:
            file.write(to_line(metrics))
        step = metrics["env_steps"]
        if self._board is None:
            import tensorboardX

            # A resumed run takes steps again: what TensorBoard shows of them from before is purged.
            self._board = tensorboardX.SummaryWriter(str(self.path / _BOARD), purge_step=step)
        for name, value in metrics.items():
            self._board.add_scalar(name, value, step)
        self._board.flush()

    def forget_metrics_after(self, env_steps: int) -> None:
        """Removes the metrics of steps that a resumed run takes again."""
        path = self.path / METRICS
        kept = [line for line in repair_and_read_lines(path, "env_steps") if line["env_steps"] <= env_steps]
        temporary = path.with_suffix(".tmp")
        with open_to_write(temporary, "w") as file:
            file.write("".join(map(to_line, kept)))
        temporary.replace(path)

    def check_config(self, config: dict[str, Any]) -> None:
        """Writes the config, or compares it with the one there.

        Raises:
          InputError: if the folder holds a run of another config.
        """
        path = self.path / CONFIG
        if not path.exists():
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
        if self._board is not None:
            self._board.close()
        self._lock.__exit__()
