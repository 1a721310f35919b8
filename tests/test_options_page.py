"""The tables of docs/options.md name every option, with its default."""

from __future__ import annotations

import ast
import inspect
import pathlib
import re

import pytest

from mazebench.envs import registration
from mazebench.tasks import registry

PAGE = (pathlib.Path(__file__).parent.parent / "docs" / "options.md").read_text(encoding="utf-8")
TABLES = re.findall(r"^\| option.*\n\|[-|]+\n((?:\|.*\n)+)", PAGE, re.MULTILINE)


def documented(table: str) -> dict[str, object]:
    """The names and defaults in the first two columns."""
    cells = [row.split("|")[1:3] for row in table.splitlines()]
    return {name.strip(" `"): ast.literal_eval(default.strip(" `")) for name, default in cells}


def options(function) -> dict[str, object]:
    """The named parameters and their defaults."""
    parameters = inspect.signature(function).parameters.values()
    return {each.name: each.default for each in parameters if each.kind is not each.VAR_KEYWORD}


def test_task_options_when_compared_with_make_spec():
    assert list(documented(TABLES[0]).items()) == list(options(registry.make_spec).items())


@pytest.mark.parametrize(
    ("table", "function"),
    [
        (1, registry.load),
        (2, registration.make_env),
        (2, registration.make_goal_env),
        (3, registration.make_vec),
    ],
    ids=["load", "gymnasium.make", "goal", "make_vec"],
)
def test_environment_options_when_compared_with_their_function(table, function):
    of_task = options(registry.make_spec)
    found = {name: default for name, default in options(function).items() if name not in of_task}
    assert documented(TABLES[table]) == found
    for name in set(options(function)) & set(of_task):
        assert options(function)[name] == of_task[name]


def test_tables_when_counted():
    assert len(TABLES) == 4


@pytest.mark.parametrize("row", TABLES[0].splitlines(), ids=lambda row: row.split("|")[1].strip(" `"))
def test_task_option_when_its_task_is_looked_up(row):
    assert row.split("|")[4].strip() in ("", "both", "local", "hierarchical")
