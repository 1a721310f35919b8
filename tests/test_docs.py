"""The pages: their code and commands run in order and print what they show. `make docs` checks the links of docs."""

from __future__ import annotations

import importlib.util
import json
import pathlib
import re
import shlex
import subprocess
import sys
import unittest
from collections.abc import Iterator

import numpy as np
import pytest
import typer
import yaml
from sybil import Document, Example, Region
from sybil.evaluators.python import PythonEvaluator
from sybil.parsers.markdown import SkipParser
from sybil.parsers.markdown.lexers import FencedCodeBlockLexer

import mazebench
from benchmarks import address
from mazebench import cli
from mazebench.maps.kinds import generate
from mazebench.maps.pictures import draw_maze, write_image
from mazebench.maps.readers.ros import write_ros_map
from mazebench.maps.text import write_text_maze

ROOT = pathlib.Path(__file__).parent.parent
PAGES = [page.relative_to(ROOT).as_posix() for page in sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])]
COMMANDS = typer.main.get_command(cli.app).commands
PLAIN_AGENTS = {"random", "planner", "planner-closed-loop"}  # quick, and without a checkpoint
FENCE = FencedCodeBlockLexer(r"\w*")
RUN = pytest.mark.parametrize("page", [page for page in PAGES if re.search("^```", (ROOT / page).read_text(), re.M)])


