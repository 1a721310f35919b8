"""Tables of options in docs; `python tests/test_option_tables.py` rewrites them from the code.

A page chooses the rows of a table by their first cells. The other cells follow from the code.
"""

from __future__ import annotations

import pathlib
import re

import gymnasium
import pytest

import mazebench
from mazebench.options import fields_of
from mazebench.tasks.task_options import HIERARCHICAL, LOCAL, TaskOptions
from mazebench.tasks.tracks import TRACKS

DOCS = pathlib.Path(__file__).parent.parent / "docs"
PAGES = [DOCS / "options.md", DOCS / "sensors.md", *sorted((DOCS / "environments").glob("[!i]*.md"))]
OPTIONS = fields_of(TaskOptions)
TABLE = re.compile(r"\| (?:option \| default \| (?:values|meaning)|level) \|.*\n\|[-|]+\n(?:\|.*\n)+")
ROW = re.compile(r"^\| `?(\w+)`? \|.*", re.M)


def with_derived_tables(page: pathlib.Path, text: str) -> str:
    """Returns the text of a page with the rows of its tables as they follow from the code."""

    def derive(table: re.Match[str]) -> str:
        first, *head = table[0].splitlines()[0].strip("| ").split(" | ")

        def row(named: re.Match[str]) -> str:
            if named[1] == first:
                return named[0]
            if first == "level":
                return f"| {named[1]} | {TRACKS[page.stem].levels[int(named[1]) - 1].meaning} |"
            option = OPTIONS[named[1]]
            values = (
                option.range_text if option.choices is None else ", ".join(f"`{each!r}`" for each in option.choices)
            )
            cells = [f"`{named[1]}`", f"`{option.default!r}`", *[values] * ("values" in head), option.help]
            return f"| {' | '.join(cells)} |"

        return ROW.sub(row, table[0])

    return TABLE.sub(derive, text)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_tables_follow_from_the_code(page):
    text = page.read_text(encoding="utf-8")
    assert with_derived_tables(page, text) == text, "python tests/test_option_tables.py rewrites them"


def test_the_page_of_options_lists_each_of_them_once():
    tables = [table for table in TABLE.findall(PAGES[0].read_text(encoding="utf-8")) if "| values |" in table]
    assert sorted(name for table in tables for name in ROW.findall(table) if name != "option") == sorted(OPTIONS)


@pytest.mark.parametrize("name", [*TRACKS, LOCAL, HIERARCHICAL])
def test_the_page_of_an_environment_has_its_help_ids_and_observations(name):
    page, index = ((DOCS / "environments" / f"{each}.md").read_text(encoding="utf-8") for each in (name, "index"))
    ids = [each for each in gymnasium.registry if re.match(f"mazebench/{name}(goal)?-", each, re.I)]
    assert f"| ids | {', '.join(f'`{each}`' for each in ids)} |" in page
    spaces = mazebench.make(name).observation_space.spaces
    assert all(f"`{key}` `{list(box.shape)}`" in page for key, box in spaces.items() if key != "is_first")
    assert f"[{name}]({name}.md) | " in index
    if name in TRACKS:
        assert TRACKS[name].help in " ".join(page.split())
        assert f"[{name}]({name}.md) | {TRACKS[name].help} |" in index


if __name__ == "__main__":
    for path in PAGES:
        path.write_text(with_derived_tables(path, path.read_text(encoding="utf-8")), encoding="utf-8")
