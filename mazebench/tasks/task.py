"""The task: what is played, and what agents are shown of it, complete when it is constructed."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from mazebench.errors import InputError, remark
from mazebench.maps.benchmark import KINDS_SIZE, SIZES, load_kind_mazes, load_mazes
from mazebench.maps.drawn import FreshMazes, Mazes, draw_mazes
from mazebench.maps.maze import MIN_CELL_SIZE, Cell, Maze, require_one_size
from mazebench.maps.maze_options import THIN_WALLS, ReadOptions
from mazebench.maps.older_map import OlderMap
from mazebench.maps.selection import maps_in_texts
from mazebench.options import check_names, fields_of
from mazebench.tasks.context import MAX_CONTEXT_SIZE, default_context_size
from mazebench.tasks.interface import Interface
from mazebench.tasks.sensors import LIDAR
from mazebench.tasks.task_options import DRAWN_KINDS, ENDS, HIERARCHICAL, LOCAL, NUM_DRAWN, TaskOptions
from mazebench.tasks.time_limit import default_time_limit
from mazebench.tasks.tracks import DISTANCES, LEVELS, MAX_CELL_SIZE, TRACKS, cells_of, distance_of
from mazebench.world.looks import PICTURES

TRAIN_DISTANCES = tuple(range(1, 6))
EVAL_DISTANCES = tuple(range(1, 16))
NOT_IN_EVALUATIONS = ("fresh", "pairs", "reward", "context_size")  # options that they do not vary

NUM_CHANGED = 4  # buildings in which things have changed since a plan of one's own was drawn

_NUM_CHECKED = 10  # of fresh mazes, one of which must have the distances
_FARTHEST_SHARE = 0.9  # of the diameter of a large maze; few pairs of cells are farther apart
_OF_MAZES = ("task", "size", "split", "mazes", "shown", "kinds", "num_mazes", "fresh", *fields_of(ReadOptions))


class World(NamedTuple):
    """The mazes that a task is played in, and the maps that belong to them."""

    mazes: Mazes
    shown: tuple[OlderMap, ...] | None = None  # older maps of the mazes


@dataclasses.dataclass(frozen=True)
class Task:
    """A task: what is played, and what agents are shown of it.

        >>> task = mazebench.Task.of("rebuilt", level=2, split="dev")
        >>> task.name, task.size, len(task.mazes)
        ('rebuilt', 31, 48)

    `Task.of` makes one. `options` say it in plain values and go to JSON; tasks of equal options are equal. `asked` are
    the options as they were given, so that an evaluation or a training can fill what is open in its own way.
    """

    options: TaskOptions  # with what was open filled; what they have is not repeated below
    asked: TaskOptions = dataclasses.field(compare=False, repr=False)
    mazes: Mazes = dataclasses.field(compare=False, repr=False)  # `Episode.maze` is an index into them
    shown: tuple[OlderMap, ...] | None = dataclasses.field(compare=False, repr=False)  # instead of the mazes' own maps
    size: int = dataclasses.field(compare=False)  # N, cells a side of all mazes
    cell_size: float = dataclasses.field(compare=False)  # m, of all mazes
    distances: tuple[int, ...] = dataclasses.field(compare=False)  # cells from start to goal
    levels: tuple[int, ...] = dataclasses.field(compare=False)  # of the track, of which each episode draws one; or none
    context_size: int  # M; of several tracks in one environment, the largest one
    actions: str = dataclasses.field(compare=False)  # "six", "four", "velocity" or "diff"

    @classmethod
    def of(cls, task: str = LOCAL, **options: Any) -> Task:
        """Returns the task that options name.

        Args:
          task: "local", "hierarchical" or the name of a track.
          **options: fields of `TaskOptions` by name, which docs/options.md lists; None stands for the default. `mazes`
            are mazes of your own: a `Maze`, an array as `maze_from_array` takes it, several of these of one size, or
            the path of a file or of a folder of files.

        Raises:
          InputError: if an option is unknown or not allowed, options contradict each other, or a map can't be read.
        """
        return resolve(TaskOptions.of(options, task=task))

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Task:
        """Returns the task of which `to_json` returned the content.

        Raises:
          InputError: as `of`.
        """
        return resolve(TaskOptions.from_json(content))

    def to_json(self) -> dict[str, Any]:
        """Returns the options by name, in values that JSON has."""
        return self.options.to_json()

    def replace(self, **changes: Any) -> Task:
        """Returns the task with other values of some options; the mazes are not read again unless they change."""
        of_mazes = {*_OF_MAZES, "level"} if self.changes_buildings else {*_OF_MAZES}
        read = None if of_mazes & set(changes) else World(self.mazes, self.shown)
        task = resolve(self.options.replace(**changes), read=read)
        return dataclasses.replace(task, context_size=self.context_size) if "context_size" not in changes else task

    def at_distances(self, distances: Sequence[int]) -> Task:
        """Returns the task with goals at other distances (cells, on a track metres); a given time limit stays.

        Raises:
          InputError: if there are no distances, a maze has no cells so far apart, or the task does not draw goals.
        """
        if self.options.is_hierarchical:
            raise InputError(f"expected a task whose goals are drawn at distances, found {self.name!r}")
        return self.replace(distances=(None,) if distances is None else distances)  # None would leave them open

    @property
    def name(self) -> str:
        """The name: "local", "hierarchical" or that of the track."""
        return self.options.task

    @property
    def track(self) -> str | None:
        """The name of the track; None in the local and the hierarchical task."""
        return self.options.track

    @property
    def sensors(self) -> tuple[str, ...]:
        """The names of the sensors that are observed besides the state and the context."""
        return self.options.sensors

    @property
    def fixed_mazes(self) -> tuple[Maze, ...]:
        """The mazes.

        Raises:
          InputError: if every episode has a new one.
        """
        if isinstance(self.mazes, FreshMazes):
            raise InputError("expected a task with a number of mazes, found fresh ones")
        return self.mazes

    @property
    def changes_buildings(self) -> bool:
        """True if the mazes are buildings in which things have changed, made of mazes of one's own."""
        return self.shown is not None and self.options.shown is None

    def joined(self, maze: int) -> np.ndarray | None:
        """Returns `[N, N]` bool: the cells in maze number `maze` that may be start or goal; None for all free ones."""
        return None if self.shown is None else self.shown[maze].joined

    def ends(self, maze: int) -> tuple[Cell | None, Cell | None]:
        """Returns the start and the goal of all episodes in maze number `maze`; None for one that is drawn."""
        return self.options.ends(self.mazes[maze], None if self.shown is None else self.shown[maze])

    @property
    def has_legs(self) -> bool:
        """True if the context may change within an episode: at landmarks, or where one goal follows another."""
        return self.options.is_hierarchical or self.options.num_goals > 1

    @property
    def longest_episode(self) -> int | None:
        """The agent steps that an episode may take; None where they depend on where its legs begin."""
        if self.options.is_hierarchical or (self.track is not None and self.has_legs):
            return None
        time_limit = self.options.time_limit or default_time_limit(
            max(self.distances), self.cell_size, track=self.track
        )
        return self.options.num_goals * time_limit

    def odometry_noise_at(self, level: int) -> float:
        """Returns alpha of the noise on the observed motion at a level: as the option says, or the track."""
        noise = self.options.odometry_noise
        if noise is not None or self.track is None or self.options.exact_pose:
            return noise or 0.0
        return TRACKS[self.track].levels[level - 1].odometry_noise

    @property
    def interface(self) -> Interface:
        """The part of the task that an agent may know: neither the track nor its level."""
        return Interface(
            HIERARCHICAL if self.options.is_hierarchical else LOCAL,
            self.size,
            self.context_size,
            actions=self.actions,
            sensors=self.sensors,
            cell_size=self.cell_size,
            hidden=self.options.hide,
            lidar=self.options.lidar if LIDAR in self.sensors else None,
            camera=self.options.camera if PICTURES.keys() & {*self.sensors} else None,
            odometry_noise=max(map(self.odometry_noise_at, self.levels or LEVELS[:1])),
        )


