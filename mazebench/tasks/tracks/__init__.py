"""The tracks: one file per track, and the table of all of them."""

from __future__ import annotations

from mazebench.constants import TRACK_NAMES
from mazebench.tasks.tracks.adrift import Adrift
from mazebench.tasks.tracks.building import Building
from mazebench.tasks.tracks.rebuilt import Rebuilt
from mazebench.tasks.tracks.rough import Rough
from mazebench.tasks.tracks.track import Track

TRACKS: dict[str, Track] = dict(zip(TRACK_NAMES, (Building(), Rebuilt(), Adrift(), Rough()), strict=True))
