"""Checked options: frozen dataclasses whose fields say in one place what they mean and which values they allow.

    @options
    class ReadOptions:
        inflate: Annotated[float, Interval(ge=0, le=10), Doc("Metres by which walls are thickened.")] = 0.0
        unknown: Annotated[str, OneOf("wall", "free"), Doc("What unknown cells become.")] = "wall"

The command line, keyword arguments, config files and docs/options.md follow from the declaration.
"""

from __future__ import annotations

import dataclasses
import functools
import os
import types
import typing
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pydantic
from annotated_types import Ge, GroupedMetadata, Le
from pydantic_core import PydanticCustomError, core_schema
from typing_extensions import Doc as Doc

from mazebench.errors import InputError, unknown

Options = TypeVar("Options")

_CONFIG = pydantic.ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, arbitrary_types_allowed=True)


class OneOf:
    """Metadata of a text field that allows some values only."""

    def __init__(self, *choices: str):
        self.choices = choices

    def __get_pydantic_core_schema__(self, kind: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_after_validator_function(self._check, handler(kind))

    def _check(self, value: str | None) -> str | None:
        if value is not None and value not in self.choices:
            raise PydanticCustomError("one_of", "Input should be one of {of}", {"of": ", ".join(self.choices)})
        return value


class Option(NamedTuple):
    """A description of one option; for a tuple, `lowest`, `highest` and `choices` are those of its elements."""

    help: str
    default: Any
    kind: Any  # the declared type
    lowest: float | None
    highest: float | None
    choices: tuple[str, ...] | None

    @property
    def range_text(self) -> str:
        """The allowed numbers in words; empty if any value is allowed."""
        if self.lowest is None:
            return "" if self.highest is None else f"of at most {self.highest}"
        return f"of at least {self.lowest}" if self.highest is None else f"from {self.lowest} to {self.highest}"

    @property
    def kind_text(self) -> str:
        """The type in words."""
        is_plain = isinstance(self.kind, type) and not typing.get_args(self.kind)
        return self.kind.__name__ if is_plain else str(self.kind)


@typing.dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(dataclasses.field,))
def options(cls: type[Options]) -> type[Options]:
    """Makes a class a frozen dataclass that checks its fields: a decorator.

    NumPy's numbers become Python's, and paths text. A field whose default is a tuple accepts any iterable, and a single
    value for a tuple of one. None is allowed where the type allows it. `__post_init__` may check how fields go
    together.

    Raises:
      InputError: when an object is made with a value that is not allowed.
    """
    checked: Any = pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=_CONFIG)(cls)
    check, fields = checked.__init__, checked.__dataclass_fields__

    @functools.wraps(check)
    def __init__(self: Any, *args: Any, **values: Any) -> None:
        for name in values:
            is_tuple = name in fields and isinstance(fields[name].default, tuple)
            values[name] = plain_tuple(values[name]) if is_tuple else _plain(values[name])
        try:
            check(self, *args, **values)
        except pydantic.ValidationError as error:
            raise _in_words(checked, error, values) from error

    checked.__init__ = __init__
    return checked


@functools.cache
def fields_of(options_class: Any) -> Mapping[str, Option]:
    """Returns the description of each field of a class that `options` made; a field that is no option has no help."""
    kinds, extras = typing.get_type_hints(options_class), typing.get_type_hints(options_class, include_extras=True)
    described = {}
    for field in dataclasses.fields(options_class):
        metadata = list(_metadata(extras[field.name]))
        described[field.name] = Option(
            help=next((item.documentation for item in metadata if isinstance(item, Doc)), ""),
            default=field.default,
            kind=kinds[field.name],
            lowest=next((item.ge for item in metadata if isinstance(item, Ge)), None),  # type: ignore[arg-type]
            highest=next((item.le for item in metadata if isinstance(item, Le)), None),  # type: ignore[arg-type]
            choices=next((item.choices for item in metadata if isinstance(item, OneOf)), None),
        )
    return types.MappingProxyType(described)


def _metadata(kind: Any) -> Iterable[Any]:
    """Yields the metadata of a declared type, and of a tuple's elements."""
    if typing.get_origin(kind) is typing.Annotated:
        inner, *items = typing.get_args(kind)
        yield from _metadata(inner)
        for item in items:
            yield from item if isinstance(item, GroupedMetadata) else (item,)
    elif typing.get_origin(kind) is tuple:
        yield from _metadata(typing.get_args(kind)[0])


def _plain(value: Any) -> Any:
    """Returns NumPy's numbers as Python's, and a path as text."""
    if isinstance(value, np.generic):
        return value.item()
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def plain_tuple(value: Any) -> tuple[Any, ...]:
    """Returns any iterable as a tuple, and a single value as a tuple of one; texts are split at their commas."""
    is_single = isinstance(value, str) or not isinstance(value, Iterable)
    parts: list[Any] = []
    for item in (value,) if is_single else value:
        parts += [part.strip() for part in item.split(",")] if isinstance(item, str) else [_plain(item)]
    return tuple(parts)


def _in_words(options_class: type, error: pydantic.ValidationError, values: Mapping[str, Any]) -> InputError:
    """Returns the first fault that pydantic found as an error in one line."""
    fault = error.errors(include_url=False)[0]
    if "error" in fault.get("ctx", {}):  # which `__post_init__` or a validator raised
        raised = fault["ctx"]["error"]
        return raised if isinstance(raised, InputError) else InputError(str(raised))
    name, found = str(fault["loc"][0]), fault["input"]
    if fault["type"] == "unexpected_keyword_argument":
        return unknown("option", name, fields_of(options_class))
    if fault["type"] == "missing":
        return InputError(f"expected {name}, found none")
    option = fields_of(options_class).get(name)
    if option is None:
        return InputError(f"expected {name} as options, found {found!r}"[:200])
    if fault["type"] == "one_of":
        return unknown(name, found, option.choices or ())
    if fault["type"] == "finite_number" and not (option.lowest is not None and option.highest is not None):
        return InputError(f"expected {name} as a finite number, found {found!r}")
    if fault["type"] in ("greater_than_equal", "less_than_equal", "finite_number"):
        return InputError(f"expected {name} {option.range_text}, found {found!r}")
    return InputError(f"expected {name} of type {option.kind_text}, found {values.get(name, found)!r}"[:200])
