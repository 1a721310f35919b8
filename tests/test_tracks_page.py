"""The table of levels in docs/tracks.md; `python tests/test_tracks_page.py` rewrites it."""

from __future__ import annotations

import pathlib
import re

from mazebench.maps.benchmark import KINDS_SIZE
from mazebench.tasks.time_limit import track_time_limit
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.tracks.track import DISTANCES, LEVELS

PAGE = pathlib.Path(__file__).parent.parent / "docs" / "tracks.md"
DERIVED_TABLE = re.compile(r"\| track \| level \| what is imperfect \|.*\n(?:\|.*\n)+")


def derived_table() -> str:
    """Returns a row for each track and level."""
    lines = [
        "| track | level | what is imperfect | N | M | distances | time limit |\n",
        "|---|---|---|---|---|---|---|\n",
    ]
    nearest, farthest = DISTANCES[0], DISTANCES[-1]
    for name, track in TRACKS.items():
        limits = track_time_limit(name, nearest), track_time_limit(name, farthest)
        time_limit = f"{limits[0]} to {limits[1]}: 6 a cell and {limits[0] - 6 * nearest}"
        for level in LEVELS:
            lines.append(
                f"| `{name}` | {level} | {track.levels[level - 1]} | {KINDS_SIZE} | "
                f"{track.pixels_per_cell * KINDS_SIZE} | {nearest} to {farthest} | {time_limit} |\n"
            )
    return "".join(lines)


def test_the_table_of_levels_follows_from_the_code():
    assert derived_table() in PAGE.read_text(encoding="utf-8"), "python tests/test_tracks_page.py rewrites it"


if __name__ == "__main__":
    PAGE.write_text(DERIVED_TABLE.sub(lambda _: derived_table(), PAGE.read_text(encoding="utf-8")), encoding="utf-8")