def resolve(
    asked: TaskOptions,
    *,
    distances: tuple[int, ...] | None = None,
    context_size_of: Callable[[int], int] = default_context_size,
    read: World | None = None,
) -> Task:
    """Returns the task that options name: reads or draws the mazes, fills what is open, and checks all of it.

    Args:
      asked: the options.
      distances: those in the benchmark's mazes if none are asked for; by default 1 to 5, in eval mazes 1 to 15.
      context_size_of: returns M for mazes of N cells a side, where neither the options nor a track say it.
      read: what it is played in, if that has been read already.

    Raises:
      InputError: if a map can't be read, or the task can't be played in a maze.
    """
    mazes, shown = world = read or _read(asked)
    _check_mazes(asked, world)
    size, cell_size = mazes[0].size, mazes[0].cell_size
    split, actions = asked.split or "train", asked.actions or "six"
    level = asked.level or (() if asked.track is None else LEVELS[:1])
    context_size = _context_size(asked, size, context_size_of)

    # The distances that fit the mazes, and a time limit in which goals of one's own are reached.
    by_default = distances or (EVAL_DISTANCES if split == "eval" else TRAIN_DISTANCES)
    fitting = _fitting_distances(asked, world, by_default)
    if asked.num_ends == 2 and asked.distances not in (None, fitting):
        raise InputError(f"start and goal are given; found distances {asked.distances}, which would be ignored")
    chosen = asked.distances or fitting
    time_limit = asked.time_limit
    if asked.track is None and time_limit is None:
        cells = asked.landmark_distance if asked.is_hierarchical else max(chosen)
        is_new = asked.has_own or asked.is_drawn
        time_limit = default_time_limit(cells, cell_size, track=None, is_new=is_new)

    filled = asked.replace(
        size=size,
        cell_size=cell_size,
        split=split,
        level=level or None,
        distances=chosen,
        time_limit=time_limit,
        actions=actions,
        context_size=context_size,
        kinds=asked.kinds or (DRAWN_KINDS[:1] if asked.is_drawn else ()),
        num_mazes=asked.num_mazes or (NUM_DRAWN if asked.is_drawn and not asked.fresh else None),
    )
    _check_distances(filled, world)
    return Task(
        options=filled,
        asked=asked,
        mazes=mazes,
        shown=shown,
        size=size,
        cell_size=cell_size,
        distances=tuple(cells_of(each, cell_size, asked.track) for each in chosen),
        levels=level,
        context_size=context_size,
        actions=actions,
    )


