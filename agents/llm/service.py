"""Asks a service with the chat API of OpenAI by its client, and reads what it replies."""

from __future__ import annotations

import contextlib
import json
import threading
import time
import urllib.request
from typing import Any

import httpx2
import openai

from mazebench import stopping
from mazebench.errors import RunError, shortened
from mazebench.storage.json_files import parse_json

from .answer import RESUME, Answer
from .budget import Tries
from .config import SHORTEST_KEY, LLMConfig

_LARGEST_REPLY = 2**24  # bytes
_LARGEST_COUNT = 2**53  # tokens that are still believed
_LOOPBACK = ("127.0.0.1", "localhost", "::1")  # never by a proxy
_OF_TRANSFER = ("content-encoding", "content-length", "transfer-encoding")  # headers that a read body has no more
_NOT_SENT = (httpx2.ConnectError, httpx2.ConnectTimeout)


class Service:
    """The service of a config, which threads may ask at once."""

    def __init__(self, config: LLMConfig):
        """Raises `InputError` if the key can't be sent."""
        self._sampling, self._http = config.sampling, _Http(config)
        # The client's own variables have no effect: it sends by `_Http`, which takes nothing but the body of a request.
        self._client = openai.OpenAI(
            api_key="in _Http", base_url=config.base_url, max_retries=config.max_retries, http_client=self._http
        )

    def ask(self, messages: list[dict[str, Any]], tries: Tries) -> Answer:
        """Returns the answer of the service; the client tries again what fails.

        The key is shown as *** in errors and in the answer.

        Raises:
          RunError: if no try succeeds, or no other one is within the limit of tokens.
        """
        self._http.asking.tries = tries
        hide = self._http.hide
        try:
            self._client.post(
                "/chat/completions", cast_to=httpx2.Response, body={"messages": messages, **self._sampling}
            )
        except openai.APIStatusError as error:
            said, content = f"HTTP {error.status_code}", error.response.content
            if error.response.has_redirect_location:
                address = error.response.headers["location"].removesuffix("/chat/completions")
                said += f": it has moved; give base_url={shortened(hide(address), 200)}"
            else:
                said += f": {shortened(hide(_message_in(content)), 200)}"
            raise self._failed(tries, said) from error
        except openai.APIConnectionError as error:
            cause = error.__cause__
            kind = "" if isinstance(cause, NoAnswerError) else f"{type(cause).__name__}: "
            raise self._failed(tries, shortened(hide(f"{kind}{cause}"), 200)) from error
        assert tries.answer is not None
        return tries.answer

    def _failed(self, tries: Tries, said: str) -> RunError:
        """Returns the error of a question whose last try ended so."""
        by = " through the environment's proxy" if self._http.is_proxied else ""
        if tries.number > 1:
            said = f"no answer in {tries.number} tries, the last one {said}"
        return RunError(f"{self._http.url}{by}: {said}; {RESUME}")


class _Http(httpx2.Client):
    """Sends the tries of questions to one address, with headers of its own, and reads replies of a bounded size."""

    def __init__(self, config: LLMConfig):
        self.url = httpx2.URL(config.base_url.rstrip("/") + "/chat/completions")
        self._secret, self._longest = config.key, config.timeout
        self._sent = {"Content-Type": "application/json", "User-Agent": "mazebench"}
        if self._secret:
            self._sent["Authorization"] = f"Bearer {self._secret}"
        self.asking = threading.local()  # its `tries` are those of the question that a thread asks
        is_near = self.url.host in _LOOPBACK or bool(urllib.request.proxy_bypass(self.url.host))
        self.is_proxied = not is_near and bool({self.url.scheme, "all"} & urllib.request.getproxies().keys())
        unlimited = httpx2.Limits(max_connections=None)
        super().__init__(timeout=self._longest, limits=unlimited, trust_env=self.url.host not in _LOOPBACK)

    def hide(self, text: str) -> str:
        """Returns a text of a service without the key."""
        return text.replace(self._secret, "***") if len(self._secret) >= SHORTEST_KEY else text

    def send(self, request: httpx2.Request, **others: Any) -> httpx2.Response:
        """Returns the reply to a try, whose answer the question's tries then have.

        Raises:
          httpx2.RequestError: if there is none, it is too large or takes too long, or holds no answer.
        """
        stopping.check()
        tries: Tries = self.asking.tries
        with tries.next(costs_nothing=_NOT_SENT):
            began = time.monotonic()
            response = super().send(
                self.build_request("POST", self.url, content=request.content, headers=self._sent),
                stream=True,
                follow_redirects=False,
            )
            with contextlib.closing(response):
                body = bytearray()
                for part in response.iter_bytes():
                    body += part
                    if len(body) > _LARGEST_REPLY:
                        raise httpx2.RemoteProtocolError(f"expected at most {_LARGEST_REPLY:,} bytes, found more")
                    if time.monotonic() - began > self._longest:
                        raise httpx2.ReadTimeout(f"expected a reply within {self._longest:g} s")
            if response.is_success:
                answer = answer_of(bytes(body))
                texts = {name: self.hide(getattr(answer, name)) for name in ("text", "model", "finish_reason")}
                told = {"lost_tokens": tries.lost_tokens, "seconds": time.monotonic() - began}
                tries.answer = answer.model_copy(update={**texts, **told})
        headers = [(name, value) for name, value in response.headers.multi_items() if name not in _OF_TRANSFER]
        return httpx2.Response(response.status_code, headers=headers, content=bytes(body), request=request)


class NoAnswerError(httpx2.RequestError):
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
