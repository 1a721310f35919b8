"""The options of a task."""

from __future__ import annotations

import functools
from typing import Annotated

from annotated_types import Ge, Interval
from pydantic import BeforeValidator

from mazebench.errors import InputError
from mazebench.maps.maze import MAX_SIZE, Cell, Maze, corner_cells
from mazebench.maps.maze_options import MazeOptions
from mazebench.options import Doc, OneOf, options
from mazebench.tasks.perturbations import Perturbations, perturbation_levels
from mazebench.tasks.sensors import SENSORS
from mazebench.tasks.sensors.sensor import SensorOptions
from mazebench.tasks.start_goal import cell_of_end, end_text
from mazebench.tasks.time_limit import track_time_limit
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.tracks.track import LEVELS
from mazebench.world.ray_casting import TURTLEBOT3, LidarModel

TASKS = ("local", "hierarchical")
TRAIN_DISTANCES = tuple(range(1, 6))
EVAL_DISTANCES = tuple(range(1, 16))
ENDS = ("start", "goal")
HIDEABLE = ("map", "goal")
_FIRST_LEVEL = LEVELS[:1]
_LIDAR = "lidar"  # the sensor that every track offers
_SHOWING_POSE = ("top", "chase")  # the sensors that show where the body is

Pairs = Annotated[
    str,
    OneOf("random", "fixed"),
    Doc(
        "random: a new start and goal in each episode; fixed: one pair in each maze, the paper's extremely-low-data "
        "regime (local task)."
    ),
]


