"""What a release says of itself agrees: version, change log, citation. `.ci/release` builds one and tries it."""

from __future__ import annotations

import pathlib
import re

import yaml

import mazebench
from mazebench.results.paper import reference

ROOT = pathlib.Path(__file__).parent.parent
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
PAPER = CITATION["references"][0]


def test_citation_when_compared_with_what_its_format_requires():
    assert CITATION["cff-version"] == "1.2.0"
    assert CITATION["type"] == "software"
    assert CITATION["title"].startswith("mazebench")
    assert all(isinstance(CITATION[key], str) and CITATION[key] for key in ("message", "license", "version"))
    for cited in (CITATION, PAPER):
        assert cited["authors"]
        assert all(
            author.keys() <= {"name", "given-names", "family-names", "affiliation"} for author in cited["authors"]
        )
    assert not CITATION.keys() & {"doi", "url"}, "none is known"
    assert PAPER["url"].rpartition("/")[2] in PAPER["identifiers"][0]["value"]


def test_paper_when_compared_with_the_reference_numbers_source():
    authors = [f"{author['given-names']} {author['family-names']}" for author in PAPER["authors"]]
    assert (PAPER["type"], PAPER["title"]) == ("conference-paper", reference()["title"])
    assert " and ".join(authors) == reference()["authors"]


def test_version_when_compared_with_change_log_and_citation():
    headings = re.findall(r"^## (\S+), (.+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    version, date = headings[0]
    assert version == mazebench.__version__ == CITATION["version"]
    released = CITATION.get("date-released")
    assert date == ("unreleased" if released is None else str(released))
