"""The answers of a run, each on disk before it counts: a run can be made again from its `answers.jsonl`."""

from __future__ import annotations

import concurrent.futures
import datetime
import hashlib
import json
import pathlib
import threading
from collections.abc import Sequence

from mazebench.errors import InputError, RunError
from mazebench.storage.json_files import read_lines, to_line

from .asking import RESUME, Answer, LLMConfig, ask
from .situation import Situation, messages

ANSWERS = "answers.jsonl"


class Answers:
    """The answers that are known; others are asked for."""

    def __init__(self, config: LLMConfig, folder: pathlib.Path | None):
        """Reads the answers in `folder`, in which others are kept, and those to replay: `InputError` if none are."""
        self._config, self._folder, self._lock = config, folder, threading.Lock()
        self._file = folder / ANSWERS if folder and not config.model.startswith("show:") else None
        self._kept = {each.prompt: each for each in read_lines(self._file, Answer)} if self._file else {}
        if self._file and self._file.exists() and not self._file.read_bytes().endswith(b"\n"):
            self._write("\n")  # ends a line that a kill cut short
        files = sorted(pathlib.Path(config.replay).rglob(ANSWERS)) if config.replay else []
        self._replayed = {each.prompt: each for file in files for each in read_lines(file, Answer)}
        if config.replay and not self._replayed:
            raise InputError(f"{config.replay}: expected {ANSWERS} to replay in it or below, found none")

    def of(self, situations: Sequence[Situation]) -> list[Answer]:
        """Returns the answers in situations, which are asked for at once. If one can't be had, the others are kept."""
        asked = [[messages(each), self._config.sampling, each.seed] for each in situations]
        keys = [hashlib.sha256(json.dumps(each, sort_keys=True).encode()).hexdigest() for each in asked]
        with concurrent.futures.ThreadPoolExecutor(self._config.concurrency) as threads:
            list(threads.map(self._find, keys, situations))
        return [self._kept[key] for key in keys]

    def _find(self, key: str, situation: Situation) -> None:
        """Finds an answer and keeps it, unless it is known."""
        if key in self._kept:
            return
        if self._config.replay:
            if key not in self._replayed:
                raise InputError(f"{self._config.replay}: expected the answer in step {situation.step}, found none")
            answer = self._replayed[key]
        else:
            with self._lock:
                spent = sum(each.input_tokens + each.output_tokens for each in self._kept.values())
            if spent >= (self._config.token_limit or spent + 1):
                raise RunError(f"spent {spent:,} tokens of token_limit {self._config.token_limit}; {RESUME}")
            now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
            origin = {"prompt": key, "seed": situation.seed, "decision": situation.number, "time": now}
            answer = ask(situation, self._config, self._folder).model_copy(update=origin)
        with self._lock:
            self._write(to_line(answer.model_dump()))
            self._kept[key] = answer

    def _write(self, text: str) -> None:
        """Adds a text to the file, at once, since other processes may add to it."""
        if self._file:
            with self._file.open("a", encoding="utf-8") as file:
                file.write(text)
