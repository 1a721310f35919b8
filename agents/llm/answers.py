"""The answers of a run, each on disk before it counts: a run can be made again from its `answers.jsonl`."""

from __future__ import annotations

import concurrent.futures
import datetime
import hashlib
import pathlib
import threading
from collections.abc import Sequence

import pydantic

from mazebench.errors import InputError, remark
from mazebench.storage.files import make_folder
from mazebench.storage.json_files import read_lines, to_line

from .answer import Answer
from .asking import Asking, write_file
from .budget import Budget
from .config import LLMConfig
from .situation import Situation, key_of, question

ANSWERS, PICTURES = "answers.jsonl", "pictures"


class Answers:
    """The answers that are known; others are asked for."""

    def __init__(self, config: LLMConfig, folder: pathlib.Path | None):
        """Reads the answers in `folder`, in which others are kept, and those to replay.

        Raises:
          InputError: if there are none to replay, or the one to be asked can't be.
        """
        self._config, self._folder, self._changed = config, folder, threading.Lock()
        if config.model.startswith("show:"):
            self._folder = None
        self._file = self._folder and self._folder / ANSWERS
        self._kept = {each.prompt: each for each in read_lines(self._file, Answer)} if self._file else {}
        if self._file and self._file.exists() and not self._file.read_bytes().endswith(b"\n"):
            self._write("\n")  # ends a line that a kill cut short
        self._files = sorted(pathlib.Path(config.replay).rglob(ANSWERS)) if config.replay else []
        self._replayed = {each.prompt: each for file in self._files for each in read_lines(file, Answer)}
        if config.replay and not self._replayed:
            found = _damaged_line(self._files) or "found none"
            raise InputError(f"{config.replay}: expected {ANSWERS} to replay in it or below, {found}")
        self._budget, self._has_said = Budget(config, self._kept.values()), False
        self._asking = Asking(config, folder, self._budget)

    def of(self, situations: Sequence[Situation]) -> list[Answer]:
        """Returns the answers in situations, which are asked for at once. If one can't be had, the others are kept."""
        keys = [key_of(each, self._config.sampling) for each in situations]
        try:
            with concurrent.futures.ThreadPoolExecutor(self._config.concurrency) as threads:
                list(threads.map(self._find, keys, situations))
        finally:
            if self._budget.lacks_usage and not self._has_said:
                self._has_said = True
                counts = "is not counted" if self._config.token_limit is None else "counts as the most that it may take"
                remark(f"agent 'llm': the service tells no usage of an answer, which {counts}")
        return [self._kept[key] for key in keys]

    def _find(self, key: str, situation: Situation) -> None:
        """Finds an answer and keeps it with the pictures of its question, unless it is known."""
        if key in self._kept:
            return
        if self._config.replay and key not in self._replayed:
            found = _damaged_line(self._files) or "found none"
            raise InputError(f"{self._config.replay}: expected the answer in step {situation.step}, {found}")
        asked = question(situation)
        pictures = {hashlib.sha256(png).hexdigest(): png for png in asked.pictures}
        if self._config.replay:
            answer = self._replayed[key]
        else:
            now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
            origin = {"prompt": key, "seed": situation.seed, "decision": situation.number, "time": now}
            answer = self._asking.ask(situation, asked).model_copy(update=origin)
        answer = answer.model_copy(update={"pictures": tuple(pictures)})
        with self._changed:
            if self._folder and pictures:
                make_folder(self._folder / PICTURES)
                for name, png in pictures.items():
                    if not (path := self._folder / PICTURES / f"{name}.png").exists():
                        write_file(path, png)
            self._write(to_line(answer.model_dump()))
            self._kept[key] = answer

    def _write(self, text: str) -> None:
        """Adds a text to the file, at once, since other processes may add to it."""
        if self._file:
            with self._file.open("a", encoding="utf-8") as file:
                file.write(text)


def _damaged_line(files: Sequence[pathlib.Path]) -> str:
    """Returns which line of some files holds no answer, in words; a kill may have cut one. Empty if all do."""
    for file in files:
        for number, line in enumerate(file.read_bytes().splitlines(), 1):
            try:
                Answer.model_validate_json(line or b'{"text": ""}')
            except pydantic.ValidationError:
                return f"found line {number} of {file} damaged"
    return ""
