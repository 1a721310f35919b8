"""The words of README.md and docs: the rules of CONTRIBUTING.md that can be counted."""

from __future__ import annotations

import pathlib
import re

import pytest
from pages import ROOT, name_of, read

from benchmarks.results.results_tables import SATURATED

PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
MOST_WORDS = 19_000
HEDGES = r"\b(may|might|perhaps|seems?|likely|unlikely|possibly|probably|unclear|not clear|to be seen|told apart)\b"
# Words of ours where the field has others, and pages that speak.
BANNED = (
    r"\]\([^)]*\) (says|has|knows|tells)\b",
    r"\b(anew|sheet|sitting|beside)\b",
    r"\bto be seen\b",
    r"\bmight not show\b",
    r"\breach(es)? (nearly |next to )?(all|no|few|most) goals\b",
)
COMMIT = r"\b(?=[0-9a-f]*[a-f])(?=[0-9a-f]*[0-9])[0-9a-f]{7,40}\b"  # where it may stand: code and tables


def prose(page: pathlib.Path) -> str:
    """A page without code, tables, comments and lines of HTML; of links, the text alone."""
    text = re.sub(r"^(```|~~~).*?^\1", "", read(page), flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    lines = [line for line in text.splitlines() if not re.match(r"\s*\||<|:::", line)]
    return "\n".join(lines)


def without_links(text: str) -> str:
    return re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)


def sentences(text: str) -> list[str]:
    return [each for each in re.split(r"(?<=[.!?:])\s+|\n\n", text) if len(each.split()) > 2]


def test_readers_need_an_hour():
    words = {name_of(page): len(re.findall(r"[A-Za-z0-9][\w'’.,-]*", without_links(prose(page)))) for page in PAGES}
    assert sum(words.values()) <= MOST_WORDS, sorted(words.items(), key=lambda item: -item[1])[:10]


def test_the_readme_is_short():
    assert len(read(ROOT / "README.md").splitlines()) <= 150


def test_effects_are_stated_without_hedges():
    found = {name_of(page): sentences(without_links(prose(page))) for page in PAGES}
    hedged = {name: [each for each in of if re.search(HEDGES, each, re.IGNORECASE)] for name, of in found.items()}
    assert sum(map(len, hedged.values())) <= sum(map(len, found.values())) / 50, hedged


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_words_of_a_page(page):
    text = " ".join(prose(page).split())
    assert [found[0] for pattern in BANNED for found in re.finditer(pattern, text)] == []
    assert re.findall(COMMIT, text) == []
    lines = [line for line in prose(page).splitlines() if not line.startswith(SATURATED)]  # below a table, made with it
    assert [line for line in lines if len(line) > 120] == []
