"""The pages with tables of results. A page holds a table between two lines, the first of which names it:

<!-- table: NAME -->
<!-- end of table -->
"""

from __future__ import annotations

import pathlib
import re

from benchmarks.results.kept import Kept
from benchmarks.results.results_tables import SATURATED, make_table
from mazebench.errors import InputError

ROOT = pathlib.Path(__file__).parent.parent.parent
RECORDS = ROOT / "records"
PAGES = (
    "README.md",
    "docs/results.md",
    "docs/results_full.md",
    "docs/tracks.md",
    "docs/baselines.md",
    "docs/agents/mmn.md",
    "docs/agents/neural_planner.md",
    "docs/experiments.md",
)

_BEGIN, _END = "<!-- table: ", "<!-- end of table -->"
_BLOCK = re.compile(rf"({_BEGIN}([^\n]+) -->\n)(?:\|[^\n]*\n)*(?:\n{re.escape(SATURATED)}[^\n]*\n)?({_END}\n)")


def with_tables(text: str, kept: Kept) -> str:
    """Returns a page with its tables made anew.

    Raises:
      InputError: if a table is unknown, there is none, or there is more than a table between the two lines.
    """
    text, count = _BLOCK.subn(lambda block: block[1] + make_table(kept, block[2]) + block[3], text)
    if not count or not count == text.count(_BEGIN) == text.count(_END):
        raise InputError(f"expected tables between the lines {_BEGIN}NAME --> and {_END}, found {count} such tables")
    return text
