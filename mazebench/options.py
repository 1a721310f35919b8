"""Options: frozen dataclasses whose fields say in one place what they mean and which values they allow.

    @dataclasses.dataclass(frozen=True, kw_only=True)
    class ReadOptions(Options):
        inflate: Annotated[float, Interval(ge=0, le=10), Doc("Metres by which walls are thickened.")] = 0.0
        unknown: Annotated[str, OneOf("wall", "free"), Doc("What unknown cells become.")] = "wall"

The command line, keyword arguments, config files and docs/options.md follow from the declaration.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import math
import os
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, NamedTuple, Self, TypeVar

import numpy as np
import pydantic
from annotated_types import Ge, GroupedMetadata, Le
from typing_extensions import Doc as Doc

from mazebench.errors import InputError, UnknownOptionError, unknown

_LONGEST = 200  # characters of a message about a value
Config = TypeVar("Config")


class OneOf:
    """Metadata of a text field that allows some values only."""

    def __init__(self, *choices: str):
        self.choices = choices


class ReadBy:
    """Metadata of a field whose values a function reads: it returns the field's value or raises `InputError`."""

    def __init__(self, read: Callable[[Any], Any]):
        self.read = read


class Option(NamedTuple):
    """A description of one option; for a tuple, `lowest`, `highest` and `choices` are those of its elements."""

    help: str
    default: Any
    kind: Any  # the declared type
    lowest: Any
    highest: Any
    choices: tuple[str, ...] | None
    read: Callable[[Any], Any] | None

    @property
    def range_text(self) -> str:
        """The allowed numbers in words; empty if any value is allowed."""
        if self.lowest is None:
            return "" if self.highest is None else f"of at most {self.highest}"
        return f"of at least {self.lowest}" if self.highest is None else f"from {self.lowest} to {self.highest}"

    @property
    def kind_text(self) -> str:
        """The type in words."""
        return self.kind.__name__ if type(self.kind) is type else str(self.kind)

    @property
    def plain_kind(self) -> Any:
        """The type without None; of a tuple, that of its elements."""
        plain = next(member for member in _members(self.kind) if member is not types.NoneType)
        plain = typing.get_args(plain)[0] if typing.get_origin(plain) is tuple else plain
        return str if typing.get_origin(plain) is typing.Literal else plain

    @property
    def is_tuple(self) -> bool:
        """True if the value is a tuple."""
        return any(typing.get_origin(member) is tuple for member in _members(self.kind))

    def checked(self, name: str, value: Any) -> Any:
        """Returns a value of the option called `name` in its own type.

        Raises:
          InputError: if it is not allowed.
        """
        if self.read is not None:
            return self.read(value)
        if value is None and types.NoneType in _members(self.kind):
            return None
        if not self.is_tuple:
            return self._checked_item(name, _plain(value), value)
        values = as_tuple(value)
        if self.plain_kind is int and isinstance(value, str):
            raise InputError(f"expected {name} as numbers, such as range(1, 4), found {value!r}"[:_LONGEST])
        return tuple(self._checked_item(name, item, values) for item in values)

    def _checked_item(self, name: str, value: Any, whole: Any) -> Any:
        """Returns a value, or an element of the tuple `whole`, in its own type."""
        kind = self.plain_kind
        accepted = (int, float) if kind is float else kind
        if not isinstance(value, accepted) or (isinstance(value, bool) and kind is not bool):
            raise InputError(f"expected {name} of type {self.kind_text}, found {whole!r}"[:_LONGEST])
        if self.choices is not None and value not in self.choices:
            raise unknown(name, value, self.choices)
        if kind is float and None in (self.lowest, self.highest) and not math.isfinite(value):
            raise InputError(f"expected {name} as a finite number, found {value!r}")
        is_low = self.lowest is not None and not value >= self.lowest  # not a number is no number of a range
        if is_low or (self.highest is not None and not value <= self.highest):
            raise InputError(f"expected {name} {self.range_text}, found {value!r}"[:_LONGEST])
        return float(value) if kind is float else value


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options:
    """Base of options. Making them checks each field, and converts its value to the declared type.

    NumPy's numbers become Python's, and paths text. A tuple is made of any iterable, of a single value, or of a text,
    which is split at its commas. None is allowed where the type allows it; there it says that the option is open.
    """

    def __post_init__(self) -> None:
        for name, option in fields_of(type(self)).items():
            object.__setattr__(self, name, option.checked(name, getattr(self, name)))

    @classmethod
    def of(cls, values: Mapping[str, Any], **others: Any) -> Self:
        """Returns the options of which `values` has the fields; None stands for the default.

        Raises:
          InputError: if there is no such option, or a value is not allowed.
        """
        check_names(values, cls)
        return cls(**{name: value for name, value in values.items() if value is not None}, **others)

    def replace(self, **changes: Any) -> Self:
        """Returns the options with other values of some fields."""
        return dataclasses.replace(self, **changes)

    def filled(self, **values: Any) -> Self:
        """Returns the options with values that follow from them, where they were open.

        Each is checked by itself, but they are not checked beside each other again, as `replace` does.
        """
        other = copy.copy(self)
        for name, value in values.items():
            object.__setattr__(other, name, fields_of(type(self))[name].checked(name, value))
        return other

    def changed(self) -> dict[str, Any]:
        """Returns the fields that differ from their defaults, by name."""
        values = {name: (getattr(self, name), option.default) for name, option in fields_of(type(self)).items()}
        return {name: value for name, (value, default) in values.items() if value != default}


