"""The folder of an evaluation while it runs. What has ended survives a kill at any moment.

`config.json` identifies the run, and `oracle.json` holds the oracle's steps, as soon as they are known. An episode that
ends becomes a line of `journal.jsonl`, in any order. When all have ended, `episodes.jsonl`, `trajectories.npz` and last
`summary.json` are written, each whole, and the journal is removed.
"""

from __future__ import annotations

import contextlib
import json
import pathlib
from collections.abc import Iterator, Sequence
from typing import Any

import pydantic

from mazebench.errors import InputError, RunError, describe_fault
from mazebench.evaluation.chunk import Ended
from mazebench.evaluation.plan import Plan
from mazebench.results.metrics import Steps
from mazebench.results.reading import CONFIG, EPISODES, JOURNAL, ORACLE, SUMMARY, load_result, read_oracle_steps
from mazebench.results.records import Record, Summary
from mazebench.results.trajectories import (
    TRAJECTORIES,
    from_json,
    load_trajectories,
    pack_trajectories,
    save_trajectories,
    to_json,
)
from mazebench.storage.files import make_folder, open_to_write, open_whole, writing_to
from mazebench.storage.json_files import read_json, repair_and_read_lines, write_json
from mazebench.storage.locks import FolderLock


def is_finished(folder: pathlib.Path, record: bool = False) -> bool:
    """Returns whether `folder` holds an evaluation that came to its end, with trajectories if those are wanted."""
    names = (SUMMARY, EPISODES, TRAJECTORIES) if record else (SUMMARY, EPISODES)
    # A kill may have left the journal, or trajectories may be recorded in another sitting.
    return all((folder / name).exists() for name in names) and not (folder / JOURNAL).exists()


def load_finished(folder: pathlib.Path) -> Summary:
    """Returns the summary of the finished evaluation in `folder`, whose files are all read.

    Raises:
      InputError: if one of them is damaged; the message says how to mend that.
    """
    try:
        result = load_result(folder)
        if (folder / TRAJECTORIES).exists():
            load_trajectories(folder / TRAJECTORIES, len(result.records))
    except InputError as error:
        advice = "delete the damaged file, and --resume runs the episodes again, for trajectories with --record"
        raise InputError(f"{error}; {advice}") from error
    return result.summary


def check_same_run(folder: pathlib.Path, plan: Plan) -> None:
    """Raises `InputError` unless `folder` holds the run of `plan`; the message names the first difference."""
    before = read_json(folder / CONFIG)
    for key, value in json.loads(json.dumps(plan.identity)).items():
        found = before.get(key) if isinstance(before, dict) else before
        if found == value:
            continue
        if key == "agent_code_sha256" and found and value:
            what = "file" if ":" in str(before.get("agent")) else "package"
            raise InputError(f"{folder}: holds another run: its agent's {what} was changed since; name another folder")
        raise InputError(f"{folder}: holds another run: its {key} is {str(found)[:200]}, this one's {value}")


