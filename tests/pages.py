"""The documents as tests read them: their fenced blocks, in order."""

from __future__ import annotations

import dataclasses
import pathlib
import re
import shlex

ROOT = pathlib.Path(__file__).parent.parent
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])

# A block that can't be run says why in a comment before it, which no reader of the rendered page sees.
_NOT_RUN = re.compile(r"<!-- not run: .+ -->")
_FILE_NAME = re.compile(r"`([\w.]+)`")


@dataclasses.dataclass(frozen=True)
class Block:
    """A fenced block."""

    language: str  # "" where the fence has none
    text: str
    before: str  # the last line before it that is not empty; "```" behind another block

    @property
    def is_run(self) -> bool:
        """True unless a comment before it says why it can't be run."""
        return not _NOT_RUN.fullmatch(self.before)

    @property
    def file_name(self) -> str | None:
        """The file that it shows: a line of its own before the block names it."""
        found = _FILE_NAME.fullmatch(self.before)
        return found[1] if found else None

    @property
    def is_output(self) -> bool:
        """True if it shows the output of the block right before it."""
        return self.language == "text" and self.before == "```"

    def commands(self) -> list[list[str]]:
        """The commands of a block of shell lines, word by word."""
        commands: list[list[str]] = []
        for line in self.text.replace("\\\n", " ").splitlines():
            commands.append([])
            for word in shlex.split(line, comments=True):
                if word == "&&":
                    commands.append([])
                else:
                    commands[-1].append(word)
        return [command for command in commands if command]


def name_of(page: pathlib.Path) -> str:
    """Relative to the repository."""
    return page.relative_to(ROOT).as_posix()


def read(page: pathlib.Path) -> str:
    """Its text."""
    return page.read_text(encoding="utf-8")


def blocks(page: pathlib.Path) -> list[Block]:
    """Its fenced blocks in order."""
    found: list[Block] = []
    before, inside = "", None
    for line in read(page).splitlines():
        if inside is None and line.startswith("```"):
            inside = (line.removeprefix("```"), before, [])
        elif inside is not None and line == "```":
            found.append(Block(inside[0], "".join(f"{each}\n" for each in inside[2]), inside[1]))
            inside, before = None, line
        elif inside is not None:
            inside[2].append(line)
        elif line.strip():
            before = line
    assert inside is None, f"{name_of(page)}: a fence is not closed"
    return found
