"""The tracks: one file a track, and the table of all of them."""

from __future__ import annotations

from mazebench.tasks.tracks.base import Track
from mazebench.tasks.tracks.far import Far
from mazebench.tasks.tracks.lost import Lost
from mazebench.tasks.tracks.sketch import Sketch
from mazebench.tasks.tracks.stale import Stale

TRACKS: dict[str, Track] = {
    "stale": Stale(),
    "lost": Lost(),
    "sketch": Sketch(),
    "far": Far(),
}
