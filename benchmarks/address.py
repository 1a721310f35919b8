"""Writes where the project lives into the files that say so: `python -m benchmarks.address`.

The address of the repository is `Source` in the table `project.urls` of pyproject.toml, and is written by hand nowhere
else. Without one, the files name none. README.md gets the citation of CITATION.cff, too, as BibTeX.
"""

from __future__ import annotations

import pathlib
import re
import tomllib
from collections.abc import Iterator

import yaml

ROOT = pathlib.Path(__file__).parent.parent
CITATION, NOTEBOOK = "CITATION.cff", "docs/examples/first_hour.ipynb"
FILES = ("README.md", "docs/start.md", "docs/leaderboard.md", CITATION, NOTEBOOK)
_BLOCK = re.compile(r"(<!-- address: (\w+) -->\n).*?(<!-- end of address -->\n)", re.DOTALL)


def address() -> str:
    """Returns the address of the repository; empty without one."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return project["urls"].get("Source", "")


def with_address(name: str, text: str, address: str) -> str:
    """Returns the text of the file `name` with an address in its places."""
    if name == CITATION:
        text = re.sub(r"^repository-code: .*\n", "", text, flags=re.MULTILINE)
        return text.replace("license:", f"repository-code: {address}\nlicense:", 1) if address else text
    if name == NOTEBOOK:
        return re.sub(r'(?<=\bADDRESS = \\")[^"\\]*', lambda _: address, text, count=1)
    blocks = {
        "clone": f"```sh\ngit clone {address} mazebench\ncd mazebench\n```\n" if address else "",
        "send": f"The repository is [{address}]({address}).\n" if address else "",
        "bibtex": bibtex(address),
    }
    return _BLOCK.sub(lambda block: block[1] + blocks[block[2]] + block[3], text)


def bibtex(address: str) -> str:
    """Returns how to cite the program, in a block of Markdown."""
    citation = yaml.safe_load((ROOT / CITATION).read_text(encoding="utf-8"))
    authors = " and ".join(f"{{{author['name']}}}" for author in citation["authors"])
    fields = {"title": citation["title"], "author": authors, "version": citation["version"], "year": "2026"}
    fields |= {"url": address} if address else {}
    lines = "".join(f"  {name:7} = {{{value}}},\n" for name, value in fields.items())
    return f"```bibtex\n@software{{mazebench,\n{lines}}}\n```\n"


def written() -> Iterator[tuple[pathlib.Path, str]]:
    """Yields the files that name the address, each with the text that it should have."""
    for name in FILES:
        yield ROOT / name, with_address(name, (ROOT / name).read_text(encoding="utf-8"), address())


if __name__ == "__main__":
    for path, text in written():
        path.write_bytes(text.encode())