def resolve_in(mazes: Sequence[Maze], asked: TaskOptions) -> Task:
    """Returns the task that options name in mazes of some kinds that were drawn already, whose doors move on tracks.

    Raises:
      InputError: as `resolve`.
    """
    drawn = asked.replace(mazes=None, kinds=(), num_mazes=len(mazes), fresh=False, split=None)
    return resolve(drawn, read=World(tuple(mazes)))


def resolve_for_evaluation(asked: TaskOptions, context_size_of: Callable[[int], int] = default_context_size) -> Task:
    """Returns the task of an evaluation, at distances of 1 to 15 if the options leave them open.

    If they leave the split open, it is dev on tracks and in drawn mazes, and eval in the mazes of the paper's protocol.

    Raises:
      InputError: as `resolve`, and if the options name what evaluations do not vary.
    """
    if asked.fresh:
        raise InputError("expected no fresh mazes in an evaluation; num_mazes says how many of each kind are drawn")
    for name in (*NOT_IN_EVALUATIONS, *["num_goals"] * (asked.track is None)):
        if (found := getattr(asked, name)) != (wanted := fields_of(TaskOptions)[name].default):
            raise InputError(f"expected {name} {wanted!r} in an evaluation, found {found!r}")
    if asked.level is not None and len(asked.level) > 1:
        found = ", ".join(map(str, asked.level))
        raise InputError(f"expected one level in an evaluation, found {found}; the suite 'tracks' has all levels")
    if asked.split is None:
        is_of_tracks = asked.track is not None and asked.mazes is None
        asked = asked.replace(split="dev" if asked.is_drawn or is_of_tracks else "eval")
    if asked.track is not None and asked.frozen_split is not None:
        other = ", ".join(str(distance) for distance in asked.distances or () if distance not in DISTANCES)
        if other:
            raise InputError(
                f"track {asked.track!r}: expected distances from {DISTANCES[0]} to {DISTANCES[-1]}, "
                f"those of the frozen episodes, found {other}"
            )
    return resolve(asked, distances=EVAL_DISTANCES, context_size_of=context_size_of)


