"""The tables of levels in docs/tracks.md and docs/tracks_v2.md; `python tests/test_tracks_page.py` rewrites them."""

from __future__ import annotations

import pathlib
import re

import pytest

from mazebench.tasks.tracks import TRACKS, tracks_of
from mazebench.tasks.tracks.base import LEVELS, Track

DOCS = pathlib.Path(__file__).parent.parent / "docs"
PAGES = {"v3": DOCS / "tracks.md", "v2": DOCS / "tracks_v2.md"}
DERIVED_TABLE = re.compile(r"\| track \| level \| what is imperfect \|.*\n(?:\|.*\n)+")


def derived_table(benchmark: str) -> str:
    """Returns a row for each track and level of a benchmark."""
    lines = [
        "| track | level | what is imperfect | N | M | distances | time limit |\n",
        "|---|---|---|---|---|---|---|\n",
    ]
    for name in tracks_of(benchmark):
        track = TRACKS[name]
        for level in LEVELS:
            size, distances = track.sizes[level - 1], track.distances(level)
            lines.append(
                f"| `{name}` | {level} | {track.levels[level - 1]} | {size} | {track.context_size([level], size)} | "
                f"{distances[0]} to {distances[-1]} | {time_limit(track, level)} |\n"
            )
    return "".join(lines)


def time_limit(track: Track, level: int) -> str:
    """Returns the limit, or that of the nearest and the farthest goals."""
    distances = track.distances(level)
    limits = sorted({track.time_limit(level, distance) for distance in distances})
    spare = limits[0] - 6 * distances[0]
    return str(limits[0]) if len(limits) == 1 else f"{limits[0]} to {limits[-1]}: 6 a cell and {spare}"


@pytest.mark.parametrize("benchmark", PAGES)
def test_the_table_of_levels_follows_from_the_code(benchmark):
    page = PAGES[benchmark].read_text(encoding="utf-8")
    assert derived_table(benchmark) in page, "python tests/test_tracks_page.py rewrites it"


if __name__ == "__main__":
    for benchmark, page in PAGES.items():
        text = page.read_text(encoding="utf-8")
        page.write_text(DERIVED_TABLE.sub(lambda _: derived_table(benchmark), text), encoding="utf-8")  # noqa: B023
