"""Asks a service, a person or a script; `show:K` writes a question instead."""

from __future__ import annotations

import pathlib
import sys
import time

from mazebench import stopping
from mazebench.errors import InputError, RunError
from mazebench.maps.pictures import write_image

from .answer import RESUME, Answer
from .config import LLMConfig
from .scripted import SCRIPTS, hope
from .service import ask_service
from .situation import Situation, messages, picture, prompt

TEXT, PICTURE = "prompt.txt", "picture.png"


def ask(situation: Situation, config: LLMConfig, folder: pathlib.Path | None) -> Answer:
    """Returns the answer of the one whom a config names; raises `InputError` if that is nobody, `RunError` if none."""
    kind, _, name = config.model.partition(":")
    if kind == "person":
        return _ask_person(situation, folder)
    if kind == "show" and name == str(situation.number):
        _write(situation, folder)
    if script := {"show": hope, "script": SCRIPTS.get(name)}.get(kind):
        return Answer(text=script(prompt(situation)))
    if kind == "script" or not config.model or not config.base_url:
        expected = "--set model=NAME and --set base_url=http://... of a service, or --set replay=FOLDER of its answers"
        found = f"model {config.model!r} and {'a' if config.base_url else 'no'} base_url"
        raise InputError(f"agent 'llm': expected {expected}, or a model person:NAME or script:NAME; found {found}")
    return ask_service(messages(situation), config)


def _ask_person(situation: Situation, folder: pathlib.Path | None) -> Answer:
    """Returns the line that a person types, with the seconds that it took."""
    print(f"\n{_write(situation, folder)}\n\npicture: {folder and folder / PICTURE}\nYour decision:", flush=True)
    began, line = time.monotonic(), sys.stdin.readline()
    stopping.check()
    if not line:
        raise RunError(f"the input ended; {RESUME}")
    return Answer(text=line.strip(), seconds=time.monotonic() - began)


def _write(situation: Situation, folder: pathlib.Path | None) -> str:
    """Returns what is asked as text, the instruction first; writes it and the picture into `folder`."""
    text = "\n\n".join(message["content"] for message in messages(situation))
    if folder:
        write_image(picture(situation), folder / PICTURE)
        (folder / TEXT).write_text(f"{text}\n", encoding="utf-8")
    return text