def as_options(
    task: str | Task | TaskOptions, options: Mapping[str, Any], arguments: Sequence[str] = ()
) -> TaskOptions:
    """Returns what was asked: a task or its options, or the name of a task with options beside it.

    Args:
      task: the name, or what has all options.
      options: the others by name; none beside a task that has them.
      arguments: what the call takes besides options, for the error of an unknown one.

    Raises:
      InputError: if an option is unknown or not allowed.
    """
    if isinstance(task, Task | TaskOptions):
        if options:
            raise InputError(f"expected no options beside a {type(task).__name__}, found {next(iter(options))}")
        return task.asked if isinstance(task, Task) else task
    check_names(options, TaskOptions, arguments=arguments)
    return TaskOptions.of(options, task=task)


def tasks_of_tracks(tracks: Sequence[str], **options: Any) -> tuple[Task, ...]:
    """Returns a task for each of some tracks, in the same mazes and with contexts of one size.

    Args:
      tracks: names of tracks, each once.
      **options: those of `Task.of`; `context_size` is the largest one of the tracks' if it is not given.

    Raises:
      InputError: as `Task.of`, and if the tracks are not several different ones.
    """
    if not tracks or any(track not in TRACKS for track in tracks) or len(set(tracks)) < len(tracks):
        raise InputError(f"expected different tracks of {', '.join(TRACKS)}, found {', '.join(tracks) or 'none'}")
    wanted = TaskOptions.of({"context_size": options.pop("context_size", None)}).context_size
    return in_the_same_mazes([Task.of(track, **options) for track in tracks], wanted)


def in_the_same_mazes(tasks: Sequence[Task], context_size: int | None = None) -> tuple[Task, ...]:
    """Returns tasks in the mazes of the first one, with contexts of one size, by default the largest one of theirs.

    Raises:
      InputError: if one is played in buildings that have changed, and another one is not, or in others.
    """
    if any(task.changes_buildings for task in tasks) and any(task.mazes != tasks[0].mazes for task in tasks):
        names = ", ".join(task.name for task in tasks)
        raise InputError(
            f"tracks {names}: expected tracks of one strength in mazes of your own, whose changes depend on it, or an "
            "older map of them (--shown)"
        )
    context_size = context_size or max(task.context_size for task in tasks)
    return tuple(
        dataclasses.replace(task, context_size=context_size, mazes=tasks[0].mazes, shown=tasks[0].shown)
        for task in tasks
    )


def _read(asked: TaskOptions) -> World:
    """Returns the mazes, loaded or drawn, with their older maps."""
    size = asked.size or (SIZES[0] if asked.track is None else KINDS_SIZE)
    if asked.fresh:
        return World(FreshMazes(asked.kinds or DRAWN_KINDS[:1], size))
    if asked.is_drawn:
        split = "train" if asked.split in (None, "train") else "dev"
        return World(draw_mazes(asked.kinds or DRAWN_KINDS[:1], size, split, asked.num_mazes or NUM_DRAWN))
    if asked.mazes is None:
        split = asked.split or "train"
        return World(load_mazes(size, split) if asked.track is None else load_kind_mazes(split))
    mazes, shown = _read_own(asked)
    for maze in mazes:
        if asked.size not in (None, maze.size):
            raise InputError(f"expected mazes of size {asked.size}, found size {maze.size}")
    if shown is None and asked.track is not None:
        return _with_changes(asked, mazes)
    return World(mazes, shown)


