"""The task: what is played, and what agents are shown of it, complete when it is constructed."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from mazebench.errors import InputError
from mazebench.maps.drawn import FreshMazes, Mazes
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.moving_doors import StandingMazes
from mazebench.options import check_names, fields_of
from mazebench.tasks.arena import Arena, arena_of, pixels_of_track
from mazebench.tasks.context import default_context_size
from mazebench.tasks.interface import Interface
from mazebench.tasks.perturbations import OF_OPTION
from mazebench.tasks.perturbations.perturbation import Of, Perturbation
from mazebench.tasks.sensors import SENSORS, require_sensors_of_options
from mazebench.tasks.task_options import DRAWN_KINDS, HIERARCHICAL, LOCAL, NUM_DRAWN, TaskOptions
from mazebench.tasks.time_limit import default_time_limit
from mazebench.tasks.tracks import DISTANCES, LEVELS, TRACKS, cells_of
from mazebench.world.bodies import SLIDER, Body

TRAIN_DISTANCES = tuple(range(1, 6))
EVAL_DISTANCES = tuple(range(1, 16))
_NOT_VARIED = ("pairs", "reward")
NOT_IN_EVALUATIONS = ("fresh", *_NOT_VARIED, "context_size")  # agents choose the last one

_FARTHEST_SHARE = 0.9  # of the diameter of a large maze; few pairs of cells are farther apart
# Options by which mazes are read or drawn.
_OF_MAZES = {"task", "size", "split", "mazes", "shown", "align", "kinds", "num_mazes", "fresh", "body"}
_OF_MAZES |= set(fields_of(ReadOptions))


@dataclasses.dataclass(frozen=True)
class Task:
    """A task: what is played, and what agents are shown of it.

        >>> task = mazebench.Task.of("rebuilt", level=2, split="dev")
        >>> task.options.task, task.size, len(task.mazes)
        ('rebuilt', 31, 48)

    `Task.of` makes one. `options` say it in plain values and go to JSON; tasks of equal options are equal. `arena` is
    what was read: the mazes and what is shown of them.
    """

    options: TaskOptions  # with what was open filled
    arena: Arena = dataclasses.field(compare=False, repr=False)
    context_size: int  # M; of several tracks in one environment, the largest one

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
        """Returns the task whose options `TaskOptions.to_json` returned.

        Raises:
          InputError: as `of`.
        """
        return resolve(TaskOptions.from_json(content))

    def replace(self, **changes: Any) -> Task:
        """Returns the task with other values of some options; the mazes are not read again unless they change."""
        options, arena = self.options.replace(**changes), None
        if not changes.keys() & (_OF_MAZES | {"level"} if self.changes_buildings else _OF_MAZES):
            has_ends = changes.keys() & {"start", "goal"}
            arena = arena_of(options, self.mazes, self.arena.shown) if has_ends else self.arena
        task = resolve(options, arena=arena)
        return task if "context_size" in changes else dataclasses.replace(task, context_size=self.context_size)

    def at_distances(self, distances: Sequence[int]) -> Task:
        """Returns the task with goals at other distances (cells, on a track metres); a given time limit stays.

        Raises:
          InputError: if there are no distances, a maze has no cells so far apart, or the task does not draw goals.
        """
        if self.options.is_hierarchical:
            raise InputError(f"expected a task whose goals are drawn at distances, found {self.options.task!r}")
        return self.replace(distances=(None,) if distances is None else distances)  # None would leave them open

    @property
    def mazes(self) -> Mazes:
        """The mazes; `Episode.maze` is an index into them."""
        return self.arena.mazes

    @property
    def standing(self) -> StandingMazes:
        """The mazes by the numbers that say what stands: `mazes`, and behind them those in which doors are closed."""
        return self.arena.standing

    @property
    def size(self) -> int:
        """N, cells a side of all mazes."""
        return self.arena.size

    @property
    def cell_size(self) -> float:
        """The width of the cells of all mazes in metres."""
        return self.arena.cell_size

    @functools.cached_property
    def distances(self) -> tuple[int, ...]:
        """The distances from start to goal in cells."""
        return tuple(cells_of(each, self.cell_size, self.options.track) for each in self.options.distances or ())

    @property
    def body(self) -> Body:
        """The body that is driven."""
        return self.options.driven_body

    @property
    def levels(self) -> tuple[int, ...]:
        """The levels of the track, of which each episode draws one; none without a track."""
        return self.options.level or ()

    @property
    def actions(self) -> str:
        """The actions: "six", "four", "velocity" or "diff"."""
        return self.options.actions or "six"

    @property
    def changes_buildings(self) -> bool:
        """True if the mazes are buildings in which things have changed, made of mazes of one's own."""
        return self.arena.shown is not None and self.options.shown is None

    @property
    def moves_doors(self) -> bool:
        """True if doors close and open while one drives."""
        return self.options.track is not None and TRACKS[self.options.track].moves_doors

    @property
    def has_legs(self) -> bool:
        """True if the context may change within an episode: at landmarks, or where one goal follows another."""
        return self.options.is_hierarchical or self.options.num_goals > 1

    def perturbations(self, level: int) -> tuple[Perturbation, ...]:
        """Returns those of the options and of a level of the track, in the order in which they apply."""
        return self._perturbations[level - 1]

    @functools.cached_property
    def _perturbations(self) -> list[tuple[Perturbation, ...]]:
        return [tuple(self._find_perturbations(level)) for level in LEVELS]

    def _find_perturbations(self, level: int) -> list[Perturbation]:
        options = self.options
        strengths = {name: strength for name in OF_OPTION if (strength := getattr(options, name)) is not None}
        found = [OF_OPTION[name](strength) for name, strength in strengths.items() if strength]
        if options.track is not None:
            left_out = {Of.BUILDING: self.arena.shown is not None, Of.SENSES: options.exact_pose}
            of_level = TRACKS[options.track].levels[level - 1].perturbations
            found += [each for each in of_level if not left_out.get(each.of) and each.option not in strengths]
        return found

    @property
    def interface(self) -> Interface:
        """The part of the task that an agent may know. It names no track or level, but some can be inferred."""
        options = self.options
        told: dict[str, Any] = {}
        for perturbation in itertools.chain(*map(self.perturbations, self.levels or LEVELS[:1])):
            told |= {name: max(value, told.get(name, value)) for name, value in perturbation.told().items()}
        for sensor in options.sensors:
            told |= SENSORS[sensor].told(options)
        return Interface(
            HIERARCHICAL if options.is_hierarchical else LOCAL,
            self.size,
            self.context_size,
            actions=self.actions,
            sensors=options.sensors,
            cell_size=self.cell_size,
            hidden=options.hide,
            **told,
            body=self.body,
        )


