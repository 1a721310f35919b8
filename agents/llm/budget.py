"""The tokens that the questions of an evaluation may take, and those that they took."""

from __future__ import annotations

import contextlib
import json
import threading
from collections.abc import Iterable, Iterator
from typing import Any

from mazebench.errors import RunError

from .answer import RESUME, Answer
from .config import LLMConfig


class Budget:
    """The tokens of `token_limit`: those spent, and those that requests under way may take."""

    def __init__(self, config: LLMConfig, answers: Iterable[Answer]):
        """Begins with what some answers took."""
        self._limit, fields = config.token_limit, config.sampling
        most, count = fields.get("max_completion_tokens", fields.get("max_tokens")), fields.get("n", 1)
        # The most tokens of an answer, as it is asked for; all that may be spent if a request has no bound.
        is_bounded = isinstance(most, int) and isinstance(count, int)
        self._longest_answer: int = most * count if is_bounded else self._limit or 0
        self._changed, self._under_way, self.lacks_usage = threading.Condition(), 0, False
        self._spent = sum(each.lost_tokens + (_tokens(each) or self._longest_answer) for each in answers)

    def most(self, messages: list[dict[str, Any]]) -> int:
        """Returns the most tokens that a try may take. A prompt has no more of them than bytes."""
        return len(json.dumps(messages)) + self._longest_answer

    def reserve(self, most: int) -> None:
        """Waits until a try fits within the limit.

        Raises:
          RunError: if it fits no more, whatever those under way take.
        """
        with self._changed:
            while self._limit is not None and self._spent + self._under_way + most > self._limit:
                if not self._under_way:
                    spent = f"spent {self._spent:,} tokens of token_limit {self._limit:,}"
                    next_one = f"the next answer may take {most:,} (its prompt, and max_tokens)"
                    raise RunError(f"{spent}, and {next_one}; {RESUME}")
                self._changed.wait()
            self._under_way += most

    def end(self, most: int, spent: int) -> None:
        """Takes in what a try took of the most that was reserved for it."""
        with self._changed:
            self._under_way -= most
            self._spent += spent
            self._changed.notify_all()


class Tries:
    """The tries of one question."""

    def __init__(self, budget: Budget, messages: list[dict[str, Any]]):
        self._budget, self._most = budget, budget.most(messages)
        self.number = 0  # of those that began
        self.lost_tokens = 0  # the most that those may have taken which had no reply
        self.answer: Answer | None = None  # once a try had one

    @contextlib.contextmanager
    def next(self, costs_nothing: tuple[type[Exception], ...]) -> Iterator[None]:
        """A try. One that ends by an error may have been answered, so it counts as the most, but for some errors.

        A service that refuses, by a status of HTTP, takes no tokens.

        Raises:
          RunError: if the try is not within the limit.
        """
        self._budget.reserve(self._most)
        self.number += 1
        spent = 0
        try:
            yield
            if self.answer is not None:
                spent = _tokens(self.answer) or self._most
                self._budget.lacks_usage |= not _tokens(self.answer)
        except costs_nothing:
            raise
        except Exception:
            spent = self._most
            self.lost_tokens += spent
            raise
        finally:
            self._budget.end(self._most, spent)


def _tokens(answer: Answer) -> int:
    """Returns the tokens of an answer, 0 if the service does not tell them."""
    return max(answer.input_tokens, 0) + max(answer.output_tokens, 0)
