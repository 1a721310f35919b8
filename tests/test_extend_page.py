"""The diffs to which docs/extend.md links: each one fits the code as it is."""

from __future__ import annotations

import pathlib
import subprocess

import pytest

ROOT = pathlib.Path(__file__).parent.parent
DIFFS = sorted((ROOT / "docs" / "examples" / "extend").glob("*.diff"))


@pytest.mark.parametrize("path", DIFFS, ids=lambda path: path.stem)
def test_a_diff_applies(path):
    run = subprocess.run(["git", "apply", "--check", path], text=True, cwd=ROOT, capture_output=True)
    assert run.returncode == 0, run.stderr


def test_the_page_links_to_all_diffs():
    page = (ROOT / "docs" / "extend.md").read_text(encoding="utf-8")
    assert all(f"(examples/extend/{path.name})" in page for path in DIFFS)
    assert len(DIFFS) == 4