def resolve(
    asked: TaskOptions | Task,
    *,
    distances: tuple[int, ...] | None = None,
    context_size_of: Callable[[int], int] | None = None,
    arena: Arena | None = None,
) -> Task:
    """Returns the task that options name: reads or draws the mazes, fills what is open, and checks all of it.

    Args:
      asked: the options; or a task, which stays as it is but for M, where `context_size_of` is given.
      distances: those in the benchmark's mazes if none are asked for; by default 1 to 5, in eval mazes 1 to 15.
      context_size_of: returns M for mazes of N cells a side, where neither the options nor a track say it.
      arena: what it is played in, if that is there already.

    Raises:
      InputError: if a map can't be read, the task can't be played in a maze, or an option's sensor is not observed.
    """
    if isinstance(asked, Task):
        if context_size_of is None:
            return asked
        wanted = None if asked.options.track is not None else context_size_of(asked.size)
        return asked.replace(context_size=wanted)
    require_sensors_of_options(asked.sensors, asked.changed().items())  # here, since agents add sensors of their own
    arena, body = arena or arena_of(asked), asked.driven_body
    if arena.cell_size < 2 * body.reach:
        raise InputError(
            f"body {body.name!r}: expected cells of at least {2 * body.reach:g} m, through which it passes, "
            f"found {arena.cell_size:g} m"
        )
    if asked.actions == "velocity" and not body.strafes:
        raise InputError(f"body {body.name!r}: can't strafe, so expected actions six, four or diff, found 'velocity'")
    if arena.moves_doors and not body.strafes:
        raise InputError(f"body {body.name!r}: expected a body that slides where doors move, found one on two wheels")
    split, level = asked.split or "train", asked.level or (() if asked.track is None else LEVELS[:1])
    if asked.track is not None:
        arena.require_levels(asked.track, level)
    context_size = _context_size(asked, arena.size, context_size_of or default_context_size)

    # The distances that fit the mazes, and a time limit in which goals of one's own are reached.
    by_default = distances or (EVAL_DISTANCES if split == "eval" else TRAIN_DISTANCES)
    fitting = _fitting_distances(asked, arena, by_default)
    if asked.num_ends == 2 and asked.distances not in (None, fitting):
        raise InputError(f"start and goal are given; found distances {asked.distances}, which would be ignored")
    chosen = asked.distances or fitting
    time_limit = asked.time_limit
    if asked.track is None and time_limit is None:
        cells = asked.landmark_distance if asked.is_hierarchical else max(chosen)
        is_new = asked.has_own or asked.is_drawn or body != SLIDER
        time_limit = default_time_limit(cells, arena.cell_size, body, track=None, is_new=is_new)
    arena.require_distances(chosen, asked.track)

    filled = asked.filled(
        size=arena.size,
        cell_size=arena.cell_size,
        split=split,
        level=level or None,
        distances=chosen,
        time_limit=time_limit,
        actions=asked.actions or "six",
        context_size=context_size,
        kinds=asked.kinds or (DRAWN_KINDS[:1] if asked.is_drawn else ()),
        fresh=bool(asked.fresh),
        num_mazes=asked.num_mazes or (NUM_DRAWN if asked.is_drawn and not asked.fresh else None),
    )
    return Task(filled, arena, context_size)


