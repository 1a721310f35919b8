"""Options: fields of frozen dataclasses that carry their help text and the values they allow.

Each option is declared once. The command line, Gymnasium's keywords, config files and docs/options.md follow from it.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import numbers
import os
import typing
from collections.abc import Iterable
from typing import Any

import numpy as np
import pydantic

from mazebench.errors import InputError, unknown


@dataclasses.dataclass(frozen=True)
class Option:
    """The help text of an option and the values it allows; for a tuple, the values that its elements may have."""

    help: str
    lowest: float | None = None
    highest: float | None = None
    choices: tuple[str, ...] | None = None

    def check(self, name: str, value: object) -> None:
        """Checks the value of the option called `name`.

        Raises:
          InputError: if the value, or an element of a tuple, is not allowed.
        """
        for item in value if isinstance(value, tuple) else (value,):
            if self.choices is not None and item not in self.choices:
                raise unknown(name, item, self.choices)
            if self.range_text and not self._is_in_range(item):
                raise InputError(f"expected {name} {self.range_text}, found {item!r}")

    @property
    def range_text(self) -> str:
        """The allowed numbers in words; empty if any value is allowed."""
        if self.lowest is None:
            return "" if self.highest is None else f"of at most {self.highest}"
        return f"of at least {self.lowest}" if self.highest is None else f"from {self.lowest} to {self.highest}"

    def _is_in_range(self, value: object) -> bool:
        lowest = -math.inf if self.lowest is None else self.lowest
        highest = math.inf if self.highest is None else self.highest
        return isinstance(value, numbers.Real) and lowest <= float(value) <= highest


def option(
    default: Any,
    help: str,
    *,
    lowest: float | None = None,
    highest: float | None = None,
    choices: Iterable[str] | None = None,
) -> Any:
    """Returns a dataclass field with an `Option` as `metadata["option"]`."""
    allowed = None if choices is None else tuple(choices)
    return dataclasses.field(default=default, metadata={"option": Option(help, lowest, highest, allowed)})


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options:
    """Base class of dataclasses whose fields are made by `option`; it checks them.

    An option whose default is a tuple accepts any iterable, and a single value for a tuple of one. None is allowed
    where it is the default.

    Raises:
      InputError: if a value is not allowed.
    """

    def __post_init__(self) -> None:
        for name, field_option in options_of(type(self)).items():
            value = getattr(self, name)
            if isinstance(type(self).__dataclass_fields__[name].default, tuple):
                value = tuple(value) if isinstance(value, Iterable) and not isinstance(value, str) else (value,)
            value = _checked_type(type(self), name, value)
            object.__setattr__(self, name, value)
            if value is not None:  # which its type allows
                field_option.check(name, value)


def _checked_type(options_class: type[Options], name: str, value: Any) -> Any:
    """Returns `value` as a plain value of the type that the field is declared with.

    Raises:
      InputError: if it is of another type, such as a text for a number.
    """
    if isinstance(value, tuple):
        plain: Any = tuple(map(_plain, value))
    else:
        plain = _plain(value)
    adapter, kind = _validator(options_class, name)  # type: ignore[arg-type]
    try:
        return adapter.validate_python(plain)
    except pydantic.ValidationError as error:
        raise InputError(f"expected {name} of type {kind}, found {plain!r}"[:200]) from error


def _plain(value: Any) -> Any:
    """Returns NumPy's numbers as Python's, and a path as text."""
    if isinstance(value, np.generic):
        return value.item()
    return os.fspath(value) if isinstance(value, os.PathLike) else value


@functools.cache
def _validator(options_class: Any, name: str) -> tuple[pydantic.TypeAdapter[Any], str]:
    """Returns a strict validator of a field, and the field's type in words."""
    kind = typing.get_type_hints(options_class)[name]
    in_words = kind.__name__ if isinstance(kind, type) and not typing.get_args(kind) else str(kind)
    return pydantic.TypeAdapter(kind, config=pydantic.ConfigDict(strict=True)), in_words


def options_of(options_class: type[Options]) -> dict[str, Option]:
    """Returns the options of a dataclass by name."""
    fields = dataclasses.fields(options_class)
    return {field.name: field.metadata["option"] for field in fields if "option" in field.metadata}
