"""Version, change log and citation of a release agree. `.ci/release` builds one and tries it."""

from __future__ import annotations

import pathlib
import re

import yaml

import mazebench

ROOT = pathlib.Path(__file__).parent.parent
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))


def test_version_when_compared_with_change_log_and_citation():
    headings = re.findall(r"^## (\S+), (.+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    version, date = headings[0]
    assert version == mazebench.__version__ == CITATION["version"]
    released = CITATION.get("date-released")
    assert date == ("unreleased" if released is None else str(released))
