"""The site of docs in a browser: pages with films, figures and tutorials, on a screen and on a phone."""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys

import pytest
from browser import CHROMIUM, Browser

ROOT = pathlib.Path(__file__).parent.parent
ENVIRONMENTS = ("index", "building", "rebuilt", "adrift", "rough", "doors", "local", "hierarchical")
TUTORIALS = ("tutorials/training_loop", "tutorials/imitation", "examples/first_hour")
FIGURES = ("real", "tracks", "layouts", "metrics", "task", "sensors", "your_map", "agents/neural_planner")
PAGES = (*(f"environments/{name}" for name in ENVIRONMENTS), *TUTORIALS, *FIGURES)


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> pathlib.Path:
    """The folder of the built site."""
    pytest.importorskip("mkdocs")
    folder = tmp_path_factory.mktemp("site")
    command = (sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d", folder)
    subprocess.run(command, cwd=ROOT, check=True, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"})
    return folder


@pytest.mark.slow
@pytest.mark.skipif(not CHROMIUM, reason="needs Chromium")
@pytest.mark.parametrize("width", [1400, 390])
def test_pages_fit_the_window_and_show_their_pictures(site, tmp_path, width):
    with Browser(tmp_path / "profile") as browser:
        browser.resize(width, 900)
        for page in PAGES:
            browser.open(site / f"{page}.html")
            assert browser.run("document.documentElement.scrollWidth") <= width, page
            browser.run("document.querySelectorAll('img').forEach((image) => { image.loading = 'eager'; })")
            browser.wait_for("[...document.querySelectorAll('.md-content img')].every((image) => image.naturalWidth)")
            assert not browser.errors, page
            picture = browser.run("(document.querySelector('picture:has(source[media*=width]) img') ?? {}).currentSrc")
            assert picture is None or ("-narrow" in picture) == (width < 700), page
