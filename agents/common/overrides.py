"""Config values that are given as text."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, TypeVar

import pydantic

from mazebench.errors import InputError, unknown
from mazebench.options import fields_of

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
