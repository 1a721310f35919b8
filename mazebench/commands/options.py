"""Options of the command line that follow from the fields of option classes."""

from __future__ import annotations

import dataclasses
import enum
import functools
import inspect
import typing
from collections.abc import Callable
from typing import Annotated, Any

import typer

from mazebench.errors import InputError, held_remarks
from mazebench.options import Option, Options, options_of

# Options that another one leaves without effect, and why.
LOCAL_ONLY = ("distances", "episodes_per_distance")
HIERARCHICAL = ("the hierarchical task leads from corner to corner", LOCAL_ONLY)
LOCAL = ("the local task has no landmarks", ("landmark_distance",))
OWN_MAPS = ("with --maps the mazes are your own", ("split",))
OWN_ENDS = ("with --start and --goal the distance is given", ("distances",))
NO_CAMERA = ("no camera is among the --sensors", ("camera_size", "textures"))
NO_TRACK = ("a level belongs to a track", ("level",))
TRACK = ("a track has its own time limit", ("time_limit",))
FROZEN_TRACK = ("a track's eval episodes are frozen", ("episodes_per_distance",))
_WORTH_WATCHING = 10  # cells from start to goal


def takes_options(
    options_class: type[Options], names: tuple[str, ...], **defaults: Any
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Gives a command an option for each field `names` of a class.

    The command has a parameter `values`, which receives the values by name.

    Args:
      options_class: such as `EvalOptions`.
      names: of the fields.
      **defaults: of fields whose default differs in this command.
    """
    options, kinds = options_of(options_class), typing.get_type_hints(options_class)
    defaults = {field.name: field.default for field in dataclasses.fields(options_class)} | defaults
    added = [_parameter(name, options[name], kinds[name], defaults[name]) for name in names]

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command, eval_str=True)
        kept = [parameter for name, parameter in own.parameters.items() if name != "values"]

        @functools.wraps(command)
        def run(**given: Any) -> None:
            values = {name: _to_value(name, kinds[name], given.pop(name)) for name in names}
            command(**given, values=values)

        parameters = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in [*kept, *added]]
        run.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return run

    return decorate


def refuse_ignored(context: typer.Context, *rules: tuple[bool, str, tuple[str, ...]]) -> None:
    """Refuses options that were given and would make no difference.

    Args:
      context: of the command.
      *rules: whether it applies, the reason, and the options' names.

    Raises:
      InputError: naming the first such option.
    """
    for applies, reason, names in rules:
        for name in names if applies else ():
            source = context.get_parameter_source(name)
            if source is not None and source.name != "DEFAULT":
                (option,) = (parameter.opts[0] for parameter in context.command.params if parameter.name == name)
                raise InputError(f"{reason}; found {option}, which would be ignored")


def refuse_ignored_by_task(context: typer.Context, values: dict[str, Any]) -> None:
    """Refuses options without effect in the task, or on the maps, that `values` name."""
    refuse_ignored(
        context,
        (values["task"] == "hierarchical", *HIERARCHICAL),
        (values["task"] == "local", *LOCAL),
        (values["maps"] is not None, *OWN_MAPS),
        (values["start"] is not None and values["goal"] is not None, *OWN_ENDS),
        (values["track"] is None, *NO_TRACK),
        (values["track"] is not None, *TRACK),
        (values["track"] is not None and values["maps"] is None and values["split"] == "eval", *FROZEN_TRACK),
    )


def watched_distances(values: dict[str, Any]) -> tuple[int, ...] | None:
    """Returns the given distances, or else that of an episode which is to be looked at.

    It is 10 cells, or as near to that as maps, a start or a goal of one's own allow. None stands for the distances of a
    track, of given ends, or of corners.

    Raises:
      InputError: if the task is not one.
    """
    has_own = (
        values["track"] is not None or values["task"] == "hierarchical" or None not in (values["start"], values["goal"])
    )
    if values["distances"] or has_own:
        return values["distances"] or None
    if values["maps"] is None and values["start"] is None and values["goal"] is None:
        return (_WORTH_WATCHING,)
    from mazebench.tasks.registry import make_spec

    of_task = {name: value for name, value in values.items() if name not in ("distances", "checkpoint", "seed")}
    with held_remarks():  # the command reads the maps again
        distances = make_spec(**of_task).distances
    return (min(distances, key=lambda distance: abs(distance - _WORTH_WATCHING)),)


def parse_numbers(name: str, text: str) -> tuple[int, ...]:
    """Returns sorted numbers from ranges and commas, as "1-5,8,10"; `name` is the option's, for messages.

    Raises:
      InputError: if `text` is anything else.
    """
    numbers: set[int] = set()
    for part in text.split(","):
        low, dash, high = part.strip().partition("-")
        if not low.isdecimal() or (dash and not high.isdecimal()) or len(low) > 5 or len(high) > 5:
            raise InputError(f"expected {name} like 1-3 or 2,3, found {text!r}")
        if int(low) > int(high or low):
            raise InputError(f"expected {name} from low to high, found {part.strip()!r}")
        numbers.update(range(int(low), int(high or low) + 1))
    if not numbers or min(numbers) < 1:
        raise InputError(f"expected {name} of 1 or more, found {text!r}")
    return tuple(sorted(numbers))


def _parameter(name: str, option: Option, kind: Any, default: Any) -> inspect.Parameter:
    """Returns the parameter from which typer makes the option."""
    shown, metavar = kind, None
    if kind == tuple[int, ...]:
        shown, default = str | None, ",".join(map(str, default)) or None
    elif kind == tuple[str, ...]:
        shown, default = list[str], list(default)
        metavar = f"<{'|'.join(option.choices)}>, repeatable" if option.choices else None
    elif option.choices:
        choice = _choice(name, option.choices)
        shown, default = (choice | None, None) if default is None else (choice, choice(default))
    annotation = Annotated[shown, typer.Option(help=option.help, metavar=metavar)]  # type: ignore[valid-type]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _choice(name: str, choices: tuple[str, ...]) -> Any:
    """Returns the enumeration that typer wants for a choice."""
    return enum.StrEnum(name, {choice: choice for choice in choices})


def _to_value(name: str, kind: Any, given: Any) -> Any:
    if isinstance(given, enum.Enum):
        return given.value
    if kind == tuple[int, ...]:
        return () if given is None else parse_numbers(name, given)
    return tuple(given) if kind == tuple[str, ...] else given
