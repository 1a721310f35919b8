"""The tracks: one file a track, and the table of all of them."""

from __future__ import annotations

from mazebench.tasks.tracks.adrift import Adrift
from mazebench.tasks.tracks.base import Track
from mazebench.tasks.tracks.building import Building
from mazebench.tasks.tracks.far import Far
from mazebench.tasks.tracks.lost import Lost
from mazebench.tasks.tracks.rebuilt import Rebuilt
from mazebench.tasks.tracks.rough import Rough
from mazebench.tasks.tracks.sketch import Sketch
from mazebench.tasks.tracks.stale import Stale

TRACKS: dict[str, Track] = {
    "building": Building(),
    "rebuilt": Rebuilt(),
    "adrift": Adrift(),
    "rough": Rough(),
    "stale": Stale(),
    "lost": Lost(),
    "sketch": Sketch(),
    "far": Far(),
}


def tracks_of(benchmark: str) -> tuple[str, ...]:
    """Returns the names of a benchmark's tracks, as those of "v2"."""
    return tuple(name for name, track in TRACKS.items() if track.benchmark == benchmark)
