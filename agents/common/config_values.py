"""Values of configs: the ranges that they share, and values that are given as text."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

import pydantic
from annotated_types import Ge, Interval

from mazebench.errors import InputError, unknown
from mazebench.options import fields_of

# What is larger than any of them is a slip of the hand.
Size = Annotated[int, Interval(ge=1, le=4096)]  # numbers of a layer or of a code
Count = Annotated[int, Interval(ge=1, le=65_536)]  # of what is computed or played side by side
Steps = Annotated[int, Interval(ge=1, le=1_000_000)]  # of the environment
Length = Annotated[int, Interval(ge=1, le=1000)]  # steps of a sequence, or of a return
Rows = Annotated[int, Interval(ge=1, le=100_000_000)]  # of the replay
Updates = Annotated[int, Interval(ge=1, le=1_000_000_000)]
Factor = Annotated[float, Ge(0.0)]  # weights of losses, learning rates
Exponent = Annotated[float, Interval(ge=0.0, le=10.0)]
Ahead = Annotated[float, Interval(ge=1.0, le=1e6)]  # a number of steps that need not be whole
Share = Annotated[float, Interval(ge=0.0, le=1.0)]

Config = TypeVar("Config")


def override(config: Config, values: Mapping[str, Any]) -> Config:
    """Returns `config`, of a class made by `mazebench.options.options`, with some of its values replaced.

    Args:
      config: unchanged.
      values: by name; text is converted to the field's type.

    Raises:
      InputError: if a name is unknown, or a value is not of its field's type or range.
    """
    kind: Any = type(config)
    fields = fields_of(kind)
    typed: dict[str, Any] = {}
    for name, value in values.items():
        if name not in fields:
            raise unknown("config key", name, fields)
        try:
            typed[name] = pydantic.TypeAdapter(fields[name].kind).validate_python(value)
        except pydantic.ValidationError as error:
            expected = fields[name].kind_text
            raise InputError(f"config key {name!r}: expected {expected}, found {str(value)[:80]!r}") from error
    try:
        return dataclasses.replace(config, **typed)  # type: ignore[type-var]
    except InputError as error:
        raise InputError(f"config: {error}") from error


def check_rows(config: Any) -> None:
    """Checks that the replay can hold as many rows as learning waits for."""
    rows = config.replay_capacity // config.num_envs * config.num_envs
    if rows < config.min_rows:
        raise InputError(f"expected a replay_capacity of at least min_rows {config.min_rows}, found one of {rows} rows")
