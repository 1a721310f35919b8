"""Asks a service, a person or a script; `show:K` writes a question instead."""

from __future__ import annotations

import pathlib
import sys
import time
from typing import TYPE_CHECKING

from mazebench import stopping
from mazebench.errors import InputError, RunError
from mazebench.storage.files import open_whole, writing_to

from .answer import RESUME, Answer
from .budget import Budget, Tries
from .config import LLMConfig
from .pictures import to_png
from .scripted import SCRIPTS, hope
from .situation import TEXT as WORDS
from .situation import Question, Situation, picture, prompt

if TYPE_CHECKING:
    from .service import Service

TEXT, PICTURE, NUMBERED = "prompt.txt", "picture.png", "picture-{}.png"


class Asking:
    """The one whom a config names."""

    def __init__(self, config: LLMConfig, folder: pathlib.Path | None, budget: Budget):
        """Raises `InputError` if it is nobody, or a service that can't be asked."""
        self._folder, self._budget, self._kind, self._name = folder, budget, *config.model.partition(":")[::2]
        self._service: Service | None = None
        if config.replay:
            return
        is_known = self._kind in ("person", "show") or (self._kind == "script" and self._name in SCRIPTS)
        if not is_known and (self._kind == "script" or not config.model or not config.base_url):
            expected = (
                "--set model=NAME and --set base_url=http://... of a service, or --set replay=FOLDER of its answers"
            )
            found = f"model {config.model!r} and {'a' if config.base_url else 'no'} base_url"
            raise InputError(f"agent 'llm': expected {expected}, or a model person:NAME or script:NAME; found {found}")
        if self._kind == "script" and config.see != WORDS:
            raise InputError(f"agent 'llm': expected see={WORDS} of a script, which reads words, found {config.see}")
        if not is_known:
            try:
                from .service import Service
            except ModuleNotFoundError as error:
                needed = f"needs the package {error.name}, which the extra [llm] brings (docs/llm.md)"
                raise InputError(f"agent 'llm': a service {needed}") from error
            self._service = Service(config)

    def ask(self, situation: Situation, question: Question) -> Answer:
        """Returns the answer in a situation; raises `RunError` if there is none."""
        if self._service is not None:
            messages = question.messages
            return self._service.ask(messages, Tries(self._budget, messages))
        if self._kind == "person":
            return self._ask_person(situation, question)
        if self._kind == "show" and self._name == str(situation.number):
            self._write(situation, question)
        script = hope if self._kind == "show" else SCRIPTS[self._name]
        return Answer(text=script(prompt(situation)))

    def _ask_person(self, situation: Situation, question: Question) -> Answer:
        """Returns the line that a person types, with the seconds that it took."""
        text = self._write(situation, question)
        name = PICTURE if not question.pictures else NUMBERED.format(1)
        print(f"\n{text}\n\npicture: {self._folder and self._folder / name}\nYour decision:", flush=True)
        began, line = time.monotonic(), sys.stdin.readline()
        stopping.check()
        if not line:
            raise RunError(f"the input ended; {RESUME}")
        return Answer(text=line.strip(), seconds=time.monotonic() - began)

    def _write(self, situation: Situation, question: Question) -> str:
        """Returns what is asked as text, the instruction first; writes it and its pictures into the folder.

        A question in words alone has the picture that a person is shown.
        """
        text = "\n\n".join((question.instruction, question.text))
        if self._folder:
            pictures = {NUMBERED.format(number): png for number, png in enumerate(question.pictures, 1)}
            for name, png in (pictures or {PICTURE: to_png(picture(situation))}).items():
                write_file(self._folder / name, png)
            (self._folder / TEXT).write_text(f"{text}\n", encoding="utf-8")
        return text


def write_file(path: pathlib.Path, content: bytes) -> None:
    """Writes a file, all or nothing."""
    with writing_to(path), open_whole(path) as file:
        file.write(content)