def resolve_for_evaluation(asked: TaskOptions | Task, context_size_of: Callable[[int], int] | None = None) -> Task:
    """Returns the task of an evaluation: one that is given, or that of options, at distances of 1 to 15 by default.

    If options leave the split open, it is dev on tracks and in drawn mazes, and eval in the mazes of the paper's
    protocol.

    Raises:
      InputError: as `resolve`, and if the options name what evaluations do not vary.
    """
    options = options_of(asked)
    if options.fresh:
        raise InputError("expected no fresh mazes in an evaluation; num_mazes says how many of each kind are drawn")
    for name in (*_NOT_VARIED, *["num_goals"] * (options.track is None)):
        if (found := getattr(options, name)) != (wanted := fields_of(TaskOptions)[name].default):
            raise InputError(f"expected {name} {wanted!r} in an evaluation, found {found!r}")
    if options.level is not None and len(options.level) > 1:
        found = ", ".join(map(str, options.level))
        raise InputError(f"expected one level in an evaluation, found {found}; the suite 'tracks' has all levels")
    if options.split is None:
        is_of_tracks = options.track is not None and options.mazes is None
        asked = options = options.filled(split="dev" if options.is_drawn or is_of_tracks else "eval")
    if options.track is not None and options.frozen_split is not None:
        other = ", ".join(str(distance) for distance in options.distances or () if distance not in DISTANCES)
        if other:
            raise InputError(
                f"track {options.track!r}: expected distances from {DISTANCES[0]} to {DISTANCES[-1]}, "
                f"those of the frozen episodes, found {other}"
            )
    return resolve(asked, distances=EVAL_DISTANCES, context_size_of=context_size_of)


def options_of(asked: TaskOptions | Task) -> TaskOptions:
    """Returns the options of a task, or those that were asked for."""
    return asked.options if isinstance(asked, Task) else asked


def as_asked(
    task: str | Task | TaskOptions, options: Mapping[str, Any], arguments: Sequence[str] = ()
) -> TaskOptions | Task:
    """Returns what was asked for: a task or its options, or the name of a task with options beside it.

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
        return task
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
        names = ", ".join(task.options.task for task in tasks)
        raise InputError(
            f"tracks {names}: expected tracks of one strength in mazes of your own, whose changes depend on it, or an "
            "older map of them (--shown)"
        )
    context_size = context_size or max(task.context_size for task in tasks)
    arena = next((task.arena for task in tasks if task.arena.moves_doors), tasks[0].arena)
    return tuple(dataclasses.replace(task, context_size=context_size, arena=arena) for task in tasks)


def _fitting_distances(asked: TaskOptions, arena: Arena, by_default: tuple[int, ...]) -> tuple[int, ...]:
    """Returns the distances of options that name none: on a track in metres, else in cells."""
    of_track = DISTANCES if asked.track is not None else ()
    if not asked.has_own or isinstance(arena.mazes, FreshMazes):
        return of_track or by_default

    # Of given ends, that between them.
    of_mazes = [arena.farthest(maze) for maze in range(len(arena.mazes))]
    if asked.is_hierarchical or asked.num_ends == 2:
        return tuple(sorted(set(of_mazes)))

    # Of a track, those that all mazes have; all of its own, if none has any.
    farthest, count = min(of_mazes), len(EVAL_DISTANCES)
    if of_track:
        return tuple(each for each in of_track if cells_of(each, arena.cell_size, asked.track) <= farthest) or of_track

    # Else at most 15, evenly spaced up to what all mazes have.
    if farthest > count:
        farthest = max(count, int(_FARTHEST_SHARE * farthest))
    count = min(count, farthest)
    return tuple(round(farthest * number / count) for number in range(1, count + 1))


def _context_size(asked: TaskOptions, size: int, context_size_of: Callable[[int], int]) -> int:
    """Returns M for mazes of `size` cells a side; an `InputError` if a track shows another one."""
    if asked.track is None:
        return asked.context_size or context_size_of(size)
    context_size = pixels_of_track(asked.track, size)
    if asked.context_size not in (None, context_size):
        raise InputError(f"track {asked.track!r}: expected context_size {context_size}, found {asked.context_size}")
    return context_size
