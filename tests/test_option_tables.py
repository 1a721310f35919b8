"""Tables in docs that follow from the code; `python tests/test_option_tables.py` rewrites them.

A page chooses the rows of a table of options or levels by their first cells. The other cells follow from the code. The
tables of actions and observations stand between two lines, as those of results do.
"""

from __future__ import annotations

import pathlib
import re

import gymnasium
import numpy as np
import pytest

import mazebench
from mazebench.constants import ACTIONS, YAW, X, Y
from mazebench.options import fields_of
from mazebench.tasks.task_options import HIERARCHICAL, LOCAL, TaskOptions
from mazebench.tasks.tracks import TRACKS
from mazebench.world.bodies import SLIDER

DOCS = pathlib.Path(__file__).parent.parent / "docs"
PAGES = [DOCS / "options.md", DOCS / "sensors.md", *sorted((DOCS / "environments").glob("[!i]*.md"))]
OPTIONS = fields_of(TaskOptions)
TABLE = re.compile(r"\| (?:option \| default \| (?:values|meaning)|level) \|.*\n\|[-|]+\n(?:\|.*\n)+")
ROW = re.compile(r"^\| `?(\w+)`? \|.*", re.M)
FROM_CODE = re.compile(r"(<!-- from the code: (\w+) -->\n)(?:\|.*\n)*(<!-- end of table -->\n)")
STATE = {  # by the first and the last index
    (0, 0): ("x", "m"),
    (1, 1): ("y", "m"),
    (2, 2): ("z, constant", "m"),
    (3, 4): ("roll and pitch, constant", "rad"),
    (5, 5): ("yaw in [-pi, pi), counter-clockwise from +x", "rad"),
    (6, 6): ("velocity forward", "m/s"),
    (7, 7): ("velocity to the left", "m/s"),
    (8, 8): ("velocity upward, constant", "m/s"),
    (9, 10): ("angular velocity about x and y, constant", "rad/s"),
    (11, 11): ("yaw rate, to the left", "rad/s"),
}
PLANES = {
    (0, 0): ("plane: the shown map, 1 at walls", ""),
    (1, 1): ("plane: the shown map around the start", ""),
    (2, 2): ("plane: 1 at the goal", ""),
    (3, 3): ("plane: 1 at the start", ""),
}
LIDAR = {(0, 31): ("distance to the wall; ray k points 11.25 k degrees to the left of forward", "m")}


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

    text = FROM_CODE.sub(lambda block: block[1] + TABLES[block[2]](page.stem) + block[3], text)
    return TABLE.sub(derive, text)


def actions_table(_: str) -> str:
    rows = ["| index | action | drives or turns at | unit |", "|---|---|---|---|"]
    for index, name in enumerate(ACTIONS):
        speed = f"{np.degrees(SLIDER.turn_rate):.0f} | degrees/s" if "look" in name else f"{SLIDER.top_speed:g} | m/s"
        rows.append(f"| {index} | {name.replace('_', ' ')} | {speed} |")
    return "\n".join(rows) + "\n"


def observations_table(name: str) -> str:
    """Returns a row for each number or plane of the observations of an environment, with the bounds of its space."""
    rows = ["| observation | index | meaning | unit | min | max |", "|---|---|---|---|---|---|"]
    spaces = mazebench.make(name).observation_space.spaces
    for key, parts in (("state", STATE), ("context", PLANES), ("lidar", LIDAR)):
        for (first, last), (meaning, unit) in parts.items() if key in spaces else ():
            if name in TRACKS and TRACKS[name].hides_pose and key == "state" and first in (X, Y, YAW):
                meaning = f"{meaning}, by odometry"
            low, high = spaces[key].low[first : last + 1].min(), spaces[key].high[first : last + 1].max()
            index = f"{first}" if first == last else f"{first}-{last}"
            rows.append(f"| `{key}` | {index} | {meaning} | {unit} | {low:g} | {high:g} |")
    return "\n".join(rows) + "\n"


TABLES = {"actions": actions_table, "observations": observations_table}


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
    assert f"Ids: {', '.join(f'`{each}`' for each in ids)}." in " ".join(page.split())
    spaces = mazebench.make(name).observation_space.spaces
    assert all(f"`{key}` `{list(box.shape)}`" in page for key, box in spaces.items() if key != "is_first")
    assert f"[{name}]({name}.md) | " in index
    if name in TRACKS:
        assert TRACKS[name].help in " ".join(page.split())
        assert f"]({name}.md) | {TRACKS[name].help} |" in index


if __name__ == "__main__":
    for path in PAGES:
        path.write_text(with_derived_tables(path, path.read_text(encoding="utf-8")), encoding="utf-8")
