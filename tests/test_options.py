"""Checked options: what they accept, what they refuse, and what can be read of them."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from annotated_types import Ge, Interval

from mazebench.errors import InputError
from mazebench.options import Doc, OneOf, Options, fields_of, options_in


@dataclasses.dataclass(frozen=True, kw_only=True)
class Base(Options):
    share: Annotated[float, Interval(ge=0, le=1), Doc("A share.")] = 0.5


@dataclasses.dataclass(frozen=True, kw_only=True)
class Given(Base):
    count: Annotated[int | None, Ge(1), Doc("How many.")] = None
    colour: Annotated[str, OneOf("red", "blue"), Doc("Which one.")] = "red"
    sizes: Annotated[tuple[Annotated[int, Ge(3)], ...] | None, Doc("All sizes.")] = (3, 4)
    weight: Annotated[float, Ge(0), Doc("Kilograms.")] = 1.0
    name: Literal["no option", "none"] = "no option"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"share": 1.5}, "expected share from 0 to 1, found 1.5"),
        ({"share": float("nan")}, "expected share from 0 to 1, found nan"),
        ({"share": None}, "expected share of type float, found None"),
        ({"weight": float("inf")}, "expected weight as a finite number, found inf"),
        ({"count": 0}, "expected count of at least 1, found 0"),
        ({"count": True}, "expected count of type int | None, found True"),
        ({"count": "many"}, "expected count of type int | None, found 'many'"),
        ({"colour": "green"}, "unknown colour 'green'; available: blue, red"),
        ({"name": "a"}, "unknown name 'a'; available: no option, none"),
        ({"sizes": (3, 4.5)}, "expected sizes of type tuple[int, ...] | None, found (3, 4.5)"),
        ({"sizes": "3-4"}, "expected sizes as numbers, such as range(1, 4), found '3-4'"),
        ({"sizes": (3, 2)}, "expected sizes of at least 3, found 2"),
    ],
)
def test_a_value_that_is_not_allowed_is_refused(values: dict[str, Any], message: str):
    with pytest.raises(InputError) as caught:
        Given(**values)
    assert str(caught.value) == message


def test_a_name_that_is_no_option_is_refused_with_those_that_are():
    with pytest.raises(InputError, match="argument 'hue'; available: colour, count, share, sizes, weight"):
        Given.of({"hue": 1})


def test_none_is_the_default_where_values_are_given_by_name():
    assert Given.of({"share": None, "count": 2}) == Given(count=2)


def test_numpy_numbers_and_a_default_of_none_are_allowed():
    made = Given(share=np.float32(1.0), count=np.int64(1))
    assert (made.share, made.count, Given().count) == (1.0, 1, None)


@pytest.mark.parametrize("sizes", [[5], iter([5]), np.array([5]), 5])
def test_any_iterable_and_a_single_value_become_a_tuple(sizes: Any):
    assert Given(sizes=sizes).sizes == (5,)


def test_what_differs_from_the_defaults_is_told():
    assert Given(share=1, sizes=(3, 4)).changed() == {"share": 1.0}


def test_options_are_described_and_picked_by_their_class():
    assert fields_of(Given)["sizes"].lowest == 3
    assert fields_of(Base)["share"].range_text == "from 0 to 1"
    assert options_in({"share": 1, "count": 2, "name": "none"}, Base) == {"share": 1}
