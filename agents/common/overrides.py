"""Config values that are given as text."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, TypeVar

import pydantic

from mazebench.errors import InputError, unknown

Config = TypeVar("Config")


def override(config: Config, values: Mapping[str, Any]) -> Config:
    """Returns `config`, a frozen dataclass, with its values replaced by `values`, each converted to its field's type.

    Raises:
      InputError: if a name is unknown, or a value is not of its field's type.
    """
    types = {field.name: field.type for field in dataclasses.fields(config)}  # type: ignore[arg-type]
    known = {name: {"bool": bool, "int": int, "float": float, "str": str}[str(kind)] for name, kind in types.items()}
    typed: dict[str, Any] = {}
    for name, value in values.items():
        if name not in known:
            raise unknown("config key", name, known)
        try:
            typed[name] = pydantic.TypeAdapter(known[name]).validate_python(value)
        except pydantic.ValidationError as error:
            raise InputError(f"config key {name!r}: expected {types[name]}, found {str(value)[:80]!r}") from error
        if not math.isfinite(typed[name] if isinstance(typed[name], float) else 0):
            raise InputError(f"config key {name!r}: expected a finite number, found {typed[name]}")
    return dataclasses.replace(config, **typed)  # type: ignore[type-var]
