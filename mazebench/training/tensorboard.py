"""Scalars of a training run for TensorBoard."""

from __future__ import annotations

import os
import pathlib
import time
from collections.abc import Mapping


class Board:
    """Writes scalars of a run.

    It uses tensorboardX's inner writer, since the outer one writes in a thread whose errors reach nobody.
    """

    def __init__(self, folder: pathlib.Path, step: int):
        """Purges what TensorBoard shows of steps from `step` on, which a resumed run takes again."""
        from tensorboardX.event_file_writer import EventsWriter
        from tensorboardX.proto.event_pb2 import Event, SessionLog

        # Two commands may begin in one second, so the process's id is in the name.
        self._writer = EventsWriter(str(folder / "events"), f".{os.getpid()}")
        self._writer.write_event(Event(step=step, session_log=SessionLog(status=SessionLog.START)))

    def add(self, values: Mapping[str, float], step: int) -> None:
        """Writes `values` by name to the disk."""
        from tensorboardX.proto.event_pb2 import Event
        from tensorboardX.summary import scalar

        for name, value in values.items():
            self._writer.write_event(Event(step=step, wall_time=time.time(), summary=scalar(name, value)))
        self._writer.flush()
