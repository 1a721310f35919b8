"""Tables on terminals: no number is cut, however narrow the terminal and long the names."""

from __future__ import annotations

import re

import pytest

from mazebench.commands.table import print_table

HEAD = ["part", "n", "success rate", "SPL"]
ROWS = [
    ["local-13", "1500", "0.99 [0.97, 1.00]", "0.84 [0.83, 0.86]"],
    ["hierarchical-13-k5", "20", "1.00 [0.84, 1.00]", ""],
]
NAME = "mylab.navigation.experiments.agents:RecurrentPlannerWithMap"


def printed(capsys, monkeypatch, columns, **options):
    monkeypatch.setenv("COLUMNS", str(columns))
    print_table(f"{NAME}: suite paper", HEAD, ROWS, **options)
    return capsys.readouterr().out


@pytest.mark.parametrize("columns", [40, 60, 80])
@pytest.mark.parametrize("narrow", [False, True])
def test_all_numbers_stand_whole_in_lines_that_fit(capsys, monkeypatch, columns, narrow):
    output = printed(capsys, monkeypatch, columns, narrow=narrow)
    assert max(map(len, output.splitlines())) <= columns
    for text in ("1500", "20", "0.99 [0.97, 1.00]", "0.84 [0.83, 0.86]", "1.00 [0.84, 1.00]"):
        assert len(re.findall(rf"(?<!\S){re.escape(text)}(?!\S)", output)) == 1
    assert re.sub(r"\s", "", output).startswith(f"{NAME}:suitepaper")
