"""The options of a task."""

from __future__ import annotations

import dataclasses

from mazebench.errors import InputError
from mazebench.maps.maze import MAX_SIZE
from mazebench.options import option
from mazebench.tasks.perturbations import Perturbations, perturbation_levels
from mazebench.tasks.places import place_text
from mazebench.tasks.sensors import SENSORS
from mazebench.tasks.sensors.base import SensorOptions
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.tracks.base import LEVELS

TASKS = ("local", "hierarchical")
TRAIN_DISTANCES = tuple(range(1, 6))
EVAL_DISTANCES = tuple(range(1, 16))
PAIRS = ("random", "fixed")
ENDS = ("start", "goal")
TIME_LIMIT = 100  # agent steps
_FIRST_LEVEL = LEVELS[:1]


@dataclasses.dataclass(frozen=True, kw_only=True)
class TaskOptions(Perturbations, SensorOptions):
    """What is played, except the mazes.

    Raises:
      InputError: if an option is not allowed.
    """

    task: str = option("local", "Kind of navigation.", choices=TASKS)
    track: str | None = option(
        None, "A named way in which the map or the senses are imperfect (local task).", choices=TRACKS
    )
    level: tuple[int, ...] = option(
        _FIRST_LEVEL,
        f"Level of the track, {LEVELS[0]} to {LEVELS[-1]} (`mazebench list` says what they mean); of several levels, "
        "not in an evaluation, each episode draws one.",
        lowest=LEVELS[0],
        highest=LEVELS[-1],
    )
    distances: tuple[int, ...] = option(
        TRAIN_DISTANCES,
        "Distances between start and goal in cells (local task); on the benchmark's eval mazes, 1 to 15 by default; "
        "on maps of your own, as far as they reach; a track has its own default.",
        lowest=1,
    )
    start: str | None = option(
        None,
        "Where every episode begins, instead of a drawn cell, or of the upper right corner (hierarchical task): a cell "
        "'row,column', in Python also (row, column), or a point '1.5m,2.5m' (x, y) from the map's lower left corner.",
    )
    goal: str | None = option(
        None, "Where every episode leads, as for start; instead of a drawn cell, or of the lower left corner."
    )
    pairs: str = option(
        "random",
        "random: a new start and goal in each episode; fixed: one pair in each maze, the paper's extremely-low-data "
        "regime (local task).",
        choices=PAIRS,
    )
    time_limit: int = option(
        0,
        "Agent steps to the goal, in the hierarchical task to each landmark; 0 stands for 100, or more where a map, a "
        "start or a goal of your own needs them; a track has its own.",
        lowest=0,
    )
    landmark_distance: int = option(
        5, "Cells between landmarks, along a shortest path on the shown map (hierarchical task).", lowest=1
    )
    context_size: int = option(
        0,
        "M, the cells on a side of the context's planes, at least 3; 0 stands for min(N, 21); a track has its own.",
        lowest=0,
        highest=MAX_SIZE,
    )
    num_goals: int = option(
        1,
        "Goals of an episode, one after the other without a reset (local task, random pairs); rewards and success are "
        "those of the last one.",
        lowest=1,
    )
    continuous: bool = option(False, "Actions are velocities (forward, left, turn) instead of one of six.")
    sensors: tuple[str, ...] = option(
        (), "Sensors that are observed besides the state and the context.", choices=SENSORS
    )

    def __post_init__(self) -> None:
        for name in ENDS:
            object.__setattr__(self, name, place_text(name, getattr(self, name)))
        super().__post_init__()
        if len(set(self.sensors)) < len(self.sensors):
            raise InputError(f"expected each sensor once, found {', '.join(self.sensors)}")
        if len(set(self.level)) < len(self.level):
            raise InputError(f"expected each level once, found {', '.join(map(str, self.level))}")
        if self.num_goals > 1 and (self.task != "local" or self.pairs != "random"):
            raise InputError(
                f"expected num_goals 1 unless the task is local and pairs are random, found {self.num_goals}"
            )
        if self.ends_given and self.pairs == "fixed":
            raise InputError("expected pairs 'random' beside a start or a goal, found 'fixed', pairs of their own")
        if self.goal is not None and self.num_goals > 1:
            raise InputError(f"expected num_goals 1 beside a goal, found {self.num_goals}")
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

    def _check_track(self, name: str) -> None:
        """Raises `InputError` if an option contradicts the track called `name`."""
        if self.time_limit not in (0, TIME_LIMIT):
            raise InputError(f"track {name!r}: has its own time limit, found time_limit {self.time_limit}")
        for option_name, value in {
            "task": "local",
            "pairs": "random",
            "num_goals": 1,
            "start": None,
            "goal": None,
        }.items():
            found = getattr(self, option_name)
            if found != value:
                raise InputError(f"track {name!r}: expected {option_name} {value!r}, found {found!r}")
        for perturbation, strength in perturbation_levels(self).items():
            if strength:
                raise InputError(f"track {name!r}: expected no perturbation, found {perturbation} {strength}")
        for sensor in TRACKS[name].refused_sensors:
            if sensor in self.sensors:
                raise InputError(f"track {name!r}: expected sensors without {sensor!r}, which shows where the body is")
