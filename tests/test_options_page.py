"""The tables of docs/options.md; `python tests/test_options_page.py` rewrites those that follow from the code."""

from __future__ import annotations

import ast
import inspect
import pathlib
import re

import pytest

from mazebench.envs import registration
from mazebench.maps.options import DrawnOptions, MapOptions
from mazebench.options import Option, options_of
from mazebench.tasks import build
from mazebench.tasks.options import TaskOptions, Variants

PAGE = pathlib.Path(__file__).parent.parent / "docs" / "options.md"
DERIVED_TABLE = re.compile(r"\| option \| default \| values \| what \|\n(?:\|.*\n)+")
TABLE = re.compile(r"^\| option.*\n\|[-|]+\n((?:\|.*\n)+)", re.MULTILINE)


def derived_tables() -> list[str]:
    """Returns the tables of the options of mazes and of tasks, in the order of the page."""
    return [derived_table(DrawnOptions), derived_table(MapOptions), derived_table(TaskOptions, Variants)]


def derived_table(*classes: type) -> str:
    """Returns the table of the fields of some classes: of each its own first, then those of base classes."""
    lines = ["| option | default | values | what |\n", "|---|---|---|---|\n"]
    for each in classes:
        for name, option in sorted(options_of(each).items(), key=lambda item: item[0] not in each.__annotations__):
            lines.append(f"| `{name}` | `{option.default!r}` | {values(option)} | {option.help} |\n")
    return "".join(lines)


def values(option: Option) -> str:
    return option.range_text if option.choices is None else ", ".join(f"`{choice!r}`" for choice in option.choices)


def documented(table: str) -> dict[str, object]:
    """Returns the names and defaults in the first two columns."""
    cells = [row.split("|")[1:3] for row in table.splitlines()]
    return {name.strip(" `"): ast.literal_eval(default.strip(" `")) for name, default in cells}


def parameters(function) -> dict[str, object]:
    """Returns the named parameters and their defaults, except the options of a task."""
    found = inspect.signature(function).parameters.values()
    return {each.name: each.default for each in found if each.kind is not each.VAR_KEYWORD and each.name != "task"}


def test_the_tables_of_options_follow_from_the_code():
    found = DERIVED_TABLE.findall(PAGE.read_text(encoding="utf-8"))
    assert found == derived_tables(), "python tests/test_options_page.py rewrites them"


@pytest.mark.parametrize(
    ("index", "function", "others"),
    [
        (0, build.make_spec, None),
        (4, registration.load, build.make_spec),
        (5, registration.make_env, None),
        (5, registration.make_goal_env, None),
        (6, registration.make_vec, None),
    ],
    ids=["mazes", "load", "gymnasium.make", "goal", "make_vec"],
)
def test_the_other_tables_name_the_parameters_of_their_function(index, function, others):
    tables = TABLE.findall(PAGE.read_text(encoding="utf-8"))
    assert len(tables) == 7
    found = parameters(function)
    for name in parameters(others) if others else ():
        found.pop(name, None)
    assert documented(tables[index]) == found


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    tables = iter(derived_tables())
    PAGE.write_text(DERIVED_TABLE.sub(lambda _: next(tables), text), encoding="utf-8")
