"""The tracks: named ways in which the map or the senses are imperfect, as data."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from mazebench.maps.maze import Maze
from mazebench.tasks.perturbations.hand_drawing import HandDrawnMap
from mazebench.tasks.perturbations.moved_doors import MovedDoors
from mazebench.tasks.perturbations.moving_doors import MovingDoors
from mazebench.tasks.perturbations.odometry import LostPose, MotionNoise
from mazebench.tasks.perturbations.perturbation import Of, Perturbation
from mazebench.tasks.perturbations.turned_map import HiddenStart, TurnedMap
from mazebench.tasks.streams import ADRIFT, BUILDING, DOORS, REBUILT, ROUGH

LEVELS = (1, 2, 3)
STANDING = BUILDING, REBUILT, ADRIFT, ROUGH  # the tracks of the suite `tracks`, whose buildings stand still
DISTANCES = tuple(range(15, 41))  # m between start and goal
MAX_CELL_SIZE = 1.0  # m; doors of 0.9 m would vanish in larger cells


def cells_of(distance: int, cell_size: float, track: str | None) -> int:
    """Returns a distance of the option `distances` in cells of `cell_size` m; on a track, it is in metres."""
    return distance if track is None else round(distance / cell_size)


def distance_of(cells: int, cell_size: float, track: str | None) -> int:
    """Returns a number of cells as the option `distances` counts it: in metres on a track, else in cells."""
    return cells if track is None else round(cells * cell_size)


@dataclasses.dataclass(frozen=True)
class Level:
    """One setting of a track."""

    meaning: str  # what is imperfect, in words
    perturbations: tuple[Perturbation, ...] = ()  # in the order in which they apply

    def of(self, *things: Of) -> tuple[Perturbation, ...]:
        """Returns the perturbations that are of some things."""
        return tuple(each for each in self.perturbations if each.of in things)


@dataclasses.dataclass(frozen=True)
class Track:
    """A named way in which the map or the senses are imperfect.

    A track is played as the local task, in mazes of 31 x 31 cells of several kinds, or in buildings of one's own. It
    offers the sensor `lidar`, that of a TurtleBot3, unless others are named. Its mazes, distances, context size and
    time limit are fixed, so that results of one track and level can be compared. Lengths are in metres.
    """

    help: str  # in one line
    levels: tuple[Level, Level, Level]

    @property
    def hides_pose(self) -> bool:
        """True if the observed pose is odometry, which does not tell where the body is."""
        return any(each.hides_pose for level in self.levels for each in level.perturbations)

    @property
    def pixels_per_cell(self) -> int:
        """Pixels of the shown map per cell of the maze, along each axis."""
        return max((each.pixels_per_cell for level in self.levels for each in level.perturbations), default=1)

    @property
    def differs_in_building(self) -> bool:
        """True if its levels differ in nothing but the building."""
        return len({level.of(Of.MAP, Of.SENSES, Of.DOORS) for level in self.levels}) == 1

    @property
    def moves_doors(self) -> bool:
        """True if doors close and open while one drives."""
        return any(level.of(Of.DOORS) for level in self.levels)

    def require(self, maze: Maze, levels: Sequence[int]) -> None:
        """Raises `InputError` if the track can't be played in `maze`."""
        for level in levels:
            for perturbation in self.levels[level - 1].perturbations:
                perturbation.require(maze)


TRACKS = {
    BUILDING: Track(
        "The map is right, but may be turned or mirrored.",
        (
            Level("the map lies as the building does"),
            Level(
                "the map is turned by an unknown number of quarter turns; the start is unknown: planes 1 and 3 of the "
                "context are zero",
                (TurnedMap(turns=True), HiddenStart()),
            ),
            Level(
                "as at level 2, and the map is mirrored with probability .5",
                (TurnedMap(turns=True, mirrors=True), HiddenStart()),
            ),
        ),
    ),
    REBUILT: Track(
        "Doors have moved since the map was drawn.",
        (
            Level("doors have moved: .45 of the shortest paths on the map are blocked", (MovedDoors(percent=45),)),
            Level("doors have moved: .7 of the shortest paths on the map are blocked", (MovedDoors(percent=70),)),
            Level("doors have moved: .85 of the shortest paths on the map are blocked", (MovedDoors(percent=85),)),
        ),
    ),
    ADRIFT: Track(
        "Doors have moved since the map was drawn, and the robot only has odometry: its place on the map is unknown.",
        (
            Level(
                "doors have moved: .7 of the shortest paths on the map are blocked; the start is marked, the heading "
                "is unknown",
                (MovedDoors(percent=70), MotionNoise(0.01), LostPose()),
            ),
            Level(
                "the same doors have moved as at level 1; start and heading are unknown: planes 1 and 3 of the "
                "context are zero",
                (MovedDoors(percent=70), MotionNoise(0.05), LostPose(), HiddenStart()),
            ),
            Level(
                "doors have moved: .85 of the shortest paths on the map are blocked; start and heading are unknown; "
                "the odometry drifts: its scale is off by up to 10 %, and its heading walks at random, by 2 degrees "
                "per root second",
                (MovedDoors(percent=85), MotionNoise(0.2), LostPose(drifts=True), HiddenStart()),
            ),
        ),
    ),
    ROUGH: Track(
        "The map is drawn by hand, doors have moved since, and the pose is odometry.",
        (
            Level(
                "the map is bent by up to 0.5 m; doors have moved: .45 of the shortest paths on it are blocked; the "
                "start is marked, the heading is unknown",
                (MovedDoors(percent=45), HandDrawnMap(bend=0.5), MotionNoise(0.01), LostPose()),
            ),
            Level(
                "the map is bent by up to 1 m; .7 of the shortest paths on it are blocked; start and heading are "
                "unknown",
                (MovedDoors(percent=70), HandDrawnMap(bend=1.0), MotionNoise(0.05), LostPose(), HiddenStart()),
            ),
            Level(
                "the map is bent by up to 1.5 m, and mirrored with probability .5; .7 of the shortest paths on it are "
                "blocked; start and heading are unknown; the odometry drifts as on adrift 3",
                (
                    MovedDoors(percent=70),
                    HandDrawnMap(bend=1.5),
                    TurnedMap(mirrors=True),
                    MotionNoise(0.2),
                    LostPose(drifts=True),
                    HiddenStart(),
                ),
            ),
        ),
    ),
    DOORS: Track(
        "The map is right, and doors close and open while one drives.",
        (
            Level(
                "a door on the shortest path, and up to two others, close and stay closed",
                (MovingDoors(opens=False),),
            ),
            Level(
                "a door on the shortest path, and up to two others, close, open again, and repeat this",
                (MovingDoors(opens=True),),
            ),
            Level(
                "all doors that are open at first, up to 26, close and open, each in a period of its own",
                (MovingDoors(opens=True, all_doors=True),),
            ),
        ),
    ),
}
