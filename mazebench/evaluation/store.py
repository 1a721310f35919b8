"""The folder of an evaluation while it runs. What has ended survives a kill at any moment.

The result of an episode that ends becomes a line of `journal.jsonl`, in any order, or with several goals a line for
each leg. When all have ended, `episodes.jsonl`, `trajectories.npz`, pictures of older maps and last `summary.json` are
written, and the journal is removed.
"""

from __future__ import annotations

import contextlib
import json
import pathlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pydantic

from mazebench.errors import InputError, RunError
from mazebench.evaluation.checked_agent import AgentError
from mazebench.evaluation.chunk import Result, to_record, to_trajectory
from mazebench.evaluation.plan import Plan
from mazebench.maps.pair import draw_pair
from mazebench.maps.pictures import write_image
from mazebench.results.reading import CONFIG, EPISODES, JOURNAL, SUMMARY
from mazebench.results.records import Record, Summary
from mazebench.results.trajectories import TRAJECTORIES, Trajectory, save_trajectories
from mazebench.storage.files import make_folder, open_whole, writing_to
from mazebench.storage.json_files import read_json, read_lines, to_line, write_json


def is_finished(folder: pathlib.Path, record: bool = False) -> bool:
    """Returns whether `folder` holds an evaluation that came to its end, with trajectories if those are wanted."""
    names = (SUMMARY, EPISODES, TRAJECTORIES) if record else (SUMMARY, EPISODES)
    # A kill may have left the journal, or a resumed run may record trajectories again.
    return all((folder / name).exists() for name in names) and not (folder / JOURNAL).exists()


def check_same_run(folder: pathlib.Path, identity: Mapping[str, Any]) -> None:
    """Raises `InputError` unless `folder` holds the run of an identity; the message names the first difference."""
    before = read_json(folder / CONFIG)
    if not isinstance(before, dict):
        raise InputError(f"{folder / CONFIG}: expected the identity of a run, found {type(before).__name__}")
    for key, value in json.loads(json.dumps(identity)).items():
        found = before.get(key)
        if found == value:
            continue
        if key == "agent_code_sha256" and found and value:
            raise InputError(f"{folder}: holds another run: its agent's code was changed since; name another folder")
        raise InputError(f"{folder}: holds another run: its {key} is {str(found)[:200]}, this one's {value}")


_Pose = tuple[pydantic.FiniteFloat, pydantic.FiniteFloat, pydantic.FiniteFloat]


class _Line(pydantic.BaseModel):
    """A line of the journal."""

    model_config = pydantic.ConfigDict(strict=True, extra="forbid", arbitrary_types_allowed=True)

    result: Result  # without what was kept
    # As `Trajectory`; empty if none is kept.
    trajectory: tuple[()] | tuple[list[_Pose], list[_Pose] | None]


def write_results(
    folder: pathlib.Path, records: Sequence[Record], trajectories: Sequence[Trajectory], summary: Summary
) -> None:
    """Writes the files of a finished evaluation, with the trajectories of all records or of none."""
    with open_whole(folder / EPISODES) as file:
        file.write("".join(each.to_line() for each in records).encode("utf-8"))
    if trajectories:
        save_trajectories(folder / TRAJECTORIES, trajectories)
    write_json(folder / SUMMARY, summary.to_dict())


