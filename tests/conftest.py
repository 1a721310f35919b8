"""Fixtures of several test modules."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator

import pytest

from mazebench.errors import Remark


@pytest.fixture
def remarks() -> Iterator[Callable[[], list[str]]]:
    """A function that returns the remarks since its last call."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", Remark)

        def since_last_call() -> list[str]:
            lines = [str(warning.message) for warning in caught if issubclass(warning.category, Remark)]
            caught.clear()
            return lines

        yield since_last_call
