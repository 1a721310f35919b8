"""Options declared as fields of a dataclass: what they accept, what they refuse, and what can be read of them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from mazebench.errors import InputError
from mazebench.options import Option, Options, option, options_of


@dataclasses.dataclass(frozen=True, kw_only=True)
class Base(Options):
    share: float = option(0.5, "A share.", lowest=0, highest=1)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Given(Base):
    count: int | None = option(None, "How many.", lowest=1)
    colour: str = option("red", "Which one.", choices=("red", "blue"))
    sizes: tuple[int, ...] = option((3, 4), "All sizes.", lowest=3)
    name: str = "no option"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"share": 1.5}, "expected share from 0 to 1, found 1.5"),
        ({"share": float("nan")}, "expected share from 0 to 1, found nan"),
        ({"share": None}, "expected share of type float, found None"),
        ({"count": 0}, "expected count of at least 1, found 0"),
        ({"count": "many"}, "expected count of type int | None, found 'many'"),
        ({"colour": "green"}, "unknown colour 'green'; available: blue, red"),
        ({"sizes": (3, 4.5)}, "expected sizes of type tuple[int, ...], found (3, 4.5)"),
        ({"sizes": (3, 2)}, "expected sizes of at least 3, found 2"),
    ],
)
def test_a_value_that_is_not_allowed_is_refused(values: dict[str, Any], message: str):
    with pytest.raises(InputError) as caught:
        Given(**values)
    assert str(caught.value) == message


def test_bounds_numpy_numbers_and_a_default_of_none_are_allowed():
    given = Given(share=np.float32(1.0), count=np.int64(1))
    assert (given.share, given.count, Given().count) == (1.0, 1, None)


@pytest.mark.parametrize("sizes", [[5], iter([5]), np.array([5]), 5])
def test_any_iterable_and_a_single_value_become_a_tuple(sizes: Any):
    assert Given(sizes=sizes).sizes == (5,)


def test_options_are_listed_with_those_of_base_classes():
    assert list(options_of(Given)) == ["share", "count", "colour", "sizes"]
    assert options_of(Given)["share"] == Option("A share.", lowest=0, highest=1)
