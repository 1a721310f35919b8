"""The options of a task: what was asked, in plain values, each with its type, range, default and help in one place."""

from __future__ import annotations

import dataclasses
import functools
import pathlib
from collections.abc import Mapping
from typing import Annotated, Any, Self

from annotated_types import Ge, Interval

from mazebench.constants import DISCRETE, VELOCITIES
from mazebench.errors import InputError, one_line
from mazebench.maps.benchmark import (
    ALL_SPLITS,
    DEV,
    DOORS_BENCHMARK,
    FROZEN_SPLITS,
    GOALS_BENCHMARK,
    KINDS_SIZE,
    PAPER_BENCHMARK,
    REAL_BENCHMARK,
    TRACKS_BENCHMARK,
)
from mazebench.maps.kinds import CHECK, KNOWN, NOVEL
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.places import place_text
from mazebench.maps.real_buildings import building_of, is_real, is_setting
from mazebench.maps.selection import described_maze, maze_as_described, own_mazes, texts_of
from mazebench.options import Doc, OneOf, ReadBy, as_tuple, fields_of, options_in
from mazebench.tasks.context import MAX_CONTEXT_SIZE
from mazebench.tasks.perturbations import OF_OPTION
from mazebench.tasks.perturbations.flip_warp_noise import PERTURBATIONS, FlipShare, PositionDeviation, WarpShare
from mazebench.tasks.perturbations.odometry import OdometryNoise
from mazebench.tasks.sensors import CHOICES_OF_SENSORS, LIDAR, NOISE_OF_SENSORS, SENSORS, AllSensorOptions
from mazebench.tasks.streams import ADRIFT, BUILDING
from mazebench.tasks.tracks import LEVELS, TRACKS
from mazebench.world.bodies import BODIES, SLIDER, Body
from mazebench.world.bodies.described import body_of
from mazebench.world.bodies.described import to_json as described_body
from mazebench.world.looks import PICTURES

LOCAL, HIERARCHICAL = "local", "hierarchical"
TASK_NAMES = (LOCAL, HIERARCHICAL, *TRACKS)
DRAWN_KINDS = (*KNOWN, *CHECK)  # of mazes
HIDEABLE = ("map", "goal")
REWARDS = SPARSE, PROGRESS = "sparse", "progress"
ENDS = ("start", "goal")
CUSTOM = "custom"  # the split in results of mazes, a start or a goal that are not the benchmark's
MOST_GOALS = 5  # of an episode on a track, all of which its shown map keeps free
NUM_DRAWN = 20  # mazes of a kind, unless another number is asked for
MIN_CONTEXT_SIZE = 3

_NOISE = (*NOISE_OF_SENSORS, *(name for name in OF_OPTION if name not in PERTURBATIONS))


def _as_mazes(mazes: Any) -> Any:
    """Returns the path of mazes as text, and mazes that JSON describes as mazes."""
    if isinstance(mazes, pathlib.Path):
        return str(mazes)
    if not isinstance(mazes, list | tuple):
        return mazes
    return tuple(maze_as_described(maze) if isinstance(maze, Mapping) else maze for maze in mazes)