class Store:
    """The episodes that have ended of one evaluation, on disk and in memory; a context manager."""

    def __init__(self, folder: pathlib.Path, plan: Plan, *, resume: bool, record: bool | None):
        """Makes the folder ready and reads what has ended.

        A run that began with trajectories goes on with them, whatever `record` says. None records a run that begins,
        and goes on as it began.

        Raises:
          InputError: if the folder can't be written, or holds another run or anything else.
        """
        self.folder, self._plan, self._num_legs = folder, plan, plan.task.options.num_goals
        make_folder(folder)
        found = {path.name for path in folder.iterdir() if path.suffix != ".tmp"}
        if found & {CONFIG, JOURNAL} and not resume:  # a kill may have left the journal alone
            raise InputError(f"{folder}: holds a run already; go on with --resume or name another folder")
        self._is_new = CONFIG not in found
        if not self._is_new:
            check_same_run(folder, plan.identity)
        elif found - {JOURNAL}:
            raise InputError(f"{folder}: expected an empty folder or one of a run, found {min(found)!r} in it")
        # A line that a kill cut short is passed over: its episode is run again.
        lines = read_lines(folder / JOURNAL, _Line)
        if self._is_new and lines:
            raise InputError(f"{folder}: expected {CONFIG} of the run in {JOURNAL}, found none; name another folder")
        ended = [self._read(line) for line in lines]
        self.record = any(trajectory for _, trajectory in ended) or (not ended if record is None else record)
        # By episode and leg; an episode whose last legs a kill cut off is run again.
        whole = {each.episode for each, _ in ended if each.leg == self._num_legs}
        self._ended = {
            (each.episode, each.leg): (each, trajectory)
            for each, trajectory in ended
            if each.episode in whole and (trajectory or not self.record)
        }
        with writing_to(folder):
            # Of two processes that begin a run, the second one fails here.
            self._journal = (folder / JOURNAL).open("a" if resume else "x", encoding="utf-8")
            self._journal.write("\n")  # ends a line that a kill cut short
            if self._is_new:
                write_json(folder / CONFIG, plan.identity)

    @property
    def num_ended(self) -> int:
        """The number of episodes that have ended."""
        return len(self._ended) // self._num_legs

    @property
    def missing(self) -> list[int]:
        """The indices of the episodes that are left to run."""
        return [index for index in range(len(self._plan.trials)) if (index, 1) not in self._ended]

    @property
    def records(self) -> list[Record]:
        """The records of the episodes that have ended, in protocol order."""
        return [self._ended[key][0] for key in sorted(self._ended)]

    def _read(self, line: _Line) -> tuple[Record, Trajectory | None]:
        """Returns the record of a line of the journal, and its trajectory.

        Raises:
          InputError: if it is of no episode of the plan.
        """
        result, where = line.result, f"{self.folder / JOURNAL}: expected results of the run's episodes"
        if result.number >= len(self._plan.trials) or not 1 <= result.leg <= self._num_legs:
            raise InputError(f"{where}, found one of {result.number}, leg {result.leg}")
        poses = [None if each is None else np.array(each, dtype=np.float32) for each in line.trajectory]
        if not all(each is None or len(each) == result.steps + 1 for each in poses):
            raise InputError(f"{where}, found a trajectory of another length of episode {result.number}")
        trajectory = Trajectory(*poses) if poses else None  # type: ignore[arg-type]  # the true poses are there
        return to_record(self._plan, result), trajectory

    def append(self, results: Sequence[Result]) -> None:
        """Adds episodes that ended.

        Raises:
          RunError: if the disk is full or can't be written any more.
        """
        ended = {
            (each.number, each.leg): (to_record(self._plan, each), to_trajectory(self._plan, each)) for each in results
        }
        with self._keeping_what_is_written():
            for result in results:
                _, trajectory = ended[result.number, result.leg]
                poses = [None if each is None else each.tolist() for each in trajectory or ()]
                self._journal.write(to_line({"result": result._replace(kept=())._asdict(), "trajectory": poses}))
            self._journal.flush()
        self._ended |= ended

    def finish(self, records: Sequence[Record], summary: Summary) -> None:
        """Writes the results; `records` are those that ended in protocol order, with the oracle's steps."""
        trajectories = [self._ended[key][1] for key in sorted(self._ended)] if self.record else []
        with self._keeping_what_is_written():
            pairs = [(each.pair, each.maze) for each in self._plan.task.arena.shown or () if each.pair is not None]
            for number, (pair, maze) in enumerate(pairs, 1):
                name = f"pair-{number}.png" if len(pairs) > 1 else "pair.png"
                write_image(draw_pair(pair, maze), self.folder / name)
            write_results(self.folder, records, [each for each in trajectories if each], summary)
            (self.folder / JOURNAL).unlink(missing_ok=True)

    @contextlib.contextmanager
    def _keeping_what_is_written(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            is_kept = (self.folder / JOURNAL).exists()
            kept = "what was written is kept, go on with --resume" if is_kept else "its journal is gone"
            raise RunError(f"{self.folder}: can't write there: {error.strerror}; {kept}") from error

    def __enter__(self) -> Store:
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        with contextlib.suppress(OSError):  # of a line that could not be written, which was reported
            self._journal.close()
        # A run that the agent can't play leaves nothing. One that was stopped keeps its config, and so does one in
        # which the agent keeps files.
        if self._is_new and not self._ended and kind is not None and issubclass(kind, InputError | AgentError):
            with contextlib.suppress(OSError):
                if {path.name for path in self.folder.iterdir()} <= {JOURNAL, CONFIG}:
                    for name in (JOURNAL, CONFIG):
                        (self.folder / name).unlink(missing_ok=True)
                    self.folder.rmdir()