def _read_own(asked: TaskOptions) -> tuple[tuple[Maze, ...], tuple[OlderMap, ...] | None]:
    """Returns the mazes of one's own in which the task can be played, with their older maps."""
    mazes, shown = asked.mazes, None
    if not isinstance(mazes, str):
        return mazes, None if asked.shown is None else maps_in_texts(asked.shown, mazes)
    from mazebench.maps.maze_files import read_mazes, read_with_older  # with all readers, which few commands need

    if asked.shown is None:
        mazes = read_mazes(mazes, **dataclasses.asdict(asked.reading))
    else:
        mazes, shown = read_with_older(mazes, asked.shown, asked.reading)
    kept = _playable(mazes, functools.partial(_check_maze, asked))
    return tuple(mazes[each] for each in kept), shown and tuple(shown[each] for each in kept)


def _with_changes(asked: TaskOptions, plans: tuple[Maze, ...]) -> World:
    """Returns buildings in which things have changed since their plans were drawn, if doors have moved on the track.

    Raises:
      InputError: if none of the plans can carry the strength of the level, or levels differ in it.
    """
    strengths = {TRACKS[asked.task].levels[level - 1].strength for level in asked.level or LEVELS[:1]}
    if len(strengths) > 1:
        found = ", ".join(map(str, asked.level or ()))
        raise InputError(
            f"track {asked.task!r}: expected one level in mazes of your own, whose changes depend on it, found {found}"
        )
    [strength] = strengths
    if strength is None:
        return World(plans)

    shown: list[OlderMap] = []

    def change(plan: Maze) -> None:
        _check_maze(asked, plan)
        shown.extend(OlderMap(plan.walls, maze) for maze in _changed(plan, plan.name, plan.kind, strength))

    # What takes a moment is checked first.
    _context_size(asked, plans[0].size, default_context_size)
    _playable(plans, change)
    return World(tuple(each.maze for each in shown), tuple(shown))


@functools.lru_cache(maxsize=32)
def _changed(plan: Maze, name: str, kind: str, strength: int) -> tuple[Maze, ...]:
    """Returns the changed buildings of a plan; name and kind are its own, for plans of equal walls are equal."""
    from mazebench.maps.changes import changed_buildings  # which needs numba

    return changed_buildings(plan, strength, NUM_CHANGED, seed=0)


def _fitting_distances(asked: TaskOptions, world: World, by_default: tuple[int, ...]) -> tuple[int, ...]:
    """Returns the distances of options that name none: on a track in metres, else in cells."""
    mazes, shown = world
    of_track = DISTANCES if asked.track is not None else ()
    if not asked.has_own or isinstance(mazes, FreshMazes):
        return of_track or by_default

    # Of given ends, that between them.
    if asked.is_hierarchical or asked.num_ends == 2:
        return tuple(sorted(set(map(asked.farthest, mazes, shown or [None] * len(mazes)))))

    # Of a track, those that all mazes have; all of its own, if none has any.
    farthest, count = min(map(asked.farthest, mazes, shown or [None] * len(mazes))), len(EVAL_DISTANCES)
    if of_track:
        cell_size = mazes[0].cell_size
        return tuple(each for each in of_track if cells_of(each, cell_size, asked.track) <= farthest) or of_track

    # Else at most 15, evenly spaced up to what all mazes have.
    if farthest > count:
        farthest = max(count, int(_FARTHEST_SHARE * farthest))
    count = min(count, farthest)
    return tuple(round(farthest * number / count) for number in range(1, count + 1))


