"""The tables of docs/options.md; `python tests/test_options_page.py` rewrites those that follow from the code."""

from __future__ import annotations

import pathlib
import re

from mazebench.maps.maze_options import DrawnOptions, ReadOptions
from mazebench.options import Option, options_of
from mazebench.tasks.task import TaskOptions, Variants

PAGE = pathlib.Path(__file__).parent.parent / "docs" / "options.md"
DERIVED_TABLE = re.compile(r"\| option \| default \| values \| what \|\n(?:\|.*\n)+")


def derived_tables() -> list[str]:
    """Returns the tables of the options of mazes and of tasks, in the order of the page."""
    return [derived_table(DrawnOptions), derived_table(ReadOptions), derived_table(TaskOptions, Variants)]


def derived_table(*classes: type) -> str:
    """Returns the table of the fields of some classes: of each its own first, then those of base classes."""
    lines = ["| option | default | values | what |\n", "|---|---|---|---|\n"]
    for each in classes:
        for name, option in sorted(options_of(each).items(), key=lambda item: item[0] not in each.__annotations__):
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
