"""The documents: what they link to exists, their code runs, their commands are those of the command line."""

from __future__ import annotations

import functools
import importlib.util
import pathlib
import re
import sys
import unicodedata

import numpy as np
import pytest
import typer
from pages import PAGES, ROOT, Block, blocks, name_of, read
from processes import run_python

from mazebench import cli
from mazebench.maps.kinds import generate
from mazebench.maps.pictures import draw_maze, write_image
from mazebench.maps.readers.ros import write_ros_map
from mazebench.maps.text import write_text_maze

EVERY_PAGE = pytest.mark.parametrize("page", PAGES, ids=name_of)
COMMANDS = typer.main.get_command(cli.app).commands
# Quick, and without a checkpoint.
PLAIN_AGENTS = {"random", "planner", "planner-closed-loop"}


class TestLinks:
    @EVERY_PAGE
    def test_links_lead_to_files(self, page):
        assert [link for link in links(page) if not (page.parent / link.partition("#")[0]).exists()] == []

    @EVERY_PAGE
    def test_anchors_are_headings(self, page):
        for link in links(page):
            path, _, anchor = link.partition("#")
            target = page.parent / path if path else page
            assert not anchor or anchor in anchors(target), f"{link}: there are {sorted(anchors(target))}"

    def test_pages_when_looked_for_in_the_overview(self):
        folder = ROOT / "docs"
        pages = {page for page in PAGES if folder in page.parents and page.parent.name != "reference"}
        linked = {folder / link for link in links(folder / "index.md")}
        assert pages - linked == {folder / "index.md"}


def links(page: pathlib.Path) -> list[str]:
    """The targets of its links and pictures that are not addresses."""
    return [link for link in re.findall(r"\]\(([^)\s]+)\)", prose(page)) if "://" not in link]


def prose(page: pathlib.Path) -> str:
    """Its text without the fenced blocks."""
    return re.sub(r"^```.*?^```$", "", read(page), flags=re.MULTILINE | re.DOTALL)


def anchors(page: pathlib.Path) -> set[str]:
    """The anchors of its headings; where the site and the repository's browser make different ones, none."""
    headings = [heading.replace("`", "") for heading in re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE)]
    in_browser = {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
    plain = [unicodedata.normalize("NFKD", heading).encode("ascii", "ignore").decode() for heading in headings]
    on_site = {re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading).strip().lower()) for heading in plain}
    return in_browser & on_site


class TestCommands:
    """Every command shown is one that the command line takes; the quick ones are run below, with the code."""

    @EVERY_PAGE
    def test_blocks_when_run_as_commands(self, page):
        for command in page_commands(page):
            check_command(command)

    @EVERY_PAGE
    def test_commands_in_sentences_when_looked_up(self, page):
        for text in re.findall(r"`mazebench ([a-z][^`]*)`", prose(page)):
            name, *words = text.replace("[", " ").replace("]", " ").split()
            known = {
                option for parameter in COMMANDS[name].params for option in parameter.opts + parameter.secondary_opts
            }
            assert {word for word in words if word.startswith("--")} <= known, text


def page_commands(page: pathlib.Path) -> list[list[str]]:
    """All commands in its blocks; of blocks that may hold something else, the lines that are mazebench's."""
    commands = []
    for block in blocks(page):
        if block.language == "sh":
            commands += block.commands()
        elif block.language == "":
            lines = "\n".join(line for line in block.text.splitlines() if line.startswith("mazebench "))
            commands += Block("sh", lines, "").commands()
    return commands


def check_command(command: list[str]) -> None:
    """Fails where a command can't be what a reader should type: no such program, module, file, option or value."""
    program, *arguments = command
    if program == "mazebench":
        COMMANDS[arguments[0]].make_context(arguments[0], arguments[1:])
    elif program == "make":
        targets = re.findall(r"^([\w-]+):", read(ROOT / "Makefile"), re.MULTILINE)
        assert set(arguments) <= set(targets), command
    elif program == "python" and arguments[0] == "-m":
        assert importlib.util.find_spec(arguments[1]), command
    elif program == "python":
        assert (ROOT / arguments[0]).exists(), command


class TestRun:
    @pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)], ids=name_of)
    def test_blocks_of_a_page_when_run_in_order(self, page, reader):
        printed = ""
        for block in blocks(page):
            if block.is_output and printed:
                assert block.text in printed
            elif not block.is_run:
                printed = ""
            elif block.file_name:
                pathlib.Path(block.file_name).write_text(block.text, encoding="utf-8")
            elif block.language == "python":
                printed = reader.runs_code(block.text)
            elif block.language == "sh":
                printed = "".join(map(reader.runs_command, block.commands()))


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
    known = set(sys.modules)
    yield Reader(monkeypatch, capsys)
    for name in set(sys.modules) - known:
        if getattr(sys.modules[name], "__file__", None) and str(tmp_path) in sys.modules[name].__file__:
            del sys.modules[name]  # what a page calls my_agent.py is another file on another page


class Reader:
    """Runs what a page shows, in this process; gives what is printed."""

    def __init__(self, monkeypatch, capsys):
        self._monkeypatch, self._capsys = monkeypatch, capsys
        self._names: dict[str, object] = {}

    def runs_code(self, code: str) -> str:
        exec(compile(code, "page", "exec"), self._names)
        return self._capsys.readouterr().out

    def runs_command(self, command: list[str]) -> str:
        arguments = shortened(command)
        if arguments is None:
            return ""
        if arguments[0] == "render":  # in a process of its own, because MuJoCo takes its backend when it is imported
            return run_python("-m", "mazebench", *arguments, variables={"MUJOCO_GL": "egl"}).stdout if renders() else ""
        self._monkeypatch.setattr(sys, "argv", ["mazebench", *arguments])
        with pytest.raises(SystemExit) as caught:
            cli.main()
        printed = self._capsys.readouterr()
        assert caught.value.code == 0, printed.err
        return printed.out


def shortened(command: list[str]) -> list[str] | None:
    """The arguments of a mazebench command that takes a second or so, cut down where it would take more, else None."""
    program, *arguments = command
    if program != "mazebench":
        return None
    kind, *options = arguments
    if kind in ("list", "generate"):
        return arguments
    if kind == "collect":
        return [*arguments, "--episodes", "2"]
    if kind in ("compare", "report"):
        folders = [option for option in options if not option.startswith("--")]
        return arguments if pathlib.Path(folders[0]).exists() else None
    if kind == "render":
        is_short = {"--start", "--goal"} <= set(options) or "--split" in options
        near = () if is_short else ("--distances", "3")
        return [*arguments, "--pixels", "64", *near]
    if kind == "eval" and "--suite" not in options:
        agent = options[options.index("--agent") + 1]
        if agent in PLAIN_AGENTS or pathlib.Path(f"{agent.partition(':')[0]}.py").exists():
            few = ("--distances", "1,2", "--episodes-per-distance", "1")
            return arguments if {"hierarchical", "--track", "--out", "--goal"} & set(options) else [*arguments, *few]
    return None


@functools.cache
def renders() -> bool:
    probe = "import mujoco; mujoco.GLContext(64, 64).free()"
    return run_python("-c", probe, status=None, variables={"MUJOCO_GL": "egl"}).returncode == 0
