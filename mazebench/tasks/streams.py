"""Names and numbers that are frozen with the benchmark: the tracks, and the random streams of an episode.

This module imports no library, for `import mazebench` registers an environment for each track.
"""

from __future__ import annotations

import enum

# The tracks, which `mazebench.tasks.tracks` describes.
TRACK_NAMES = BUILDING, REBUILT, ADRIFT, ROUGH, DOORS = "building", "rebuilt", "adrift", "rough", "doors"


@enum.unique
class Stream(enum.IntEnum):
    """The streams, by which one thing that is drawn does not change another one.

    Their numbers are frozen with the benchmark; a new one takes 17, 18, ... 5, 7, 8 and 12 stay unused.
    """

    MAP_FLIP = 0
    MAP_WARP = 1
    POSITION_NOISE = 2
    LATER_GOALS = 3  # those after the first one
    LEVEL = 4  # of the track, where a task has several
    LOST_POSE = 6
    MOVED_DOORS = 9
    TURNED_SHEET = 10
    DRAWN_SHEET = 11
    LIDAR_NOISE = 13
    MOTION_NOISE = 14
    PICTURE_NOISE = 15
    DOORS = 16  # which of them move while one drives, and when
