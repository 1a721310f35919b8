"""The options of a task."""

from __future__ import annotations

import functools
from typing import Annotated

from annotated_types import Ge, Interval
from pydantic import BeforeValidator

from mazebench.errors import InputError
from mazebench.maps.maze import MAX_SIZE, Cell, Maze, corner_cells
from mazebench.maps.options import MazeOptions
from mazebench.options import Doc, OneOf, options
from mazebench.tasks.perturbations import Perturbations, perturbation_levels
from mazebench.tasks.sensors import SENSORS
from mazebench.tasks.sensors.base import SensorOptions
from mazebench.tasks.start_goal import cell_of_end, end_text
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.tracks.base import LEVELS

TASKS = ("local", "hierarchical")
TRAIN_DISTANCES = tuple(range(1, 6))
EVAL_DISTANCES = tuple(range(1, 16))
ENDS = ("start", "goal")
TIME_LIMIT = 100  # agent steps
_FIRST_LEVEL = LEVELS[:1]
_LIDAR = "lidar"  # the sensor that every track offers

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
    """What is played, except the mazes.

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
            "benchmark's eval mazes, else 1-5; those of the track; or as far as maps of your own reach."
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

    def __post_init__(self) -> None:
        if len(set(self.sensors)) < len(self.sensors):
            raise InputError(f"expected each sensor once, found {', '.join(self.sensors)}")
        if len(set(self.level)) < len(self.level):
            raise InputError(f"expected each level once, found {', '.join(map(str, self.level))}")
        if not self.level:
            raise InputError("expected at least one level, found none")
        if self.track is not None:
            self._check_track(self.track)
        elif self.level != _FIRST_LEVEL:
            levels = ", ".join(map(str, self.level))
            raise InputError(f"level {levels}: expected a track beside it, found none; tracks: {', '.join(TRACKS)}")

    @property
    def ends_given(self) -> int:
        """How many of start and goal are given."""
        return (self.start is not None) + (self.goal is not None)

    @property
    def observed_sensors(self) -> tuple[str, ...]:
        """The sensors that are observed: those that were chosen and, on a track, the lidar."""
        if self.track is None or _LIDAR in self.sensors:
            return self.sensors
        return (_LIDAR, *self.sensors)

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

    def _check_track(self, name: str) -> None:
        """Raises `InputError` if an option contradicts the track called `name`."""
        if self.time_limit not in (0, TIME_LIMIT):
            raise InputError(f"track {name!r}: has its own time limit, found time_limit {self.time_limit}")
        for option_name, value in {"task": "local", "start": None, "goal": None}.items():
            found = getattr(self, option_name)
            if found != value:
                raise InputError(f"track {name!r}: expected {option_name} {value!r}, found {found!r}")
        for perturbation, strength in perturbation_levels(self).items():
            if strength:
                raise InputError(f"track {name!r}: expected no perturbation, found {perturbation} {strength}")
        for sensor in TRACKS[name].refused_sensors:
            if sensor in self.sensors:
                raise InputError(f"track {name!r}: expected sensors without {sensor!r}, which shows where the body is")


def is_own(task: TaskOptions, mazes: MazeOptions) -> bool:
    """Returns whether mazes, start or goal are not the benchmark's."""
    return mazes.maps is not None or task.ends_given > 0


@options
class Variants:
    """What environments offer beyond the protocol of evaluations."""

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
    """What an environment plays."""

    task: TaskOptions = TaskOptions()
    mazes: MazeOptions = MazeOptions()
    variants: Variants = Variants()
