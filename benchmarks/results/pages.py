"""The pages with tables of results. A page holds a table between two lines, the first of which names it:

<!-- table: NAME -->
<!-- end of table -->
"""

from __future__ import annotations

import pathlib
import re

from benchmarks.results.kept import Kept
from benchmarks.results.tables import make_table
from mazebench.errors import InputError

ROOT = pathlib.Path(__file__).parent.parent.parent
RECORDS = ROOT / "records"
PAGES = ("README.md", "docs/results.md", "docs/tracks.md", "docs/agents/navigator.md", "docs/agents/belief-planner.md")

_BLOCK = re.compile(r"(<!-- table: (.+?) -->\n).*?(<!-- end of table -->\n)", re.DOTALL)


def with_tables(text: str, kept: Kept) -> str:
    """Returns a page with its tables made anew.

    Raises:
      InputError: if a table is unknown, or the page has none.
    """
    text, count = _BLOCK.subn(lambda block: block[1] + make_table(kept, block[2]) + block[3], text)
    if not count:
        raise InputError("expected a page with tables of results, found none")
    return text
