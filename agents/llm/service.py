"""Asks a service with the chat API of OpenAI, and reads what it replies."""

from __future__ import annotations

import contextlib
import http.client
import json
import random
import time
import urllib.error
import urllib.request
from typing import Any

from mazebench import stopping
from mazebench.errors import RunError, shortened
from mazebench.storage.json_files import parse_json

from .answer import RESUME, Answer
from .config import SHORTEST_KEY, LLMConfig

_RETRIED = (408, 409, 425, 429, *range(500, 600))  # statuses of HTTP
_LONGEST_WAIT = 60.0  # s before a retry
_LARGEST_COUNT = 2**53  # tokens that are still believed
# A service that refuses, does not answer in time or breaks off, and a reply without an answer.
_FAULTS = (OSError, http.client.HTTPException, ValueError)


def ask_service(messages: list[dict[str, str]], config: LLMConfig) -> Answer:
    """Returns the answer of a service; what fails is tried again, and never counts.

    The key is shown as *** in errors and in the answer.

    Raises:
      InputError: if the key can't be sent; then no try is made.
      RunError: if no try succeeds.
    """
    key, url = config.key, config.base_url.rstrip("/") + "/chat/completions"
    data = json.dumps({"messages": messages, **config.sampling}).encode()
    request = urllib.request.Request(url, data, {"Content-Type": "application/json", "User-Agent": "mazebench"})
    if key:
        request.add_unredirected_header("Authorization", f"Bearer {key}")

    def hide(text: str) -> str:
        return text.replace(key, "***") if len(key) >= SHORTEST_KEY else text

    said, wait = "", 0.0
    for attempt in range(config.max_retries + 1):
        time.sleep(min(wait, _LONGEST_WAIT))
        stopping.check()
        wait, began = config.backoff * 2**attempt * random.uniform(0.5, 1.0), time.monotonic()
        try:
            with urllib.request.urlopen(request, timeout=config.timeout) as response:
                answer = answer_of(response.read())
            texts = {name: hide(getattr(answer, name)) for name in ("text", "model", "finish_reason")}
            return answer.model_copy(update={**texts, "seconds": time.monotonic() - began})
        except urllib.error.HTTPError as error:
            said = f"HTTP {error.code}"
            with contextlib.suppress(OSError, http.client.HTTPException):  # of a body that breaks off
                said += f": {shortened(hide(_message_in(error.read(2**16))), 200)}"
            if error.code not in _RETRIED:
                raise RunError(f"{url}: {said}; {RESUME}") from error
            if (asked := error.headers.get("Retry-After", "")).isdecimal():
                wait = float(asked)
        except _FAULTS as error:
            kind = "" if isinstance(error, NoAnswerError) else f"{type(error).__name__}: "
            said = shortened(hide(f"{kind}{error}"), 200)
    raise RunError(f"{url}: no answer in {config.max_retries + 1} tries, the last one {said}; {RESUME}")


class NoAnswerError(ValueError):
    """A reply of a service that holds no answer; the message is what the service said."""


def answer_of(reply: bytes) -> Answer:
    """Returns the answer in the body of a reply; a text that was filtered, or only thought of, is empty.

    Raises:
      NoAnswerError: if there is none.
    """
    try:
        content = parse_json(reply)
        choice = content["choices"][0]
        text = _text_in(choice["message"])
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise NoAnswerError(f"HTTP 200 without an answer: {_message_in(reply)}") from error
    usage = content.get("usage")
    tokens = usage if isinstance(usage, dict) else {}
    model, reason = (
        value if isinstance(value, str) else "" for value in (content.get("model"), choice.get("finish_reason"))
    )
    return Answer(
        text=text,
        model=model,
        finish_reason=reason,
        input_tokens=_count(tokens.get("prompt_tokens")),
        output_tokens=_count(tokens.get("completion_tokens")),
    )


def _text_in(message: dict[str, Any]) -> str:
    """Returns the text of a message, which some services give in parts, with thoughts among them."""
    content = message.get("content")
    if content is None:
        content = message.get("refusal") or ""
    parts = [content] if isinstance(content, str) else content
    return "".join(
        part if isinstance(part, str) else part["text"]
        for part in parts
        if isinstance(part, str) or part.get("type", "text") in ("text", "output_text")
    )


def _count(value: Any) -> int:
    """Returns a number of tokens; 0 for what is none."""
    return int(value) if isinstance(value, int | float) and 0 <= value < _LARGEST_COUNT else 0


def _message_in(body: bytes) -> str:
    """Returns what a service says in a body: the message of its error, or everything."""
    try:
        content = parse_json(body)
    except ValueError:
        return body.decode(errors="replace")
    error = content.get("error") if isinstance(content, dict) else None
    message = error.get("message") if isinstance(error, dict) else error
    return message if isinstance(message, str) else json.dumps(content, ensure_ascii=False)
