"""Asks a service with the chat API of OpenAI, a person or a script; `show:K` writes a question instead."""

from __future__ import annotations

import contextlib
import dataclasses
import http.client
import json
import os
import pathlib
import random
import sys
import time
import urllib.error
import urllib.request
from typing import Annotated, Any

import pydantic
from annotated_types import Ge, Interval

from mazebench import stopping
from mazebench.agent import AgentConfig
from mazebench.errors import InputError, RunError, describe_error, shortened
from mazebench.maps.pictures import write_image
from mazebench.options import OneOf

from .scripted import SCRIPTS, hope
from .situation import WORDING, Situation, messages, picture, prompt

TEXT, PICTURE = "prompt.txt", "picture.png"
RESUME = "nothing is lost, go on with --resume"
_IDENTITY = ("model", "mode", "temperature", "max_tokens", "extra", "history", "max_decisions")
_RETRIED = (408, 409, 425, 429, *range(500, 600))  # statuses of HTTP
_LONGEST_WAIT = 60.0  # s before a retry
# A service that refuses, does not answer in time or breaks off, and an answer that is no JSON or has another form.
_FAULTS = (OSError, http.client.HTTPException, ValueError, LookupError, TypeError, AttributeError)


@dataclasses.dataclass(frozen=True, kw_only=True)
class LLMConfig(AgentConfig):
    """The question, and the one who is asked."""

    model: str = ""  # as the service calls it; or person:NAME, script:NAME, or show:K, which writes the Kth question
    mode: Annotated[str, OneOf("notice", "told")] = "notice"  # whether it must see what differs, or is told
    temperature: Annotated[float, Interval(ge=0, le=2)] = 0.0
    max_tokens: Annotated[int, Ge(1)] = 4096  # of an answer, thoughts included
    extra: str = "{}"  # more fields of a request, as JSON; null leaves one out
    history: Annotated[int, Ge(0)] = 6  # the last decisions that a prompt quotes
    max_decisions: Annotated[int, Ge(1)] = 30  # in an episode; who revises needs 2 to 9

    # How the service is reached, which makes no difference to results.
    base_url: str = ""
    key_variable: str = "OPENAI_API_KEY"  # of the environment, with the key
    timeout: Annotated[float, Interval(ge=0.01, le=3600)] = 120.0  # s, until an answer begins, and between its parts
    max_retries: Annotated[int, Interval(ge=0, le=100)] = 6  # of a request
    backoff: Annotated[float, Interval(ge=0, le=60)] = 1.0  # s before the first retry, then twice as long each time
    concurrency: Annotated[int, Interval(ge=1, le=1024)] = 32  # requests at once
    token_limit: Annotated[int | None, Ge(1)] = None  # in and out, of one evaluation, which then ends
    replay: str = ""  # a folder of results, from whose answers the run is made again; nothing is asked

    @property
    def sampling(self) -> dict[str, Any]:
        """The fields of a request beside its messages; raises `InputError` if `extra` is no JSON object."""
        fields = {"model": self.model, "temperature": self.temperature, "max_tokens": self.max_tokens}
        try:
            fields |= json.loads(self.extra)
        except (ValueError, TypeError):
            raise InputError(f"expected extra as a JSON object, found {self.extra[:80]!r}") from None
        return {name: value for name, value in fields.items() if value is not None}

    def identity(self) -> dict[str, Any]:
        """Returns model, sampling, what prompts show, and the version and hash of their wording."""
        return {name: getattr(self, name) for name in _IDENTITY} | {"wording": WORDING}


class Answer(pydantic.BaseModel):
    """A line of `answers.jsonl`; what the service did not tell is 0 or empty."""

    text: str
    model: str = ""  # as the service names it, perhaps more exactly than it was asked for
    finish_reason: str = ""
    input_tokens: int = 0
    output_tokens: int = 0  # thoughts included
    seconds: float = 0.0  # that it took
    prompt: str = ""  # SHA-256 of messages, sampling and seed
    seed: int = 0  # of the question, as the next one
    decision: int = 0
    time: str = ""  # UTC


def ask(situation: Situation, config: LLMConfig, folder: pathlib.Path | None) -> Answer:
    """Returns the answer of the one whom a config names; raises `InputError` if that is nobody, `RunError` if none."""
    kind, _, name = config.model.partition(":")
    if kind == "person":
        return _ask_person(situation, folder)
    if kind == "show" and situation.number == int(name):
        _write(situation, folder)
    if script := {"show": hope, "script": SCRIPTS.get(name)}.get(kind):
        return Answer(text=script(prompt(situation)))
    if not config.model or not config.base_url.startswith(("http://", "https://")):
        expected = "--set model=NAME and --set base_url=http://... of a service, or a model person:NAME or script:NAME"
        raise InputError(f"agent 'llm': expected {expected}; found {config.model!r} and {config.base_url!r}")
    return _ask_service(situation, config)


def _ask_service(situation: Situation, config: LLMConfig) -> Answer:
    """Returns the answer of a service; what fails is tried again, and never counts."""
    url = config.base_url.rstrip("/") + "/chat/completions"
    data = json.dumps({"messages": messages(situation), **config.sampling}).encode()
    request = urllib.request.Request(url, data, {"Content-Type": "application/json", "User-Agent": "mazebench"})
    if key := os.environ.get(config.key_variable, "").strip():
        request.add_unredirected_header("Authorization", f"Bearer {key}")
    said, wait = "", 0.0
    for attempt in range(config.max_retries + 1):
        time.sleep(min(wait, _LONGEST_WAIT))
        stopping.check()
        wait, began = config.backoff * 2**attempt * random.uniform(0.5, 1.0), time.monotonic()
        try:
            with urllib.request.urlopen(request, timeout=config.timeout) as response:
                content = json.load(response)
            choice, usage = content["choices"][0], content.get("usage") or {}
            return Answer(
                text=choice["message"].get("content") or "",  # of a text that was filtered, none
                model=content.get("model") or "",
                finish_reason=choice.get("finish_reason") or "",
                input_tokens=usage.get("prompt_tokens") or 0,
                output_tokens=usage.get("completion_tokens") or 0,
                seconds=time.monotonic() - began,
            )
        except urllib.error.HTTPError as error:
            said = f"HTTP {error.code}"
            with contextlib.suppress(OSError, http.client.HTTPException):
                said += f": {shortened(error.read(1000).decode(errors='replace'), 200)}"
            if error.code not in _RETRIED:
                raise RunError(f"{url}: {said}; {RESUME}") from error
            if (asked := error.headers.get("Retry-After", "")).isdecimal():
                wait = float(asked)
        except _FAULTS as error:
            said = shortened(describe_error(error), 200)
    raise RunError(f"{url}: no answer in {config.max_retries + 1} tries, the last one {said}; {RESUME}")


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