def _context_size(asked: TaskOptions, size: int, context_size_of: Callable[[int], int]) -> int:
    """Returns M for mazes of `size` cells a side; an `InputError` if a track shows another one, or too many pixels."""
    if asked.track is None:
        return asked.context_size or context_size_of(size)
    pixels = TRACKS[asked.track].pixels_per_cell
    context_size = pixels * size
    if context_size > MAX_CONTEXT_SIZE:
        raise InputError(
            f"track {asked.track!r}: expected mazes of at most {MAX_CONTEXT_SIZE // pixels} cells a side, "
            f"whose maps have at most {MAX_CONTEXT_SIZE} pixels, found {size}"
        )
    if asked.context_size not in (None, context_size):
        raise InputError(f"track {asked.track!r}: expected context_size {context_size}, found {asked.context_size}")
    return context_size


def _check_mazes(asked: TaskOptions, world: World) -> None:
    """Raises `InputError` if mazes are not of one size and scale, or the task can't be played in one of them."""
    mazes = world.mazes
    if isinstance(mazes, FreshMazes):
        for name in ENDS:
            if (end := getattr(asked, name)) is not None:
                raise InputError(f"fresh mazes: expected no {name}, which may be a wall in one of them, found {end!r}")
        return
    require_one_size(mazes)
    for number, maze in enumerate(mazes):
        _check_maze(asked, maze, None if world.shown is None else world.shown[number])
        if asked.track is not None and world.shown is None:
            TRACKS[asked.track].require(maze, asked.level or LEVELS[:1])


def _check_maze(asked: TaskOptions, maze: Maze, older: OlderMap | None = None) -> None:
    """Raises `InputError` if the task can't be played in a maze."""
    if maze.cell_size < MIN_CELL_SIZE:
        raise InputError(
            f"{maze.name}: expected cells of at least {MIN_CELL_SIZE} m, through which the body passes, "
            f"found {maze.cell_size} m; {THIN_WALLS}"
        )
    if asked.track is not None and maze.cell_size > MAX_CELL_SIZE:
        raise InputError(
            f"track {asked.track!r}: expected cells of at most {MAX_CELL_SIZE:g} m, found {maze.cell_size:g} m"
        )
    if len(maze.free_cells) < 2:
        raise InputError(f"{maze.name}: expected two free cells for a start and a goal, found one")
    start, goal = asked.ends(maze, older)
    if start is not None and start == goal:
        raise InputError(f"{maze.name}: expected start and goal in different cells, found both in {start}")


def _playable(mazes: Sequence[Maze], check: Callable[[Maze], Any]) -> list[int]:
    """Returns the numbers of the mazes that `check` lets pass, and warns of each other one.

    Raises:
      InputError: if it is none.
    """
    faults: dict[int, InputError] = {}
    for number, maze in enumerate(mazes):
        try:
            check(maze)
        except InputError as error:
            faults[number] = error
    if len(faults) == len(mazes):
        raise faults[0]
    for number, fault in faults.items():
        remark(f"maze {mazes[number].name!r} left out: {fault}")
    return [number for number in range(len(mazes)) if number not in faults]


def _check_distances(options: TaskOptions, world: World) -> None:
    """Raises `InputError` if no goal of the local task is as far away in a maze as wanted."""
    mazes, shown = world
    wanted, cell_size = options.distances or (), mazes[0].cell_size
    if options.is_hierarchical or options.num_ends == 2:
        return
    if isinstance(mazes, FreshMazes):  # an episode whose maze is too small takes another one
        mazes = (max((mazes[number] for number in range(_NUM_CHECKED)), key=options.farthest),)
    longest, unit = cells_of(max(wanted), cell_size, options.track), "cells" if options.track is None else "m"
    for maze, older in zip(mazes, shown or [None] * len(mazes), strict=True):
        # Most mazes are found to be large enough from one cell, without the distances of all pairs.
        if shown is None and not options.num_ends and longest <= maze.distances(tuple(maze.free_cells[0])).max():
            continue
        if longest > (farthest := options.farthest(maze, older)):
            raise InputError(
                f"{maze.name}: expected distances of at most {distance_of(farthest, cell_size, options.track)} {unit}, "
                f"as far as the maze reaches, found {max(wanted)}; choose others (--distances)"
            )