def fields_of(options_class: type) -> Mapping[str, Option]:
    """Returns the description of each field of a class; one that no user chooses has no help."""
    return _fields_of(options_class)


@functools.cache
def _fields_of(options_class: Any) -> Mapping[str, Option]:
    described = {}
    hints = typing.get_type_hints(options_class, include_extras=True)
    kinds = typing.get_type_hints(options_class)
    for field in dataclasses.fields(options_class):
        metadata, kind = list(_metadata(hints[field.name])), kinds[field.name]
        literals = typing.get_args(kind) if typing.get_origin(kind) is typing.Literal else ()
        described[field.name] = Option(
            help=next((item.documentation for item in metadata if isinstance(item, Doc)), ""),
            default=field.default,
            kind=kind,
            lowest=next((item.ge for item in metadata if isinstance(item, Ge)), None),
            highest=next((item.le for item in metadata if isinstance(item, Le)), None),
            choices=next((item.choices for item in metadata if isinstance(item, OneOf)), literals or None),
            read=next((item.read for item in metadata if isinstance(item, ReadBy)), None),
        )
    return types.MappingProxyType(described)


def override(config: Config, values: Mapping[str, Any]) -> Config:
    """Returns `config`, whose class subclasses `Options`, with some of its values replaced.

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


def _read_overrides(values: Mapping[str, Any] | Iterable[str] | None) -> dict[str, str]:
    """Returns values of an agent's config as text, by name: from a mapping, from texts KEY=VALUE, or none."""
    if isinstance(values, Mapping):
        return {name: str(value) for name, value in values.items()}
    read = {}
    for text in values or ():
        key, equals, value = text.partition("=")
        if not equals or not key:
            raise InputError(f"expected --set KEY=VALUE, found {text!r}")
        read[key.strip()] = value.strip()
    return read


# The type of a field `overrides`, which the command line has as --set.
Overrides = Annotated[Mapping[str, str], ReadBy(_read_overrides), Doc("A value of the agent's config; repeatable.")]


def options_in(values: Mapping[str, Any], options_class: type) -> dict[str, Any]:
    """Returns those of some values that are options of a class, by name."""
    names = {name for name, option in fields_of(options_class).items() if option.help}
    return {name: value for name, value in values.items() if name in names}


def check_names(values: Iterable[str], *options_classes: type, arguments: Iterable[str] = ()) -> None:
    """Checks that each name is an option of one of the classes, or one of the arguments of the call.

    Raises:
      UnknownOptionError: if one is not; it lists all that the call takes.
    """
    known = {*arguments, *(name for each in options_classes for name, option in fields_of(each).items() if option.help)}
    for name in values:
        if name not in known:
            available = ", ".join(sorted(known))
            raise UnknownOptionError(f"got an unexpected keyword argument {name!r}; available: {available}")


def as_tuple(value: Any) -> tuple[Any, ...]:
    """Returns any iterable as a tuple, and a single value as a tuple of one; texts are split at their commas."""
    is_single = isinstance(value, str) or not isinstance(value, Iterable) or getattr(value, "ndim", 1) == 0
    parts: list[Any] = []
    for item in (value,) if is_single else value:
        parts += [part.strip() for part in item.split(",")] if isinstance(item, str) else [_plain(item)]
    return tuple(parts)


def _members(kind: Any) -> tuple[Any, ...]:
    """Returns the members of a union, or the type itself."""
    return typing.get_args(kind) if typing.get_origin(kind) in (typing.Union, types.UnionType) else (kind,)


def _metadata(kind: Any) -> Iterable[Any]:
    """Yields the metadata of a declared type, of a union's members, and of a tuple's elements."""
    if typing.get_origin(kind) is typing.Annotated:
        inner, *items = typing.get_args(kind)
        yield from _metadata(inner)
        for item in items:
            yield from item if isinstance(item, GroupedMetadata) else (item,)
    elif typing.get_origin(kind) is tuple:
        yield from _metadata(typing.get_args(kind)[0])
    elif len(members := _members(kind)) > 1:
        for member in members:
            yield from _metadata(member)


def _plain(value: Any) -> Any:
    """Returns NumPy's numbers as Python's, and a path as text."""
    if isinstance(value, np.generic):
        return value.item()
    return os.fspath(value) if isinstance(value, os.PathLike) else value