@options
class TaskOptions(Perturbations, SensorOptions):
    """Options of a task, except the mazes.

    Raises:
      InputError: if an option is not allowed.
    """

    task: Annotated[str, OneOf(*TASKS), Doc("Kind of navigation.")] = "local"
    track: Annotated[
        str | None,
        OneOf(*TRACKS),
        Doc("A named way in which the map or the senses are imperfect (local task)."),
    ] = None
    level: Annotated[
        tuple[Annotated[int, Interval(ge=LEVELS[0], le=LEVELS[-1])], ...],
        Doc(
            f"Level of the track, {LEVELS[0]} to {LEVELS[-1]} (`mazebench list` says what they mean); of several "
            "levels, not in an evaluation, each episode draws one."
        ),
    ] = _FIRST_LEVEL
    distances: Annotated[
        tuple[Annotated[int, Ge(1)], ...],
        Doc(
            "Cells from start to goal, as 1-5,8,10 (local task); if none are given, 1-15 in evaluations and in the "
            "benchmark's eval mazes, else 1-5; those of the track; or as far as mazes of your own reach."
        ),
    ] = ()
    start: Annotated[
        str | None,
        BeforeValidator(functools.partial(end_text, "start")),
        Doc(
            "Where every episode begins, instead of a drawn cell, or of the upper right corner (hierarchical task): a "
            "cell 'row,column', in Python also (row, column), or a point '1.5m,2.5m' (x, y) from the map's lower left "
            "corner."
        ),
    ] = None
    goal: Annotated[
        str | None,
        BeforeValidator(functools.partial(end_text, "goal")),
        Doc("Where every episode leads, as for start; instead of a drawn cell, or of the lower left corner."),
    ] = None
    time_limit: Annotated[
        int,
        Ge(0),
        Doc(
            "Agent steps to the goal, in the hierarchical task to each landmark; 0 stands for 100, or more where a "
            "map, a start or a goal of your own needs them; a track has its own."
        ),
    ] = 0
    landmark_distance: Annotated[
        int, Ge(1), Doc("Cells between landmarks, along a shortest path on the shown map (hierarchical task).")
    ] = 5
    sensors: Annotated[
        tuple[Annotated[str, OneOf(*SENSORS)], ...],
        Doc("Sensors that are observed besides the state and the context."),
    ] = ()
    hide: Annotated[
        tuple[Annotated[str, OneOf(*HIDEABLE)], ...],
        Doc(
            "What the context does not show: map makes planes 0 and 1 zero, goal plane 2 (local task, one goal). "
            "Results without the map say what the map is worth."
        ),
    ] = ()
    odometry_noise: Annotated[
        float | None,
        Interval(ge=0, le=1),
        Doc(
            "alpha of the noise on the observed motion, AMCL's omnidirectional model (.2 is its default): the observed "
            "pose drifts away from the true one; that of the track, or 0, if not given."
        ),
    ] = None
    exact_pose: Annotated[
        bool, Doc("The observed pose is the true one on a track whose pose is odometry, as a reference.")
    ] = False

    def __post_init__(self) -> None:
        if len(set(self.sensors)) < len(self.sensors):
            raise InputError(f"expected each sensor once, found {', '.join(self.sensors)}")
        if len(set(self.level)) < len(self.level):
            raise InputError(f"expected each level once, found {', '.join(map(str, self.level))}")
        if not self.level:
            raise InputError("expected at least one level, found none")
        if self.hide:
            self._check_hidden()
        if self.odometry_noise and (self.position_noise or self.exact_pose):
            beside = "exact_pose" if self.exact_pose else "position_noise"
            raise InputError(f"odometry_noise {self.odometry_noise:g}: expected no {beside} beside it, found it")
        if self.track is not None:
            self._check_track(self.track)
        elif self.exact_pose:
            raise InputError("exact_pose: expected a track whose pose is odometry beside it, found none")
        elif self.level != _FIRST_LEVEL:
            levels = ", ".join(map(str, self.level))
            raise InputError(f"level {levels}: expected a track beside it, found none; tracks: {', '.join(TRACKS)}")

    @property
    def ends_given(self) -> int:
        """The number of given ends: start and goal."""
        return (self.start is not None) + (self.goal is not None)

    @property
    def observed_sensors(self) -> tuple[str, ...]:
        """The sensors that are observed: those that were chosen and, on a track, the lidar."""
        if self.track is None or _LIDAR in self.sensors:
            return self.sensors
        return (_LIDAR, *self.sensors)

    @property
    def lidar(self) -> LidarModel:
        """The model of the sensor `lidar`: as the option says, or the track."""
        return TURTLEBOT3 if self.lidar_noise is None and self.track is not None else super().lidar

    def odometry_noise_at(self, level: int) -> float:
        """Returns alpha of the noise on the observed motion at a level: as the option says, or the track."""
        if self.odometry_noise is not None or self.track is None or self.exact_pose:
            return self.odometry_noise or 0.0
        return TRACKS[self.track].odometry_noise[level - 1]

    def ends(self, maze: Maze) -> tuple[Cell | None, Cell | None]:
        """Returns the start and the goal of all episodes in a maze; None for one that each episode draws.

        Raises:
          InputError: if one is not free.
        """
        given = {name: end for name in ENDS if (end := getattr(self, name)) is not None}
        cells = {name: cell_of_end(name, end, maze) for name, end in given.items()}
        corners = dict(zip(ENDS, corner_cells(maze), strict=True)) if self.task == "hierarchical" else {}
        start, goal = ((corners | cells).get(name) for name in ENDS)
        return start, goal

    def farthest(self, maze: Maze) -> int:
        """Returns the largest distance in cells that start and goal can have in a maze."""
        start, goal = self.ends(maze)
        if start is not None and goal is not None:
            return maze.distance(start, goal)
        given = start or goal
        return maze.diameter if given is None else int(maze.distances(given).max())

    def _check_hidden(self) -> None:
        """Raises `InputError` if something is hidden twice, or another option would tell it."""
        hidden = ",".join(self.hide)
        if len(set(self.hide)) < len(self.hide):
            raise InputError(f"expected each of {', '.join(HIDEABLE)} once to hide, found {hidden}")
        if self.task != "local":
            raise InputError(f"hide {hidden}: expected the task 'local', found {self.task!r}")
        cameras = [name for name in self.sensors if name != _LIDAR]
        telling = cameras if "goal" in self.hide else [name for name in cameras if name != "egocentric"]
        if telling:
            what = "where the goal is" if "goal" in self.hide else "the maze from above"
            raise InputError(f"hide {hidden}: expected sensors without {telling[0]!r}, which shows {what}")

    def _check_track(self, name: str) -> None:
        """Raises `InputError` if an option contradicts the track called `name`."""
        # A summary has the limit of the farthest goals, and its options can be given again.
        longest = track_time_limit(name, max(self.distances)) if self.distances else 0
        if self.time_limit not in (0, longest):
            raise InputError(f"track {name!r}: has its own time limit, found time_limit {self.time_limit}")
        for option_name, value in {"task": "local", "start": None, "goal": None}.items():
            found = getattr(self, option_name)
            if found != value:
                raise InputError(f"track {name!r}: expected {option_name} {value!r}, found {found!r}")
        for perturbation, strength in perturbation_levels(self).items():
            if strength:
                raise InputError(f"track {name!r}: expected no perturbation, found {perturbation} {strength}")
        if self.exact_pose and not TRACKS[name].hides_pose:
            raise InputError(f"track {name!r}: expected no exact_pose, for the pose is exact; it belongs to lost poses")
        for sensor in _SHOWING_POSE if TRACKS[name].hides_pose else ():
            if sensor in self.sensors:
                raise InputError(f"track {name!r}: expected sensors without {sensor!r}, which shows where the body is")


def is_own(task: TaskOptions, mazes: MazeOptions) -> bool:
    """Returns whether mazes, start or goal are not the benchmark's."""
    return mazes.mazes is not None or task.ends_given > 0


@options
class Variants:
    """Options of environments beyond those of evaluations."""

    pairs: Pairs = "random"
    context_size: Annotated[
        int,
        Interval(ge=0, le=MAX_SIZE),
        Doc(
            "M, the cells on a side of the context's planes, at least 3; 0 stands for min(N, 21); a track has its own."
        ),
    ] = 0
    num_goals: Annotated[
        int,
        Ge(1),
        Doc(
            "Goals of an episode, one after the other without a reset (local task, random pairs); rewards and success "
            "are those of the last one."
        ),
    ] = 1
    continuous: Annotated[bool, Doc("Actions are velocities (forward, left, turn) instead of one of six.")] = False


@options
class EnvironmentOptions:
    """Options of an environment."""

    task: TaskOptions = TaskOptions()
    maze_options: MazeOptions = MazeOptions()
    variants: Variants = Variants()

    def __post_init__(self) -> None:
        if self.maze_options.is_drawn and self.maze_options.split == "eval":
            raise InputError("mazes that are drawn: expected split 'train' or 'dev', found 'eval'")
