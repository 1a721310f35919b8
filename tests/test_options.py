"""Checked options: what they accept, what they refuse, and what can be read of them."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import pytest
from annotated_types import Ge, Interval

from mazebench.errors import InputError
from mazebench.options import Doc, OneOf, options


@options
class Base:
    share: Annotated[float, Interval(ge=0, le=1), Doc("A share.")] = 0.5


@options
class Given(Base):
    count: Annotated[int | None, Ge(1), Doc("How many.")] = None
    colour: Annotated[str, OneOf("red", "blue"), Doc("Which one.")] = "red"
    sizes: Annotated[tuple[Annotated[int, Ge(3)], ...], Doc("All sizes.")] = (3, 4)
    name: str = "no option"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"share": 1.5}, "expected share from 0 to 1, found 1.5"),
        ({"share": float("nan")}, "expected share from 0 to 1, found nan"),
        ({"share": None}, "expected share of type float, found None"),
        ({"count": 0}, "expected count of at least 1, found 0"),
        ({"count": True}, "expected count of type int | None, found True"),
        ({"count": "many"}, "expected count of type int | None, found 'many'"),
        ({"colour": "green"}, "unknown colour 'green'; available: blue, red"),
        ({"sizes": (3, 4.5)}, "expected sizes of type tuple[int, ...], found (3, 4.5)"),
        ({"sizes": (3, 2)}, "expected sizes of at least 3, found 2"),
        ({"hue": 1}, "unknown option 'hue'; available: colour, count, name, share, sizes"),
    ],
)
def test_a_value_that_is_not_allowed_is_refused(values: dict[str, Any], message: str):
    with pytest.raises(InputError) as caught:
        Given(**values)
    assert str(caught.value) == message


def test_numpy_numbers_and_a_default_of_none_are_allowed():
    made = Given(share=np.float32(1.0), count=np.int64(1))
    assert (made.share, made.count, Given().count) == (1.0, 1, None)


@pytest.mark.parametrize("sizes", [[5], iter([5]), np.array([5]), 5])
def test_any_iterable_and_a_single_value_become_a_tuple(sizes: Any):
    assert Given(sizes=sizes).sizes == (5,)
