"""The diffs of docs/extend.md: each one fits the code as it is."""

from __future__ import annotations

import pathlib
import re
import subprocess

import pytest

ROOT = pathlib.Path(__file__).parent.parent
DIFFS = re.findall(r"```diff\n(.*?)```", (ROOT / "docs" / "extend.md").read_text(encoding="utf-8"), flags=re.DOTALL)


@pytest.mark.parametrize("diff", DIFFS, ids=["mazes", "sensor", "track", "agent"])
def test_a_diff_applies(diff):
    run = subprocess.run(["git", "apply", "--check"], input=diff, text=True, cwd=ROOT, capture_output=True)
    assert run.returncode == 0, run.stderr
