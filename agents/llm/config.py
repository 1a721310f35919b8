"""The config of agents that ask: the question, the one who is asked, and how a service is reached.

No value is shown in an error, since it may hold a secret.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import re
import urllib.parse
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from annotated_types import Ge, Interval

from mazebench.agent import AgentConfig
from mazebench.errors import InputError
from mazebench.options import OneOf, ReadBy
from mazebench.storage.json_files import parse_json

from .cost import QUESTIONS, input_tokens
from .situation import EGOCENTRIC, SEES, TEXT, WORDING

SHORTEST_KEY = 6  # characters; what is shorter, as "EMPTY", is no secret
_KEY = "OPENAI_API_KEY"
_IDENTITY = ("model", "mode", "see", "temperature", "max_tokens", "extra", "history", "max_decisions")
# The view all round that a model is shown; the robot drives by its lidar, as where words are shown.
_CAMERA: dict[str, dict[str, Any]] = {"lidar": {}, "egocentric": {"camera_size": 384, "camera_fov": 360.0}}
# Words in the names of fields whose texts are secrets.
_SECRETS = {"apikey", "auth", "authorization", "bearer", "cookie", "credential", "credentials", "key", "password"}
_SECRETS |= {"passwd", "secret", "token"}


def _read_extra(text: Any) -> str:
    """Returns more fields of a request as they were given: the text of a JSON object without secrets."""
    try:
        fields = parse_json(text)
    except (ValueError, TypeError):
        fields = None
    if not isinstance(fields, dict):
        raise InputError("expected extra as a JSON object, found something else")
    for name in _text_fields(fields):
        words = {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)}
        if words & _SECRETS and name != "prompt_cache_key":
            raise InputError(
                f"expected no secret in extra, which results show, found a field {name!r}; use key_variable"
            )
    return str(text)


def _text_fields(content: Any, name: str = "") -> Iterator[str]:
    """Yields the names of all fields in JSON that hold a text, or a list with one."""
    if isinstance(content, str):
        yield name
    elif isinstance(content, dict | list):
        for key, value in content.items() if isinstance(content, dict) else ((name, each) for each in content):
            yield from _text_fields(value, key)


def _read_url(url: Any) -> str:
    """Returns the address of a service, or an empty text."""
    if {"@", "?", "#"} & set(url):
        raise InputError("expected base_url without a user, a password or a query, found one of them; use key_variable")
    try:
        parts = urllib.parse.urlsplit(url)
        is_legal = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:  # of a port that is no number
        is_legal = False
    if url and not (is_legal and re.fullmatch(r"[!-~]+", url)):
        raise InputError("expected base_url like https://HOST/v1, found something else")
    return str(url)


def _read_price(text: Any) -> str:
    """Returns two prices as they were given, or an empty text."""
    try:
        prices = [float(each) for each in (text or "0,0").split(",")]
    except ValueError:
        prices = []
    if len(prices) != 2 or not all(0 <= each < math.inf for each in prices):
        raise InputError("expected price=IN,OUT, dollars per million tokens, found something else")
    return str(text)


def _read_variable(name: Any) -> str:
    """Returns the name of a variable of the environment that is set, or the usual one."""
    if name != _KEY and not (re.fullmatch(r"[A-Z_][A-Z0-9_]*", name) and name in os.environ):
        raise InputError(
            "expected key_variable as the name of a variable that is set, in capitals, found something else"
        )
    return str(name)


@dataclasses.dataclass(frozen=True, kw_only=True)
class LLMConfig(AgentConfig):
    """The question, and the one who is asked."""

    model: str = ""  # as the service calls it; or person:NAME, script:NAME, or show:K, which writes the Kth question
    mode: Annotated[str, OneOf("notice", "told")] = "notice"  # whether it must see what differs, or is told
    see: Annotated[str, OneOf(*SEES)] = TEXT  # the grids, the map as a picture, both, or the map and the camera's views
    temperature: Annotated[float, Interval(ge=0, le=2)] = 0.0
    max_tokens: Annotated[int, Ge(1)] = 4096  # of an answer, thoughts included
    extra: Annotated[str, ReadBy(_read_extra)] = "{}"  # more fields of a request, as JSON; null leaves one out
    history: Annotated[int, Ge(0)] = 6  # the last decisions that a prompt quotes
    max_decisions: Annotated[int, Ge(1)] = 30  # in an episode; who revises needs 2 to 9

    # How the service is reached, which makes no difference to results.
    base_url: Annotated[str, ReadBy(_read_url)] = ""
    key_variable: Annotated[str, ReadBy(_read_variable)] = _KEY  # of the environment, with the key
    timeout: Annotated[float, Interval(ge=0.01, le=3600)] = 120.0  # s, of a try
    max_retries: Annotated[int, Interval(ge=0, le=100)] = 6  # of a request
    concurrency: Annotated[int, Interval(ge=1, le=1024)] = 32  # requests at once
    token_limit: Annotated[int | None, Ge(1)] = None  # in and out, of one evaluation, which then ends
    price: Annotated[str, ReadBy(_read_price)] = ""  # IN,OUT: dollars per million tokens, for lines on what it costs
    replay: str = ""  # a folder of results, from whose answers the run is made again; nothing is asked

    @property
    def sampling(self) -> dict[str, Any]:
        """The fields of a request beside its messages."""
        fields = {"model": self.model, "temperature": self.temperature, "max_tokens": self.max_tokens}
        return {name: value for name, value in (fields | json.loads(self.extra)).items() if value is not None}

    @property
    def asks_service(self) -> bool:
        """True unless a person or a script answers, or answers are replayed."""
        return not self.replay and self.model.partition(":")[0] not in ("person", "script", "show")

    @property
    def sensor_options(self) -> Mapping[str, Mapping[str, Any]]:
        """The lidar and a camera all round where a model is shown what the robot sees."""
        return _CAMERA if self.see == EGOCENTRIC else {}

    def cost(self, episodes: int, size: int) -> str:
        """Returns a line on questions, tokens and money where a service is asked."""
        if not self.asks_service:
            return ""
        questions = episodes * min(QUESTIONS, self.max_decisions)
        read, written = questions * input_tokens(self.see, self.mode == "told", size), questions * self.max_tokens
        each = f"some {QUESTIONS} questions each (the scripts' mean; at most {self.max_decisions})"
        line = f"{episodes:,} episodes, {each}: some {questions:,} questions, "
        line += f"{read / 1e6:,.2g} million tokens in, at most {written / 1e6:,.2g} million out"
        if self.price:
            before, after = self._prices
            line += f"; some {before * read:,.2f} dollars in, at most {after * written:,.2f} out"
        return line

    def sums(self, counts: Mapping[str, float]) -> dict[str, float]:
        """Returns the dollars of tokens, if their price is known."""
        before, after = self._prices
        dollars = before * counts.get("input_tokens", 0) + after * counts.get("output_tokens", 0)
        return {"dollars": round(dollars, 4)} if self.price else {}

    @property
    def _prices(self) -> list[float]:
        """The dollars of a token in and out; 0 if they are not known."""
        return [float(each) / 1e6 for each in (self.price or "0,0").split(",")]

    @property
    def needs_one_process(self) -> bool:
        """True where a service is asked: the tokens of an evaluation are counted in one process."""
        return self.asks_service

    @property
    def needs_one_machine(self) -> bool:
        """True: all answers are kept in one file."""
        return True

    @property
    def key(self) -> str:
        """The key in the environment, empty without one.

        Raises:
          InputError: if no header can hold it, or it stands in another value.
        """
        key = os.environ.get(self.key_variable, "").strip()
        if wrong := re.search(r"[^!-~]", key):
            found = f"U+{ord(wrong[0]):04X} as character {wrong.start() + 1}"
            raise InputError(f"{self.key_variable}: expected a key of printable ASCII characters, found {found}")
        for name in ("model", "extra", "base_url"):
            if len(key) >= SHORTEST_KEY and key in getattr(self, name):
                raise InputError(f"expected the key only in {self.key_variable}, found it in {name} too")
        return key

    def identity(self) -> dict[str, Any]:
        """Returns model, sampling, what prompts show, and the version and hash of their wording."""
        return {name: getattr(self, name) for name in _IDENTITY} | {"wording": WORDING}
