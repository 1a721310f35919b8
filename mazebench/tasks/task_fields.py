"""The fields of a task: each with its type, range, default and help, in one place."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, TypedDict

from annotated_types import Ge, Interval
from pydantic import BeforeValidator, InstanceOf

from mazebench.constants import DISCRETE, VELOCITIES
from mazebench.errors import InputError
from mazebench.maps.benchmark import ALL_SPLITS
from mazebench.maps.kinds import CHECK, KNOWN, NOVEL
from mazebench.maps.maze import Cell, Maze
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.places import place_text
from mazebench.maps.selection import OwnMazes, maze_as_described
from mazebench.options import Doc, OneOf, options
from mazebench.tasks.context import MAX_CONTEXT_SIZE
from mazebench.tasks.perturbations.flip import FlipShare
from mazebench.tasks.perturbations.noise import PositionDeviation
from mazebench.tasks.perturbations.warp import WarpShare
from mazebench.tasks.sensors import SENSORS
from mazebench.tasks.sensors.sensor import SensorOptions
from mazebench.tasks.tracks import LEVELS, TRACKS

KINDS_OF_TASK = ("local", "hierarchical")
DRAWN_KINDS = (*KNOWN, *CHECK)  # of mazes
HIDEABLE = ("map", "goal")
REWARDS = SPARSE, PROGRESS = "sparse", "progress"
FIRST_LEVEL = LEVELS[:1]
NUM_DRAWN = 20  # mazes of a kind, unless another number is asked for


class TaskOptions(TypedDict, total=False):
    """The options of `Task.of` besides the task's name, for editors; the fields of `Task` say what they mean."""

    size: int | None
    split: str
    mazes: OwnMazes | None
    kinds: str | Sequence[str]
    num_mazes: int
    fresh: bool
    cell_size: float | None
    walls: str
    pixel_size: float | None
    unknown: str
    inflate: float
    area: str | None
    track: str | None
    level: int | Sequence[int]
    distances: int | Sequence[int]
    start: str | Cell | None
    goal: str | Cell | None
    time_limit: int
    landmark_distance: int
    pairs: str
    num_goals: int
    reward: str
    actions: str
    map_flip: float
    map_warp: float
    position_noise: float
    lidar_noise: str | None
    odometry_noise: float | None
    exact_pose: bool
    hide: str | Sequence[str]
    context_size: int
    sensors: str | Sequence[str]
    camera_size: int
    textures: bool


def _refuse_novel(kinds: Sequence[Any]) -> tuple[Any, ...]:
    for kind in kinds:
        if kind in NOVEL:
            raise InputError(f"kind {kind!r}: only the eval split has it; kinds: {', '.join(DRAWN_KINDS)}")
    return tuple(kinds)


def as_mazes(mazes: Any) -> Any:
    """Returns mazes as `Task` keeps them; those of JSON are descriptions."""
    if not isinstance(mazes, list | tuple):
        return mazes
    return tuple(maze_as_described(maze) if isinstance(maze, Mapping) else maze for maze in mazes)


@options
class TaskFields(SensorOptions, ReadOptions):
    """The fields of `Task`, those of sensors and of reading mazes included."""

    # What is played: the mazes, the episodes, the actions.
    task: Annotated[str, OneOf(*KINDS_OF_TASK), Doc("Kind of navigation.")] = "local"
    size: Annotated[
        int,
        Ge(0),
        Doc(
            "Cells a side of the benchmark's mazes: 13, 15, 17, 19 or 21; of drawn mazes, any that their kinds can "
            "make; 0 stands for 13, for 31 on a track, and for that of your own mazes."
        ),
    ] = 0
    split: Annotated[
        str,
        OneOf(*ALL_SPLITS),
        Doc("The benchmark's training mazes, unseen ones to choose agents on (tracks), or those for results."),
    ] = "train"
    mazes: Annotated[
        str | tuple[InstanceOf[Maze], ...] | None,
        BeforeValidator(as_mazes),
        Doc(
            "Mazes of your own: a text, picture, array or ROS map, or a folder of them; or scenarios of MovingAI "
            "(.scen), whose starts and goals are played on the map next to them."
        ),
    ] = None
    kinds: Annotated[
        tuple[Annotated[str, OneOf(*DRAWN_KINDS)], ...],
        BeforeValidator(_refuse_novel),
        Doc(f"Mazes that are drawn, of these kinds, as dfs,house; {DRAWN_KINDS[0]} beside the other two options."),
    ] = ()
    num_mazes: Annotated[int, Ge(0), Doc(f"Drawn mazes of each kind; 0 stands for {NUM_DRAWN}.")] = 0
    fresh: Annotated[bool, Doc("Every episode has a new maze, of one of the kinds (not in an evaluation).")] = False
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
    ] = FIRST_LEVEL
    distances: Annotated[
        tuple[Annotated[int, Ge(1)], ...],
        Doc(
            "Cells from start to goal, as 1-5,8,10 (local task); if none are given, 1-15 in evaluations and in the "
            "benchmark's eval mazes, else 1-5; those of the track; or as far as mazes of your own reach."
        ),
    ] = ()
    start: Annotated[
        str | None,
        BeforeValidator(functools.partial(place_text, "start")),
        Doc(
            "Where every episode begins, instead of a drawn cell, or of the upper right corner (hierarchical task): a "
            "cell 'row,column', in Python also (row, column), or a point '1.5m,2.5m' (x, y) from the map's lower left "
            "corner."
        ),
    ] = None
    goal: Annotated[
        str | None,
        BeforeValidator(functools.partial(place_text, "goal")),
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
            "Goals of an episode, one after the other without a reset (local task, random pairs); rewards and success "
            "are those of the last one."
        ),
    ] = 1
    reward: Annotated[
        str,
        OneOf(*REWARDS),
        Doc(
            "sparse: -1 for each step, 0 for the one that reaches the goal; progress: that and the cells by which the "
            "step made the way to the goal shorter, for training, with the same best policies (one goal)."
        ),
    ] = SPARSE
    actions: Annotated[
        str,
        OneOf(*DISCRETE, *VELOCITIES),
        Doc(
            "six: one of the benchmark's six; velocity: (forward, left, turn), each from -1 to 1; of a robot that "
            "can't strafe, four: one of the six without strafing, and diff: (v, omega), forward and turn. An agent "
            "that doesn't play six has its own."
        ),
    ] = "six"

    # What is shown: what is wrong with the map and the senses, and what an agent may ask for or is not told.
    map_flip: FlipShare = 0.0
    map_warp: WarpShare = 0.0
    position_noise: PositionDeviation = 0.0
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
    hide: Annotated[
        tuple[Annotated[str, OneOf(*HIDEABLE)], ...],
        Doc(
            "What the context does not show: map makes planes 0 and 1 zero, goal plane 2 (local task, one goal). "
            "Results without the map say what the map is worth."
        ),
    ] = ()
    sensors: Annotated[
        tuple[Annotated[str, OneOf(*SENSORS)], ...],
        Doc("Sensors that are observed besides the state and the context."),
    ] = ()
    context_size: Annotated[
        int,
        Interval(ge=0, le=MAX_CONTEXT_SIZE),
        Doc(
            "M, the cells on a side of the context's planes, at least 3; 0 stands for min(N, 21); a track has its own."
        ),
    ] = 0
