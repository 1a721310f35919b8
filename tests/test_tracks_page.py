"""The table of levels in docs/tracks.md; `python tests/test_tracks_page.py` rewrites it."""

from __future__ import annotations

import pathlib
import re

from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.tracks.base import LEVELS, Track

PAGE = pathlib.Path(__file__).parent.parent / "docs" / "tracks.md"
DERIVED_TABLE = re.compile(r"\| track \| level \| what is imperfect \|.*\n(?:\|.*\n)+")


def derived_table() -> str:
    """Returns a row for each track and level."""
    lines = [
        "| track | level | what is imperfect | N | M | distances | time limit |\n",
        "|---|---|---|---|---|---|---|\n",
    ]
    for name, track in TRACKS.items():
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
    return str(limits[0]) if len(limits) == 1 else f"{limits[0]} to {limits[-1]}: 6 a cell and 50"


def test_the_table_of_levels_follows_from_the_code():
    assert derived_table() in PAGE.read_text(encoding="utf-8"), "python tests/test_tracks_page.py rewrites it"


def test_the_time_limit_of_far_is_6_steps_a_cell_and_50():
    far = TRACKS["far"]
    assert all(far.time_limit(level, cells) == 6 * cells + 50 for level in LEVELS for cells in far.distances(level))


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(DERIVED_TABLE.sub(lambda _: derived_table(), text), encoding="utf-8")