@dataclasses.dataclass(frozen=True, kw_only=True)
class TaskOptions(AllSensorOptions, ReadOptions):
    """The options of a task: what was asked. None is open; `Task` fills it.

        >>> options = mazebench.Task.of("rebuilt", level=2).options
        >>> options.task, options.level, options.size
        ('rebuilt', (2,), 31)

    Raises:
      InputError: if an option is not allowed, or options contradict each other.
    """

    # What is played: the mazes, the episodes, the actions.
    task: Annotated[
        str,
        OneOf(*TASK_NAMES),
        Doc("Kind of navigation; or a track, a named way in which the map or the senses are imperfect."),
    ] = LOCAL
    size: Annotated[
        int | None,
        Ge(1),
        Doc(
            "Cells a side of the benchmark's mazes: 13, 15, 17, 19 or 21; of generated mazes, any that their kinds can "
            "make. If not given, 13, on a track 31, and that of your own mazes."
        ),
    ] = None
    split: Annotated[
        str | None,
        OneOf(*ALL_SPLITS),
        Doc(
            "train: to learn in. dev: to choose agents by, on tracks. eval: for results. If not given, train in an "
            "environment; in an evaluation dev on tracks, else eval."
        ),
    ] = None
    mazes: Annotated[
        Any,
        ReadBy(_as_mazes),
        Doc("Mazes of your own: a text, picture, array or ROS map, or a folder of them. real:NAME is a real building."),
    ] = None
    shown: Annotated[
        Any,
        ReadBy(_as_mazes),
        Doc(
            "An older map of your own mazes, which is shown instead of them: what mazes takes, one for all or as many. "
            "ROS maps are laid on each other by their origins; others must have one size."
        ),
    ] = None
    align: Annotated[
        bool,
        Doc(
            "Turns and moves the older map of shown to where its walls and its free space fit those of mazes, instead "
            "of laying it by its origin. Refused where no place is better than chance."
        ),
    ] = False
    kinds: Annotated[
        tuple[Annotated[str, OneOf(*DRAWN_KINDS)], ...],
        Doc(
            "Generated mazes of these kinds, as dfs,house, in the place of the frozen ones. With num_mazes or fresh "
            f"alone, the kind is {DRAWN_KINDS[0]}."
        ),
    ] = ()
    num_mazes: Annotated[int | None, Ge(1), Doc(f"Generated mazes of each kind; {NUM_DRAWN} if not given.")] = None
    fresh: Annotated[
        bool | None,
        Doc(
            "Every episode has a new maze, of one of the kinds (not in an evaluation). If not given, no, but in a "
            f"training on a track yes, of the kinds {', '.join(KNOWN)}, unless mazes or num_mazes are given."
        ),
    ] = None
    level: Annotated[
        tuple[Annotated[int, Interval(ge=LEVELS[0], le=LEVELS[-1])], ...] | None,
        Doc(
            f"Level of the track, {LEVELS[0]} to {LEVELS[-1]} (see `mazebench list`); {LEVELS[0]} if not given. "
            "Outside evaluations, several levels may be given, of which each episode draws one."
        ),
    ] = None
    distances: Annotated[
        tuple[Annotated[int, Ge(1)], ...] | None,
        Doc(
            "Cells from start to goal, as 1-5,8,10; metres on a track (not in the hierarchical task). If not given: "
            "15-40 on a track, and 1-40 to train there; in the local task 1-5 for training and 1-15 for evaluation; in "
            "mazes of your own as far as they reach."
        ),
    ] = None
    start: Annotated[
        str | None,
        ReadBy(functools.partial(place_text, "start")),
        Doc(
            "Where every episode begins, instead of a random cell, or of the upper right corner (hierarchical task): a "
            "cell 'row,column', in Python also (row, column), or a point '1.5m,2.5m' (x, y) from the map's lower left "
            "corner."
        ),
    ] = None
    goal: Annotated[
        str | None,
        ReadBy(functools.partial(place_text, "goal")),
        Doc("Where every episode leads, as for start; instead of a random cell, or of the lower left corner."),
    ] = None
    time_limit: Annotated[
        int | None,
        Ge(1),
        Doc(
            "Agent steps to the goal, in the hierarchical task to each landmark; if not given, 100, or more where a "
            "map, a start or a goal of your own needs them; a track has its own."
        ),
    ] = None
    landmark_distance: Annotated[
        int, Ge(1), Doc("Cells between landmarks, along a shortest path on the shown map (hierarchical task).")
    ] = 5
    pairs: Annotated[
        str,
        OneOf("random", "fixed"),
        Doc(
            "random: a new start and goal in each episode; fixed: one pair in each maze, the paper's "
            "extremely-low-data regime (local task)."
        ),
    ] = "random"
    num_goals: Annotated[
        int,
        Ge(1),
        Doc(
            "Goals of an episode, one after the other without a reset: in the local task with random pairs, and at "
            f"most {MOST_GOALS} on building, rebuilt and doors. Rewards and success are those of the last one."
        ),
    ] = 1
    reward: Annotated[
        str,
        OneOf(*REWARDS),
        Doc(
            "sparse: -1 per step, 0 for the step that reaches the goal. progress: adds the decrease of the path length "
            "to the goal in cells, which leaves the optimal policy unchanged; for training, with one goal."
        ),
    ] = SPARSE
    actions: Annotated[
        str | None,
        OneOf(*DISCRETE, *VELOCITIES),
        Doc(
            "six: one of the benchmark's six; velocity: (forward, left, turn), each from -1 to 1; of a robot that "
            "can't strafe, four: one of the six without strafing, and diff: (v, omega), forward and turn. If not "
            "given, six, or those of an agent that doesn't play six."
        ),
    ] = None

    body: Annotated[
        Any,
        ReadBy(body_of),
        Doc(
            f"The body that is driven: {', '.join(BODIES)}, or the path of a YAML file that describes one of your own."
        ),
    ] = SLIDER.name

    # What is shown: what is wrong with the map and the senses, and what an agent may ask for or is not told.
    map_flip: FlipShare = 0.0
    map_warp: WarpShare = 0.0
    position_noise: PositionDeviation = 0.0
    odometry_noise: OdometryNoise = None
    exact_pose: Annotated[
        bool, Doc("On a track whose pose is odometry, observes the true pose instead, as a reference.")
    ] = False
    hide: Annotated[
        tuple[Annotated[str, OneOf(*HIDEABLE)], ...],
        Doc(
            "What the context does not show: map makes planes 0 and 1 zero, goal plane 2 (local task, one goal). "
            "The map worth is measured with it."
        ),
    ] = ()
    sensors: Annotated[
        tuple[Annotated[str, OneOf(*SENSORS)], ...],
        Doc("Sensors that are observed besides the state and the context; on a track the lidar, if none are named."),
    ] = ()
    context_size: Annotated[
        int | None,
        Interval(ge=MIN_CONTEXT_SIZE, le=MAX_CONTEXT_SIZE),
        Doc("M, the cells on a side of the context's planes; min(N, 21) if not given; a track has its own."),
    ] = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "kinds", as_tuple(self.kinds))
        for kind in self.kinds:
            if kind in NOVEL:
                raise InputError(f"kind {kind!r}: only the eval split has it; kinds: {', '.join(DRAWN_KINDS)}")
        super().__post_init__()
        has_both = self.mazes is not None and self.shown is not None
        if has_both and isinstance(self.shown, str) != isinstance(self.mazes, str):
            raise InputError("shown, an older map: expected a path beside the path of mazes, else values, as mazes are")
        if self.mazes is not None and not isinstance(self.mazes, str):
            if has_both:
                object.__setattr__(self, "shown", texts_of(self.shown, self.mazes, self.reading, self.align))
            object.__setattr__(self, "mazes", own_mazes(self.mazes, self.reading))
        object.__setattr__(self, "hide", tuple(sorted(self.hide, key=HIDEABLE.index)))
        if self.track is not None and not self.sensors:
            object.__setattr__(self, "sensors", (LIDAR,))
        if is_real(self.mazes) and not is_setting(self.mazes):
            building = building_of(self.mazes)
            for name, of_building in (("split", building.split), ("cell_size", float(building.cell_size))):
                if (found := getattr(self, name)) not in (None, of_building):
                    raise InputError(f"mazes {self.mazes}: expected {name} {of_building}, found {found}")
            object.__setattr__(self, "split", building.split)
        self._check()

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Self:
        """Returns the options of which `to_json` returned the content.

        Raises:
          InputError: if there is no such option, or a value is not allowed.
        """
        return cls.of(content)

    def to_json(self) -> dict[str, Any]:
        """Returns the options by name, in values that JSON has; without those that are open, or as evaluations are."""
        changed = self.changed()
        left = {name for name in ("reward", "body", "align", *CHOICES_OF_SENSORS) if name not in changed}
        values = {name: value for name, value in vars(self).items() if value is not None and name not in left}
        if self.mazes is not None:  # a path may have bytes that JSON has not
            own = self.mazes
            values["mazes"] = one_line(own) if isinstance(own, str) else [described_maze(maze) for maze in own]
        if isinstance(self.shown, str):
            values["shown"] = one_line(self.shown)
        if "body" in values:
            values["body"] = described_body(self.body)
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}

    # What they mean.

    @property
    def reading(self) -> ReadOptions:
        """The options of reading mazes; a start or a goal chooses the area, unless it is given."""
        values = {name: getattr(self, name) for name in fields_of(ReadOptions)}
        return ReadOptions(**values | {"area": self.area or self.start or self.goal})

    @property
    def driven_body(self) -> Body:
        """The body that is driven."""
        return self.body if isinstance(self.body, Body) else BODIES[self.body]

    @property
    def track(self) -> str | None:
        """The name of the track; None in the local and the hierarchical task."""
        return self.task if self.task in TRACKS else None

    @property
    def track_level(self) -> int:
        """The level of the track, in an evaluation, which has one; 0 without a track."""
        return 0 if self.track is None else (self.level or LEVELS)[0]

    @property
    def is_hierarchical(self) -> bool:
        """True if the agent is sent from landmark to landmark."""
        return self.task == HIERARCHICAL

    @property
    def is_drawn(self) -> bool:
        """True if mazes are drawn, of some kinds."""
        return bool(self.kinds or self.num_mazes or self.fresh)

    @property
    def num_ends(self) -> int:
        """The number of given ends: start and goal."""
        return (self.start is not None) + (self.goal is not None)

    @property
    def has_own(self) -> bool:
        """True if mazes, start or goal are a user's own."""
        return self.mazes is not None or self.num_ends > 0

    @property
    def is_frozen_building(self) -> bool:
        """True if the frozen episodes of a real building are played: with the right map, or with its own older one."""
        is_right = self.track == BUILDING or (self.track == ADRIFT and self.shown is not None)
        return is_right and is_real(self.mazes) and not self.num_ends

    @property
    def split_in_results(self) -> str:
        """The split as records and summaries have it."""
        is_custom = self.is_drawn or (self.has_own and not self.is_frozen_building)
        return CUSTOM if is_custom else self.split or "train"

    @property
    def frozen_split(self) -> str | None:
        """The split of the benchmark whose frozen episodes are evaluated; None for other mazes."""
        return self.split_in_results if self.split_in_results in FROZEN_SPLITS else None

    @property
    def benchmark(self) -> str:
        """The benchmark that the task belongs to."""
        if self.track is None:
            return PAPER_BENCHMARK
        if self.is_frozen_building:
            return REAL_BENCHMARK
        if TRACKS[self.track].moves_doors:
            return DOORS_BENCHMARK
        return TRACKS_BENCHMARK if self.num_goals == 1 else GOALS_BENCHMARK

    @property
    def perturbations(self) -> dict[str, float]:
        """The strengths of all perturbations by name, in the order in which they apply."""
        return {name: getattr(self, name) for name in PERTURBATIONS}

    @property
    def active_perturbations(self) -> tuple[tuple[str, float], ...]:
        """The perturbations that are switched on, with their strengths."""
        return tuple((name, strength) for name, strength in self.perturbations.items() if strength)

    @property
    def is_exact(self) -> bool:
        """True if nothing is wrong with the map and the observed states."""
        return self.track is None and not self.active_perturbations

    @property
    def noise(self) -> dict[str, Any]:
        """The noise on the senses that a user set, by option."""
        values = {name: getattr(self, name) for name in _NOISE}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def look_split(self) -> str:
        """The split whose patterns and exposures pictures have; eval's are of the benchmark's own mazes alone."""
        is_own = self.mazes is not None and not is_real(self.mazes)
        return DEV if is_own and self.split == "eval" else self.split or "train"

    # Which options go together.

    def _check(self) -> None:
        """Raises `InputError` if options contradict each other."""
        for name in ("sensors", "level", "kinds", "hide"):
            values = getattr(self, name) or ()
            if len(set(values)) < len(values):
                raise InputError(f"expected each {name.rstrip('s')} once, found {', '.join(map(str, values))}")
        for name in ("level", "distances"):
            if getattr(self, name) == ():
                raise InputError(f"expected at least one {name.rstrip('s')}, found none")

        # Mazes.
        if self.fresh and self.num_mazes:
            raise InputError(f"expected no num_mazes beside fresh, found {self.num_mazes}")
        if self.is_drawn and self.mazes is not None:
            raise InputError("expected mazes of your own or mazes that are drawn, found both")
        if self.shown is not None and self.mazes is None:
            raise InputError("shown, an older map: expected mazes of your own beside it, found none")
        if self.align and self.shown is None:
            raise InputError("align: expected shown, an older map, beside it, found none")
        if self.is_drawn and self.split == "eval":
            raise InputError("mazes that are drawn: expected split 'train' or 'dev', found 'eval'")
        for name, found in options_in(self.changed(), ReadOptions).items():
            if self.mazes is None and (name, found) != ("cell_size", 1):
                raise InputError(f"expected mazes of your own with {name}, found none")
            if is_real(self.mazes) and name != "cell_size":
                raise InputError(f"mazes {self.mazes}: expected no {name}, found {found}")
        if self.shown is not None and is_real(self.mazes) != is_real(self.shown):
            raise InputError(f"expected mazes and shown of one kind, found {self.mazes} and {self.shown}"[:200])

        # Episodes.
        if self.num_goals > 1:
            task = LOCAL if self.is_hierarchical else self.task  # or a track
            self._require(f"num_goals {self.num_goals}", task=task, pairs="random", goal=None, reward=SPARSE)
        if self.num_ends:
            self._require("a start or a goal", pairs="random")
        if self.odometry_noise:
            self._require(f"odometry_noise {self.odometry_noise:g}", position_noise=0.0, exact_pose=False)
        if self.hide:
            self._check_hidden()

        # Tracks.
        if self.track is not None:
            self._check_track()
        elif self.exact_pose:
            raise InputError("exact_pose: expected a track whose pose is odometry beside it, found none")
        elif self.level is not None:
            raise InputError(
                f"level {','.join(map(str, self.level))}: expected a track beside it, found none; "
                f"tracks: {', '.join(TRACKS)}"
            )

    def _require(self, beside: str, **wanted: Any) -> None:
        """Raises `InputError` unless some options have the only values that go with what is `beside` them."""
        for name, value in wanted.items():
            if (found := getattr(self, name)) != value:
                raise InputError(f"{beside}: expected {name} {value!r}, found {found!r}")

    def _check_hidden(self) -> None:
        """Raises `InputError` if another option would tell what is hidden."""
        hidden = f"hide {','.join(self.hide)}"
        if self.is_hierarchical:
            raise InputError(f"{hidden}: expected the task 'local' or a track, found {self.task!r}")
        self._require(hidden, num_goals=1)
        cameras = [name for name in self.sensors if name in PICTURES]
        if cameras and "goal" in self.hide:
            raise InputError(f"{hidden}: expected sensors without {cameras[0]!r}, which shows where the goal is")

    def _check_track(self) -> None:
        """Raises `InputError` if an option contradicts the track."""
        track, beside = TRACKS[self.task], f"track {self.task!r}"
        if self.mazes is None and not self.is_drawn and self.size not in (None, KINDS_SIZE):
            raise InputError(f"{beside}: expected size {KINDS_SIZE}, found {self.size}")
        if self.shown is not None and track.differs_in_building and self.level not in (None, LEVELS[:1]):
            raise InputError(
                f"{beside}: expected level 1 beside shown, an older map, for the other levels differ in doors only, "
                f"found {','.join(map(str, self.level))}"
            )
        if self.time_limit is not None:
            raise InputError(f"{beside}: has its own time limit, found time_limit {self.time_limit}")
        self._require(beside, start=None, goal=None, pairs="random", **dict.fromkeys(PERTURBATIONS, 0.0))
        if self.num_goals > (most := 1 if track.hides_pose else MOST_GOALS):
            raise InputError(f"{beside}: expected num_goals of at most {most}, found {self.num_goals}")
        if self.exact_pose and not track.hides_pose:
            raise InputError(f"{beside}: expected no exact_pose, for the pose is exact; it belongs to lost poses")
