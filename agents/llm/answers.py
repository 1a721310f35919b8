"""The answers of a run, each on disk before it counts: a run can be made again from its `answers.jsonl`."""

from __future__ import annotations

import concurrent.futures
import contextlib
import datetime
import hashlib
import json
import pathlib
import threading
from collections.abc import Iterator, Sequence

import pydantic

from mazebench.errors import InputError, RunError, remark
from mazebench.storage.json_files import read_lines, to_line

from .answer import RESUME, Answer
from .asking import ask
from .config import LLMConfig
from .situation import Situation, messages

ANSWERS = "answers.jsonl"


class Answers:
    """The answers that are known; others are asked for."""

    def __init__(self, config: LLMConfig, folder: pathlib.Path | None):
        """Reads the answers in `folder`, in which others are kept, and those to replay: `InputError` if none are."""
        self._config, self._folder, self._changed = config, folder, threading.Condition()
        self._file = folder / ANSWERS if folder and not config.model.startswith("show:") else None
        self._kept = {each.prompt: each for each in read_lines(self._file, Answer)} if self._file else {}
        if self._file and self._file.exists() and not self._file.read_bytes().endswith(b"\n"):
            self._write("\n")  # ends a line that a kill cut short
        self._files = sorted(pathlib.Path(config.replay).rglob(ANSWERS)) if config.replay else []
        self._replayed = {each.prompt: each for file in self._files for each in read_lines(file, Answer)}
        if config.replay and not self._replayed:
            found = _damaged_line(self._files) or "found none"
            raise InputError(f"{config.replay}: expected {ANSWERS} to replay in it or below, {found}")
        # Tokens that were spent, and those that requests under way may take; of answers without usage, the most.
        self._spent, self._under_way = sum(self._cost(each, 0) for each in self._kept.values()), 0
        self._lacks_usage = self._has_said = False

    def of(self, situations: Sequence[Situation]) -> list[Answer]:
        """Returns the answers in situations, which are asked for at once. If one can't be had, the others are kept."""
        asked = [[messages(each), self._config.sampling, each.seed] for each in situations]
        keys = [hashlib.sha256(json.dumps(each, sort_keys=True).encode()).hexdigest() for each in asked]
        try:
            with concurrent.futures.ThreadPoolExecutor(self._config.concurrency) as threads:
                list(threads.map(self._find, keys, situations))
        finally:
            if self._lacks_usage and not self._has_said:
                self._has_said = True
                counts = "is not counted" if self._config.token_limit is None else "counts as the most that it may take"
                remark(f"agent 'llm': the service tells no usage of an answer, which {counts}")
        return [self._kept[key] for key in keys]

    def _find(self, key: str, situation: Situation) -> None:
        """Finds an answer and keeps it, unless it is known."""
        if key in self._kept:
            return
        if self._config.replay:
            if key not in self._replayed:
                found = _damaged_line(self._files) or "found none"
                raise InputError(f"{self._config.replay}: expected the answer in step {situation.step}, {found}")
            answer = self._replayed[key]
        else:
            now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
            origin = {"prompt": key, "seed": situation.seed, "decision": situation.number, "time": now}
            with self._within_limit(situation) as most:
                answer = ask(situation, self._config, self._folder).model_copy(update=origin)
                with self._changed:
                    self._spent += self._cost(answer, most)
                    self._lacks_usage |= self._config.asks_service and not answer.input_tokens + answer.output_tokens
        with self._changed:
            self._write(to_line(answer.model_dump()))
            self._kept[key] = answer

    @contextlib.contextmanager
    def _within_limit(self, situation: Situation) -> Iterator[int]:
        """Waits until a question fits within `token_limit`, and yields the tokens that it may take.

        A prompt has no more tokens than bytes.

        Raises:
          RunError: if it fits no more, whatever those under way take.
        """
        limit = self._config.token_limit
        if limit is None or not self._config.asks_service:
            yield 0
            return
        most = len(json.dumps(messages(situation))) + self._longest_answer
        with self._changed:
            while self._spent + self._under_way + most > limit:
                if not self._under_way:
                    spent = (
                        f"spent {self._spent:,} tokens of token_limit {limit:,}, and the next answer may take {most:,}"
                    )
                    raise RunError(f"{spent} (its prompt, and max_tokens); {RESUME}")
                self._changed.wait()
            self._under_way += most
        try:
            yield most
        finally:
            with self._changed:
                self._under_way -= most
                self._changed.notify_all()

    @property
    def _longest_answer(self) -> int:
        """The most tokens of an answer, as it is asked for; all that are left to spend if the request has no bound."""
        fields = self._config.sampling
        most, count = fields.get("max_completion_tokens", fields.get("max_tokens")), fields.get("n", 1)
        return most * count if isinstance(most, int) and isinstance(count, int) else self._config.token_limit or 0

    def _cost(self, answer: Answer, most: int) -> int:
        """Returns the tokens of an answer; where the service does not tell them, the most that it may have taken."""
        return max(answer.input_tokens, 0) + max(answer.output_tokens, 0) or most or self._longest_answer

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
