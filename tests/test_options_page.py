"""The tables of docs/options.md; `python tests/test_options_page.py` rewrites those that follow from the code."""

from __future__ import annotations

import pathlib
import re
from collections.abc import Iterable

from mazebench.maps.maze_options import ReadOptions
from mazebench.options import Option, fields_of
from mazebench.tasks.task_options import TaskOptions

PAGE = pathlib.Path(__file__).parent.parent / "docs" / "options.md"
DERIVED_TABLE = re.compile(r"\| option \| default \| values \| what \|\n(?:\|.*\n)+")


OF_MAZES = ("size", "split", "mazes", "kinds", "num_mazes", "fresh")


def derived_tables() -> list[str]:
    """Returns the tables of the options of mazes, of reading them and of tasks, in the order of the page."""
    others = [name for name in fields_of(TaskOptions) if name not in (*OF_MAZES, *fields_of(ReadOptions))]
    of_sensors = [name for name in others if name not in TaskOptions.__annotations__]
    others = [name for name in others if name not in of_sensors] + of_sensors
    return [derived_table(OF_MAZES), derived_table(fields_of(ReadOptions)), derived_table(others)]


def derived_table(names: Iterable[str]) -> str:
    """Returns the table of some fields of a task."""
    lines = ["| option | default | values | what |\n", "|---|---|---|---|\n"]
    for name in names:
        option = fields_of(TaskOptions)[name]
        lines.append(f"| `{name}` | `{option.default!r}` | {values(option)} | {option.help} |\n")
    return "".join(lines)


def values(option: Option) -> str:
    return option.range_text if option.choices is None else ", ".join(f"`{choice!r}`" for choice in option.choices)


def test_the_tables_of_options_follow_from_the_code():
    found = DERIVED_TABLE.findall(PAGE.read_text(encoding="utf-8"))
    assert found == derived_tables(), "python tests/test_options_page.py rewrites them"


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    tables = iter(derived_tables())
    PAGE.write_text(DERIVED_TABLE.sub(lambda _: next(tables), text), encoding="utf-8")
