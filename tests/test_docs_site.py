"""The site that mkdocs.yml describes: built strictly, complete in itself, and readable on a desktop and on a phone."""

from __future__ import annotations

import html.parser
import importlib.util
import os
import pathlib
import re
import subprocess
import sys
import urllib.parse

import pytest
from browser import CHROMIUM, Browser
from pages import ROOT

import mazebench

pytestmark = pytest.mark.skipif(importlib.util.find_spec("mkdocs") is None, reason="mkdocs is not installed")
# Loaded with a page, and not only where a reader follows a link.
LOADED = {("script", "src"), ("img", "src"), ("iframe", "src"), ("link", "href")}


class Page(html.parser.HTMLParser):
    """What a page links to, what it loads, and the anchors that it has."""

    def __init__(self, path: pathlib.Path):
        super().__init__()
        self.targets: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id" and value:
                self.anchors.add(value)
            if name in ("href", "src") and value:
                self.targets.append(value)
            if (tag, name) in LOADED and value:
                self.loaded.append(value)


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> pathlib.Path:
    """The site, built as `make docs` builds it."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(folder)]
    quiet = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    result = subprocess.run(command, cwd=ROOT, env=quiet, capture_output=True, text=True)
    assert (result.returncode, result.stdout + result.stderr) == (0, "")
    return folder


@pytest.fixture(scope="module")
def pages(site) -> dict[pathlib.Path, Page]:
    """Its pages but for the one that a server shows where there is none."""
    return {path: Page(path) for path in site.rglob("*.html") if path.name != "404.html"}


def test_links_when_followed(pages):
    broken = []
    for path, page in pages.items():
        for target in page.targets:
            address = urllib.parse.urlsplit(target)
            if address.scheme:
                continue
            there = (path.parent / urllib.parse.unquote(address.path)).resolve() if address.path else path
            if not there.exists() or (
                address.fragment and there in pages and address.fragment not in pages[there].anchors
            ):
                broken.append((path.name, target))
    assert broken == []


def test_pages_when_searched_for_other_machines(pages):
    assert {
        address for page in pages.values() for address in page.loaded if urllib.parse.urlsplit(address).netloc
    } == set()


def test_reference_when_compared_with_the_package(site):
    text = (site / "reference" / "index.html").read_text(encoding="utf-8")
    listed = re.findall(r'<a [^>]*href="[^"]*#mazebench[\w.]*\.(\w+)"', text)
    assert sorted(listed) == sorted(mazebench.__all__)


def test_field_when_explained_by_its_comment(site):
    text = (site / "reference" / "tasks.html").read_text(encoding="utf-8")
    assert "index among the task" in text  # of Episode.maze
    assert text.count("that draws the goals after the first one") == 1  # of LATER_GOALS_STREAM


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        yield browser


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
class TestInBrowser:
    @pytest.mark.parametrize("width", [390, 1280], ids=["phone", "desktop"])
    def test_pages_when_a_window_is_narrow_or_wide(self, browser, pages, width):
        browser.resize(width, 800)
        for path in pages:
            browser.open(path)
            # What does not fit, tables and code, is scrolled by itself; the page is not, and pictures fit.
            assert browser.run("document.scrollingElement.scrollWidth") == width, path
            widest = "Math.max(0, ...[...document.images].map(each => each.getBoundingClientRect().right))"
            assert browser.run(widest) <= width, path
        assert browser.errors == []

    def test_search_when_read_from_disk(self, browser, site):
        browser.resize(1280, 800)
        browser.open(site / "index.html")
        browser.run("document.querySelector('[data-md-component=search-query]').focus()")
        browser.call("Input.insertText", text="wilson")
        browser.wait_for("document.querySelector('.md-search-result__link')")
        found = browser.run("[...document.querySelectorAll('.md-search-result__link')].map(each => each.href)")
        assert any("metrics.html" in address for address in found)
        assert browser.errors == []