class Store:
    """What has ended of one evaluation, on disk and in memory; a context manager, alone in its folder."""

    def __init__(self, folder: pathlib.Path, plan: Plan, *, resume: bool, record: bool):
        """Makes the folder ready and reads what has ended.

        A run that began with trajectories goes on with them, whatever `record` says.

        Raises:
          InputError: if the folder can't be written, is in use, holds another run or is damaged.
        """
        self.folder, self._plan = folder, plan
        self._made_folder = not folder.exists()
        make_folder(folder)
        with contextlib.ExitStack() as opened, writing_to(folder):
            opened.enter_context(FolderLock(folder))
            _prepare(folder, plan, resume)
            self.oracle_steps = read_oracle_steps(folder, len(plan.trials))  # None if they are not known yet
            ended = _read_journal(folder / JOURNAL, plan)
            self.record = record or any(trajectory is not None for _, trajectory in ended)
            self._ended = {each.record.episode: each for each in ended if each.trajectory or not self.record}
            self._journal = opened.enter_context(contextlib.closing(open_to_write(folder / JOURNAL, "a")))
            self._opened = opened.pop_all()

    @property
    def num_ended(self) -> int:
        """How many episodes have ended."""
        return len(self._ended)

    @property
    def missing(self) -> list[int]:
        """The indices of the episodes that are left to run."""
        return [index for index in range(len(self._plan.trials)) if index not in self._ended]

    @property
    def records(self) -> list[Record]:
        """The records of the episodes that have ended, in protocol order."""
        return [self._ended[index].record for index in sorted(self._ended)]

    def keep_oracle_steps(self, steps: Steps) -> None:
        """Writes the oracle's steps in all episodes.

        Raises:
          RunError: as for `append`.
        """
        with self._keeping_what_is_written():
            write_json(self.folder / ORACLE, {"steps": steps}, indent=None)
        self.oracle_steps = steps

    def append(self, ended: Sequence[Ended]) -> None:
        """Adds episodes that ended.

        Raises:
          RunError: if the disk is full or can't be written any more.
        """
        with self._keeping_what_is_written():
            self._journal.write("".join(map(_to_line, ended)))
            self._journal.flush()
        self._ended |= {each.record.episode: each for each in ended}

    def finish(self, summary: Summary) -> None:
        """Writes the results; all episodes must have ended.

        Raises:
          RunError: as for `append`.
        """
        ended = [self._ended[index] for index in range(len(self._plan.trials))]
        with self._keeping_what_is_written():
            with open_whole(self.folder / EPISODES) as file:
                file.write("".join(each.record.to_line() for each in ended).encode("utf-8"))
            if self.record:
                trajectories = [each.trajectory for each in ended if each.trajectory]
                save_trajectories(self.folder / TRAJECTORIES, pack_trajectories(trajectories))
            write_json(self.folder / SUMMARY, summary.to_dict())
            (self.folder / JOURNAL).unlink()

    @contextlib.contextmanager
    def _keeping_what_is_written(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise RunError(
                f"{self.folder}: can't write there: {error.strerror}; what was written is kept, go on with --resume"
            ) from error

    def __enter__(self) -> Store:
        return self

    def __exit__(self, kind: type[BaseException] | None, *exception: object) -> None:
        if self._made_folder and not self._ended and kind is not None and issubclass(kind, InputError):
            self._clear()
        with contextlib.suppress(OSError):  # of a line that could not be written, which was reported
            self._opened.close()

    def _clear(self) -> None:
        """Removes what a run left that was refused before an episode ended, such as one that its agent can't play."""
        with contextlib.suppress(OSError):  # the refusal matters more
            (self.folder / JOURNAL).unlink()
            (self.folder / ORACLE).unlink(missing_ok=True)
            (self.folder / CONFIG).unlink()
            self.folder.rmdir()


def _prepare(folder: pathlib.Path, plan: Plan, resume: bool) -> None:
    """Makes `folder` ready to hold the run of `plan`, or refuses."""
    found = {path.name for path in folder.iterdir() if path.suffix != ".tmp"}
    journal = folder / JOURNAL
    if found <= {CONFIG, ORACLE, JOURNAL} and not (journal.exists() and journal.stat().st_size):  # no episode has ended
        (folder / ORACLE).unlink(missing_ok=True)  # it may be of another run
        write_json(folder / CONFIG, plan.identity)
        return
    if CONFIG not in found:
        raise InputError(f"{folder}: expected an empty folder or an evaluation's, found {min(found)!r} in it")
    if not resume:
        raise InputError(f"{folder}: holds a run already; go on with --resume or name another folder")
    check_same_run(folder, plan)


def _read_journal(path: pathlib.Path, plan: Plan) -> list[Ended]:
    """Returns the episodes in a journal; a last line that a kill cut short is removed.

    Raises:
      InputError: if a whole line is damaged or of another run.
    """
    ended = []
    for number, content in enumerate(repair_and_read_lines(path), 1):
        try:
            ended.append(_from_json(content, plan))
        except ValueError as error:
            fault = describe_fault(error) if isinstance(error, pydantic.ValidationError) else str(error)
            raise InputError(f"{path}: expected an episode of this run in line {number}, found {fault}") from error
    return ended


def _to_line(ended: Ended) -> str:
    content: dict[str, Any] = {"record": ended.record.model_dump()}
    if ended.trajectory:
        content["trajectory"] = to_json(ended.trajectory)
    return json.dumps(content, separators=(",", ":"), allow_nan=False) + "\n"


def _from_json(content: dict[str, Any], plan: Plan) -> Ended:
    """Raises `ValueError` if `content` is no episode of `plan`."""
    record = Record.model_validate_json(json.dumps(content.get("record")))
    if record.episode >= len(plan.trials):
        raise ValueError(f"episode {record.episode} of {len(plan.trials)}")
    episode = plan.trials[record.episode].episode
    found, expected = [record.start, record.goal, record.seed], [episode.start, episode.goal, episode.seed]
    if found != expected:
        raise ValueError(f"episode {record.episode} with start, goal and seed {found} in place of {expected}")
    trajectory = content.get("trajectory")
    return Ended(record, None if trajectory is None else from_json(trajectory, plan.task.size))