@pytest.mark.parametrize("page", [page for page in PAGES if "/" not in page])
def test_links_of_pages_outside_the_site_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)\s:]+)\)", (ROOT / page).read_text(encoding="utf-8")):
        path, _, anchor = link.partition("#")
        headings = re.findall(r"^#+ (.+)$", (ROOT / (path or page)).read_text(encoding="utf-8"), re.M) if anchor else []
        slugs = {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
        assert (ROOT / path).exists(), link
        assert not anchor or anchor in slugs, link


@pytest.mark.parametrize("page", PAGES)
def test_commands_are_those_of_the_command_line(page):
    document = Document.parse(str(ROOT / page))
    for region in FENCE(document):
        if region.lexemes["language"] in ("sh", ""):
            for program, *words in commands(region.lexemes["source"]):
                if program == "mazebench":
                    COMMANDS[words[0]].make_context(words[0], words[1:])
                elif region.lexemes["language"] == "sh" and program == "make":
                    assert all(f"\n{target}:" in (ROOT / "Makefile").read_text() for target in words)
                elif region.lexemes["language"] == "sh" and program == "python":
                    assert importlib.util.find_spec(words[1]) if words[0] == "-m" else (ROOT / words[0]).exists()
    for name, words in re.findall(r"`mazebench ([a-z][a-z-]*)([^`]*)`", document.text):
        options = {option for each in COMMANDS[name].params for option in each.opts + each.secondary_opts}
        assert set(re.findall(r"--[\w-]+", words)) <= options, words


def commands(text: str) -> Iterator[list[str]]:
    """Yields the commands of some shell lines, word by word."""
    for line in text.replace("\\\n", " ").splitlines():
        for command in line.split(" && "):
            if words := shlex.split(command, comments=True):
                yield words


@RUN
def test_a_page_can_be_followed(page, reader):
    for example in Document.parse(str(ROOT / page), SkipParser(), reader.parse):
        try:
            example.evaluate()
        except unittest.SkipTest:
            reader.printed = ""


@pytest.fixture
def reader(tmp_path, monkeypatch, capsys):
    """Somebody who follows a page in a folder of their own, where some mazes lie."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    maze = generate("dfs", 9, np.random.default_rng(0))
    write_image(draw_maze(maze), "plan.png")
    write_image(draw_maze(maze, 50), "office.png")
    pathlib.Path("plans").mkdir()
    write_text_maze(maze, "plans/plan.txt")
    write_ros_map(maze, "map.yaml")
    write_ros_map(generate("house", 31, np.random.default_rng(0)), "plan.yaml")
    known = set(sys.modules)
    yield Reader(monkeypatch, capsys)
    for name in set(sys.modules) - known:
        if str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]  # what a page calls my_agent.py is another file on another page


class Reader:
    """Runs the blocks of a page in this process."""

    def __init__(self, monkeypatch, capsys):
        self._monkeypatch, self._capsys = monkeypatch, capsys
        self.printed = ""  # by the block before

    def parse(self, document: Document) -> Iterator[Region]:
        """Yields the fenced blocks, each with the last line before it."""
        for region in FENCE(document):
            region.parsed = region.lexemes["source"]
            region.lexemes["before"] = document.text[: region.start].rstrip().rpartition("\n")[2]
            region.evaluator = self.run
            yield region

    def run(self, example: Example) -> None:
        """Runs a block, or compares it with what the one before printed."""
        language, before, text = example.region.lexemes["language"], example.region.lexemes["before"], example.parsed
        if language == "text" and before == "```":
            assert not self.printed or text in self.printed
        elif re.fullmatch(r"`[\w.]+`", before):
            pathlib.Path(before.strip("`")).write_text(text, encoding="utf-8")
        elif language == "python":
            PythonEvaluator()(example)
            self.printed = self._capsys.readouterr().out
        elif language == "sh":
            self.printed = "".join(map(self._run_command, commands(text)))

    def _run_command(self, command: list[str]) -> str:
        arguments = shortened(command)
        if arguments is None:
            return ""
        self._monkeypatch.setattr(sys, "argv", ["mazebench", *arguments])
        with pytest.raises(SystemExit) as caught:
            cli.main()
        printed = self._capsys.readouterr()
        assert caught.value.code == 0, printed.err
        return printed.out


def shortened(command: list[str]) -> list[str] | None:
    """The arguments of a mazebench command that takes a second or so, cut down where it would take more, else None."""
    program, kind, *options = [*command, ""]
    if program != "mazebench":
        return None
    arguments = command[1:]
    if kind in ("list", "generate"):
        return arguments
    if kind == "collect":
        return [*arguments, "--episodes", "2"]
    if kind == "render" and "--results" in options:
        return [*arguments, "--view", "map"]  # renders nothing
    if kind in ("compare", "report"):
        return arguments if pathlib.Path(options[0]).exists() else None
    if kind == "eval" and "--suite" not in options:
        agent = options[options.index("--agent") + 1]
        if agent in PLAIN_AGENTS or pathlib.Path(f"{agent.partition(':')[0]}.py").exists():
            if "--track" in options:
                return [*arguments, "--distances", "15"]
            few = ("--distances", "1,2", "--episodes-per-distance", "1")
            return arguments if {"hierarchical", "--out", "--goal"} & set(options) else [*arguments, *few]
    return None


@pytest.mark.parametrize("diff", sorted(ROOT.glob("docs/examples/extend/*.diff")), ids=lambda path: path.stem)
def test_a_diff_of_the_page_on_extending_fits_the_code(diff):
    run = subprocess.run(["git", "apply", "--check", diff], text=True, cwd=ROOT, capture_output=True)
    assert run.returncode == 0, run.stderr


def test_change_log_and_citation_name_the_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    version, date = re.search(r"^## (\S+), (.+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.M).groups()
    assert version == mazebench.__version__ == citation["version"]
    assert date == str(citation.get("date-released", "unreleased"))


def test_files_have_the_address_of_pyproject_and_the_citation():
    for path, text in address.written():
        assert path.read_text(encoding="utf-8") == text, "`python -m benchmarks.address` writes them"


def test_an_address_is_written_wherever_one_belongs_and_can_be_taken_away():
    for name in address.FILES:
        now = (ROOT / name).read_text(encoding="utf-8")
        text = address.with_address(name, now, "https://example.org/mazebench")
        assert "https://example.org/mazebench" in text
        assert address.with_address(name, text, address.address()) == now
        if name == address.CITATION:
            assert yaml.safe_load(text)["repository-code"] == "https://example.org/mazebench"
        if name == address.NOTEBOOK:
            assert 'ADDRESS = "https://example.org/mazebench"' in json.loads(text)["cells"][1]["source"][4]
