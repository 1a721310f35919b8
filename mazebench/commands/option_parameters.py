"""Options of the command line that follow from option classes."""

from __future__ import annotations

import enum
import functools
import inspect
import os
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any

import typer

from mazebench.errors import InputError
from mazebench.options import Option, as_tuple, fields_of, options_in
from mazebench.storage.cache import NO_CACHE
from mazebench.tasks.task import Task, resolve_for_evaluation
from mazebench.tasks.task_options import TaskOptions


def _leave_out_cache(asked: bool) -> None:
    if asked:
        os.environ[NO_CACHE] = "1"  # for the processes of workers, too


NoCache = Annotated[
    bool,
    typer.Option("--no-cache", callback=_leave_out_cache, help="Keep no changed buildings on disk, and read none."),
]


def takes_options(
    *options_classes: type, without: Iterable[str] = ()
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Gives a command an option for each field of some classes that has a help, but for `without`.

    Of two fields of one name, that of the first class counts. The command has a parameter `values`, which receives the
    values by name of those that are not left at the default. `options_in` picks those of one class.
    """
    options: dict[str, Option] = {}
    for name, option in (item for each in options_classes for item in fields_of(each).items()):
        if option.help and name not in without:
            options.setdefault(name, option)
    added = [_parameter(name, option) for name, option in options.items()]

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command, eval_str=True)
        kept = [parameter for name, parameter in own.parameters.items() if name != "values"]

        @functools.wraps(command)
        def run(**chosen: Any) -> None:
            changed = {}
            for name, option in options.items():
                value = chosen.pop(name)
                if isinstance(value, enum.Enum):
                    value = value.value
                elif option.is_tuple and value is not None:
                    value = parse_numbers(name, value) if option.plain_kind is int else as_tuple(value)
                if value not in (None, option.default):
                    changed[name] = value
            command(**chosen, values=changed)

        parameters = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in [*kept, *added]]
        run.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return run

    return decorate


def watched_task(values: Mapping[str, Any]) -> Task:
    """Returns the task of an episode that is to be looked at, of 10 cells or near to that if no distance is chosen."""
    asked = TaskOptions.of(options_in(values, TaskOptions))
    task = resolve_for_evaluation(asked)
    if asked.distances or asked.num_ends == 2 or asked.track is not None or asked.is_hierarchical:
        return task
    return task.replace(distances=(min(task.distances, key=lambda distance: abs(distance - 10)),))


def words_of(values: Mapping[str, Any]) -> list[str]:
    """Returns the words of a command line that give options some values, none of which is False."""
    words = []
    for name, value in values.items():
        text = ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
        words += [f"--{name.replace('_', '-')}", *([] if value is True else [text])]
    return words


def parse_numbers(name: str, text: str, least: int = 1) -> tuple[int, ...]:
    """Returns sorted numbers from ranges and commas, as "1-5,8,10"; `name` is the option's, for messages."""
    numbers: set[int] = set()
    for part in text.split(","):
        low, dash, high = part.strip().partition("-")
        if not low.isdecimal() or (dash and not high.isdecimal()) or len(low) > 5 or len(high) > 5:
            raise InputError(f"expected {name} like 1-3 or 2,3, found {text!r}")
        if int(low) > int(high or low):
            raise InputError(f"expected {name} from low to high, found {part.strip()!r}")
        numbers.update(range(int(low), int(high or low) + 1))
    if not numbers or min(numbers) < least:
        raise InputError(f"expected {name} of {least} or more, found {text!r}")
    return tuple(sorted(numbers))


def _parameter(name: str, option: Option) -> inspect.Parameter:
    """Returns the parameter from which typer makes the option."""
    kind: Any = option.kind
    default, metavar = option.default, None
    if option.is_tuple and option.plain_kind is int:
        kind = str | None
    elif option.is_tuple:
        kind, default = list[str], list(default)
        metavar = f"<{'|'.join(option.choices)}>, repeatable" if option.choices else None
    elif option.choices:
        choice: Any = enum.StrEnum(name, {each: each for each in option.choices})  # type: ignore[misc]  # as typer wants
        kind, default = (choice | None, None) if default is None else (choice, choice(default))
    elif name == "overrides":
        kind, default, metavar = list[str], [], "KEY=VALUE"
    elif name in ("mazes", "shown", "body"):  # in Python also values, on the command line a path
        kind = str | None
    flags = {"task": ("--task", "--track"), "overrides": ("--set",)}.get(name, ())
    annotation = Annotated[kind, typer.Option(*flags, help=option.help, metavar=metavar)]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
