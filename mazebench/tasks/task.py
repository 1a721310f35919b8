"""The task: one value that says what is played, and what agents are shown of it."""

from __future__ import annotations

import dataclasses
import functools
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import numpy as np

from mazebench.errors import InputError, UnknownOptionError, unknown
from mazebench.maps.benchmark import (
    FROZEN_SPLITS,
    KINDS_SIZE,
    PAPER_BENCHMARK,
    SIZES,
    TRACKS_BENCHMARK,
    load_kind_mazes,
    load_mazes,
)
from mazebench.maps.drawn import FreshMazes, Mazes, draw_mazes
from mazebench.maps.maze import MIN_CELL_SIZE, Cell, Maze, corner_cells, require_one_size
from mazebench.maps.maze_files import read_all
from mazebench.maps.maze_options import THIN_WALLS, ReadOptions, changed_reading
from mazebench.maps.places import free_cell_of_place
from mazebench.maps.scenarios import Scenarios, are_scenarios, read_scenarios
from mazebench.maps.selection import described_maze, own_mazes
from mazebench.options import fields_of, options
from mazebench.tasks.context import MAX_CONTEXT_SIZE, default_context_size
from mazebench.tasks.interface import Interface
from mazebench.tasks.perturbations import PERTURBATIONS
from mazebench.tasks.task_fields import (
    DRAWN_KINDS,
    FIRST_LEVEL,
    HIDEABLE,
    KINDS_OF_TASK,
    NUM_DRAWN,
    PROGRESS,
    SPARSE,
    TaskFields,
    TaskOptions,
    as_mazes,
)
from mazebench.tasks.time_limit import default_time_limit
from mazebench.tasks.tracks import DISTANCES, TRACKS
from mazebench.world.ray_casting import TURTLEBOT3, LidarModel

TRAIN_DISTANCES = tuple(range(1, 6))
EVAL_DISTANCES = tuple(range(1, 16))
ENDS = ("start", "goal")
CUSTOM = "custom"  # the split in results of mazes, a start or a goal that are not the benchmark's
MIN_CONTEXT_SIZE = 3
# Fields that evaluations do not vary.
NOT_IN_EVALUATIONS = ("fresh", "pairs", "num_goals", "reward", "context_size")

_NUM_CHECKED = 10  # of fresh mazes, one of which must have the distances
_FARTHEST_SHARE = 0.9  # of the diameter of a large maze; few pairs of cells are farther apart
_LIDAR = "lidar"  # the sensor that every track offers
_SHOWING_POSE = ("top", "chase")  # the sensors that show where the body is
# Fields that choose the mazes, and those that an agent may choose, or is not told, while the same is played.
_OF_MAZES = ("size", "split", "mazes", "kinds", "num_mazes", "fresh", *fields_of(ReadOptions))
_OF_AGENTS = ("actions", "sensors", "camera_size", "textures", "hide", "exact_pose", "context_size")


@options
class Task(TaskFields):
    """A task in plain values: what is played, and what agents are shown of it.

        >>> task = mazebench.Task.of("rebuilt", level=2, split="dev")
        >>> task.title, task.size, len(task.all_mazes)
        ('rebuilt 2', 31, 48)

    `Task.of` makes one and fills what is left open. Fields that it leaves alone: `time_limit` is 0 on a track, whose
    limit depends on the distance, and `lidar_noise` and `odometry_noise` are None where the track has its own.
    """

    @classmethod
    def of(cls, task: str = "local", **options: Unpack[TaskOptions]) -> Task:
        """Returns the task that options name, with what they leave open.

        Args:
          task: "local", "hierarchical" or the name of a track.
          **options: fields of `Task` by name, which docs/options.md lists; None stands for the default. `mazes` are
            mazes of your own: a `Maze`, an array as `maze_from_array` takes it, several of these of one size, or the
            path of a file or of a folder of files.

        Raises:
          InputError: if an option is unknown or not allowed, options contradict each other, or a map can't be read.
        """
        return _complete(_asked(task, options), None)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Task:
        """Returns the task of which `to_json` returned the content.

        Checkpoints that are older than the field `actions` have the field `continuous` in their tasks.

        Raises:
          InputError: as `of`.
        """
        older = {} if "continuous" not in content else {"actions": "velocity" if content["continuous"] else "six"}
        return cls.of(**{name: value for name, value in content.items() if name != "continuous"} | older)

    def to_json(self) -> dict[str, Any]:
        """Returns the fields by name, in values that JSON has; without the reward if it is that of evaluations."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        if self.reward == SPARSE:
            del values["reward"]
        if isinstance(self.mazes, tuple):
            values["mazes"] = [described_maze(maze) for maze in self.mazes]
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}

    def replace(self, **changes: Any) -> Task:
        """Returns the task with other values of some fields; the mazes are not loaded again unless they change."""
        task = dataclasses.replace(self, **changes)
        if not set(changes) & set(_OF_MAZES):
            task._keep_mazes_of(self)
        return task

    def in_mazes(self, mazes: Sequence[Maze]) -> Task:
        """Returns the same task in other mazes."""
        return dataclasses.replace(
            self,
            mazes=tuple(mazes),
            size=mazes[0].size,
            cell_size=mazes[0].cell_size,
            **{name: fields_of(Task)[name].default for name in ("kinds", "num_mazes", "fresh")},
        )

    # The mazes.

    @functools.cached_property
    def all_mazes(self) -> Mazes:
        """The mazes, loaded or drawn: `Episode.maze` is an index into them.

        Raises:
          InputError: if there are no such mazes, or a map can't be read.
        """
        if self.mazes is not None:
            mazes = self.mazes
            if self.scenarios is not None:
                mazes = (self.scenarios.maze,)
            elif isinstance(mazes, str):
                mazes = read_all(pathlib.Path(mazes), self._reading)
            for maze in mazes:
                if self.size not in (0, maze.size):
                    raise InputError(f"expected mazes of size {self.size}, found size {maze.size}")
            return mazes
        size = self.size or (SIZES[0] if self.track is None else KINDS_SIZE)
        if self.fresh:
            return FreshMazes(self._drawn_kinds, size)
        if self.is_drawn:
            split = "train" if self.split == "train" else "dev"
            return draw_mazes(self._drawn_kinds, size, split, self.num_mazes or NUM_DRAWN)
        return load_mazes(size, self.split) if self.track is None else load_kind_mazes(self.split)

    @functools.cached_property
    def scenarios(self) -> Scenarios | None:
        """The starts and goals that a file of scenarios names; None if the mazes are no such file.

        Raises:
          InputError: if the file or its map can't be read.
        """
        return read_scenarios(str(self.mazes), self._reading) if are_scenarios(self.mazes) else None

    @property
    def _reading(self) -> ReadOptions:
        values = {name: getattr(self, name) for name in fields_of(ReadOptions)}
        values["area"] = self.area or self.start or self.goal  # these choose the area, unless it is given
        return ReadOptions(**values)

    def _keep_mazes_of(self, other: Task) -> None:
        """Takes over what another task has read, as `cached_property` keeps it."""
        vars(self).update(all_mazes=other.all_mazes, scenarios=other.scenarios)

    @property
    def fixed_mazes(self) -> tuple[Maze, ...]:
        """The mazes.

        Raises:
          InputError: if every episode has a new one.
        """
        if isinstance(self.all_mazes, FreshMazes):
            raise InputError("expected a task with a number of mazes, found fresh ones")
        return self.all_mazes

    @property
    def is_drawn(self) -> bool:
        """True if mazes are drawn, of some kinds."""
        return bool(self.kinds or self.num_mazes or self.fresh)

    @property
    def _drawn_kinds(self) -> tuple[str, ...]:
        return self.kinds or DRAWN_KINDS[:1]

    @property
    def has_own(self) -> bool:
        """True if mazes, start or goal are a user's own."""
        return self.mazes is not None or self.num_ends > 0

    @property
    def split_in_results(self) -> str:
        """The split as records and summaries have it."""
        return CUSTOM if self.has_own or self.is_drawn else self.split

    @property
    def frozen_split(self) -> str | None:
        """The split of the benchmark whose frozen episodes are evaluated; None for other mazes."""
        return self.split_in_results if self.split_in_results in FROZEN_SPLITS else None

    @property
    def benchmark(self) -> str:
        """The benchmark that the task belongs to."""
        return PAPER_BENCHMARK if self.track is None else TRACKS_BENCHMARK

    # Episodes.

    @property
    def num_ends(self) -> int:
        """The number of given ends: start and goal."""
        return (self.start is not None) + (self.goal is not None)

    def ends(self, maze: Maze) -> tuple[Cell | None, Cell | None]:
        """Returns the start and the goal of all episodes in a maze; None for one that each episode draws.

        Raises:
          InputError: if one is not free.
        """
        given = {name: end for name in ENDS if (end := getattr(self, name)) is not None}
        cells = {name: free_cell_of_place(name, end, maze) for name, end in given.items()}
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

    @property
    def has_legs(self) -> bool:
        """True if the context may change within an episode: at landmarks, or where one goal follows another."""
        return self.task == "hierarchical" or self.num_goals > 1

    @property
    def longest_episode(self) -> int | None:
        """The agent steps that an episode may take; None where they depend on its landmarks."""
        if self.task == "hierarchical":
            return None
        limit = self.time_limit or default_time_limit(max(self.distances), track=self.track)
        return self.num_goals * limit

    # What is shown.

    @property
    def perturbations(self) -> dict[str, float]:
        """The levels of all perturbations by name, in the order in which they apply."""
        return {name: getattr(self, name) for name in PERTURBATIONS}

    @property
    def active_perturbations(self) -> tuple[tuple[str, float], ...]:
        """The perturbations that are switched on, with their levels."""
        return tuple((name, level) for name, level in self.perturbations.items() if level)

    @property
    def lidar(self) -> LidarModel:
        """The model of the sensor `lidar`: as the option says, or the track."""
        return TURTLEBOT3 if self.lidar_noise is None and self.track is not None else super().lidar

    def odometry_noise_at(self, level: int) -> float:
        """Returns alpha of the noise on the observed motion at a level: as the option says, or the track."""
        if self.odometry_noise is not None or self.track is None or self.exact_pose:
            return self.odometry_noise or 0.0
        return TRACKS[self.track].levels[level - 1].odometry_noise

    @property
    def interface(self) -> Interface:
        """The part of the task that an agent may know: neither the track nor its level."""
        return Interface(
            self.task,
            self.size,
            self.context_size,
            actions=self.actions,
            sensors=self.sensors,
            cell_size=self.cell_size,
            hidden=self.hide,
            lidar=self.lidar if _LIDAR in self.sensors else None,
            odometry_noise=max(map(self.odometry_noise_at, self.level)),
        )

    # Results.

    @property
    def setting(self) -> Task:
        """The task without what an agent chooses or is not told, and without distances: results of one are compared."""
        left = [*_OF_AGENTS, "distances", "time_limit"]
        if self.task == "local":
            left.append("landmark_distance")
        changes = {name: fields_of(Task)[name].default for name in left}
        if self.mazes is not None:
            changes |= {"split": "train"}
        return dataclasses.replace(self, **changes)

    @property
    def is_exact(self) -> bool:
        """True if nothing is wrong with the map and the observed states."""
        return self.track is None and not self.active_perturbations

    @property
    def noise_in_words(self) -> tuple[str, ...]:
        """The noise on the senses that a user set, in words."""
        noise = {"lidar noise": self.lidar_noise, "odometry noise": self.odometry_noise}
        return tuple(f"{name} {value}" for name, value in noise.items() if value is not None)

    @property
    def own_in_words(self) -> tuple[str, ...]:
        """The choices of a user besides the mazes: the size of a cell, start and goal, noise on the senses."""
        scale = () if self.cell_size == 1 else (f"cells of {self.cell_size:g} m",)
        ends = (f"{name} {end}" for name in ENDS if (end := getattr(self, name)) is not None)
        return (*scale, *ends, *self.noise_in_words)

    @property
    def title(self) -> str:
        """The track and its level, or the kind of navigation: "rebuilt 2", "local"."""
        return self.task if self.track is None else f"{self.track} {','.join(map(str, self.level))}"

    @property
    def name(self) -> str:
        """Task and size, or track and level, and the perturbations, as names of files have them."""
        levels = "".join(f"-{name.rpartition('_')[2]}-{level:g}" for name, level in self.active_perturbations)
        return (self.title.replace(" ", "-") if self.track else f"{self.task}-{self.size}") + levels

    def __str__(self) -> str:
        parts = [self.task] if self.track is None else [self.track, f"level {','.join(map(str, self.level))}"]
        parts.append(f"{self.size} × {self.size}")
        if self.split_in_results != "eval":
            parts.append(f"{self.split_in_results} mazes")
        parts += self.own_in_words
        if self.task == "hierarchical":
            parts.append(f"landmarks every {self.landmark_distance}")
        parts += [f"{name.replace('_', ' ')} {level:g}" for name, level in self.active_perturbations]
        return ", ".join(parts)

    def __lt__(self, other: Task) -> bool:
        """Returns whether a table has this task above another one."""
        return self._order < other._order

    @property
    def _order(self) -> tuple[Any, ...]:
        return (
            *(self.task, self.size, self.split_in_results),
            self.landmark_distance if self.task == "hierarchical" else 0,
            self.active_perturbations,
            *(str(self.mazes or ""), self.kinds, self.num_mazes, self.track or "", self.level),
            self.own_in_words,
        )


def evaluation_task(task: str = "local", **options: Unpack[TaskOptions]) -> Task:
    """Returns the task of an evaluation, as `Task.of` does, but in eval mazes at distances of 1 to 15 by default.

    Drawn mazes are those of the split dev, unless the split is train.

    Raises:
      InputError: as `Task.of`, and if the options name what evaluations do not vary.
    """
    given = _asked(task, options)
    asked = Task(**{"split": "eval"} | given)
    if asked.is_drawn and asked.split == "eval":
        given["split"] = "dev"
    for name in NOT_IN_EVALUATIONS[1:]:  # fresh mazes have a line of their own
        if (found := getattr(asked, name)) != (wanted := fields_of(Task)[name].default):
            raise InputError(f"expected {name} {wanted!r} in an evaluation, found {found!r}")
    if asked.fresh:
        raise InputError("expected no fresh mazes in an evaluation; num_mazes says how many of each kind are drawn")
    if len(asked.level) > 1:
        found = ", ".join(map(str, asked.level))
        raise InputError(f"expected one level in an evaluation, found {found}; the suite 'tracks' has all levels")
    return _complete({"split": "eval"} | given, EVAL_DISTANCES)


def tasks_of_tracks(tracks: Sequence[str], **options: Unpack[TaskOptions]) -> tuple[Task, ...]:
    """Returns a task for each of some tracks, in the same mazes and with contexts of one size.

    Args:
      tracks: names of tracks, each once.
      **options: those of `Task.of`. Unless `context_size` is given, it is the largest one of the tracks'.

    Raises:
      InputError: as `Task.of`, and if the tracks are not several different ones.
    """
    if not tracks or any(track not in TRACKS for track in tracks) or len(set(tracks)) < len(tracks):
        raise InputError(f"expected different tracks of {', '.join(TRACKS)}, found {', '.join(tracks) or 'none'}")
    context_size = options.pop("context_size", None) or 0
    tasks = [Task.of(track, **options) for track in tracks]
    context_size = context_size or max(task.context_size for task in tasks)
    tasks = [task.replace(context_size=context_size) for task in tasks]
    if context_size < MIN_CONTEXT_SIZE:
        raise InputError(f"expected context_size of at least {MIN_CONTEXT_SIZE}, found {context_size}")
    for task in tasks[1:]:
        task._keep_mazes_of(tasks[0])
    return tuple(tasks)


def check_names(options: Mapping[str, Any], arguments: Sequence[str] = ()) -> None:
    """Checks the names of options for `Task.of`, in a call that takes `arguments` too.

    Raises:
      UnknownOptionError: if there is no such option; it lists all that the call takes.
    """
    known = (*fields_of(Task), *arguments)
    for name in options:
        if name not in known:
            available = ", ".join(sorted(known))
            raise UnknownOptionError(f"got an unexpected keyword argument {name!r}; available: {available}")


def _asked(task: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the fields that options set by name; mazes that are values have been read."""
    check_names(options)
    given = {name: value for name, value in options.items() if value is not None}
    if "distances" in given and not np.size(given["distances"]):
        raise InputError("expected at least one distance, found none")
    if task not in (*KINDS_OF_TASK, *TRACKS):
        raise unknown("task", task, (*KINDS_OF_TASK, *TRACKS))
    if task in TRACKS:
        if given.setdefault("track", task) != task:
            raise InputError(f"expected one track, found {task!r} and {given['track']!r}")
        task = "local"
    if "mazes" in given and not isinstance(given["mazes"], str | pathlib.Path):
        reading = {name: given[name] for name in fields_of(ReadOptions) if name in given}
        given["mazes"] = own_mazes(as_mazes(given["mazes"]), ReadOptions(**reading))
    return {"task": task, **given}


def _complete(given: Mapping[str, Any], default_distances: tuple[int, ...] | None) -> Task:
    """Returns the task whose fields are `given`, with what is left open; checks all of it.

    `default_distances` are those in the benchmark's mazes; None for 1 to 5, in eval mazes 1 to 15.
    """
    asked = Task(**given)
    if asked.track is not None and _LIDAR not in asked.sensors:
        asked = asked.replace(sensors=(_LIDAR, *asked.sensors))
    _check_options(asked)
    mazes = asked.all_mazes
    _check_mazes(asked, mazes)

    # The mazes that were found, and the distances that fit them.
    found: dict[str, Any] = {"size": mazes[0].size, "cell_size": mazes[0].cell_size}
    if asked.is_drawn:
        found |= {"kinds": asked._drawn_kinds, "num_mazes": 0 if asked.fresh else asked.num_mazes or NUM_DRAWN}
    default_distances = default_distances or (EVAL_DISTANCES if asked.split == "eval" else TRAIN_DISTANCES)
    distances = _distances(asked, mazes, default_distances)
    if asked.num_ends == 2 and asked.distances not in ((), distances):
        raise InputError(f"start and goal are given; found distances {asked.distances}, which would be ignored")
    distances = asked.distances or distances

    time_limit = asked.time_limit
    if asked.track is None and not time_limit:
        cells = asked.landmark_distance if asked.task == "hierarchical" else max(distances)
        is_new = asked.has_own or asked.is_drawn
        time_limit = default_time_limit(cells, track=None, cell_size=mazes[0].cell_size, is_new=is_new)

    context_size = asked.context_size
    if not context_size:
        pixels = None if asked.track is None else TRACKS[asked.track].pixels_per_cell
        context_size = pixels * mazes[0].size if pixels else default_context_size(mazes[0].size)
        if pixels and context_size > MAX_CONTEXT_SIZE:
            raise InputError(
                f"track {asked.track!r}: expected mazes of at most {MAX_CONTEXT_SIZE // pixels} cells a side, "
                f"whose maps have at most {MAX_CONTEXT_SIZE} pixels, found {mazes[0].size}"
            )

    hide = tuple(name for name in HIDEABLE if name in asked.hide)
    task = dataclasses.replace(
        asked, **found, distances=distances, time_limit=time_limit, context_size=context_size, hide=hide
    )
    task._keep_mazes_of(asked)
    check_shown(task)
    checked: Sequence[Maze] = mazes  # type: ignore[assignment]
    if isinstance(mazes, FreshMazes):  # an episode whose maze is too small takes another one
        checked = (max((mazes[number] for number in range(_NUM_CHECKED)), key=task.farthest),)
    for maze in checked:
        check_distances(task, maze)
    return task


def _distances(task: Task, mazes: Mazes, default: tuple[int, ...]) -> tuple[int, ...]:
    """Returns the distances in cells of a task that names none."""
    of_track = DISTANCES if task.track is not None else ()
    if not task.has_own or isinstance(mazes, FreshMazes):
        return of_track or default

    # Of given ends, that between them.
    if task.scenarios is not None:
        return tuple(np.unique(task.scenarios.distances).tolist())
    if task.task == "hierarchical" or task.num_ends == 2:
        return tuple(sorted({task.farthest(maze) for maze in mazes}))

    # Of a track, those that all mazes have; all of its own, if none has any.
    farthest, count = min(map(task.farthest, mazes)), len(EVAL_DISTANCES)
    if of_track:
        return tuple(distance for distance in of_track if distance <= farthest) or of_track

    # Else at most 15, evenly spaced up to what all mazes have.
    if farthest > count:
        farthest = max(count, int(_FARTHEST_SHARE * farthest))
    count = min(count, farthest)
    return tuple(round(farthest * number / count) for number in range(1, count + 1))


def _check_options(task: Task) -> None:
    """Raises `InputError` if options contradict each other."""
    for name in ("sensors", "level", "kinds"):
        values = getattr(task, name)
        if len(set(values)) < len(values):
            raise InputError(f"expected each {name.rstrip('s')} once, found {', '.join(map(str, values))}")
    if not task.level:
        raise InputError("expected at least one level, found none")

    # Mazes.
    if task.fresh and task.num_mazes:
        raise InputError(f"expected no num_mazes beside fresh, found {task.num_mazes}")
    if task.is_drawn and task.mazes is not None:
        raise InputError("expected mazes of your own or mazes that are drawn, found both")
    if task.is_drawn and task.split == "eval":
        raise InputError("mazes that are drawn: expected split 'train' or 'dev', found 'eval'")
    for name, found in changed_reading(task).items():
        if task.mazes is None and (name, found) != ("cell_size", 1):
            raise InputError(f"expected mazes of your own with {name}, found none")

    # Episodes.
    if task.num_goals > 1 and (task.task != "local" or task.pairs != "random"):
        raise InputError(f"expected num_goals 1 unless the task is local and pairs are random, found {task.num_goals}")
    if task.num_ends and task.pairs == "fixed":
        raise InputError("expected pairs 'random' beside a start or a goal, found 'fixed', pairs of their own")
    if task.goal is not None and task.num_goals > 1:
        raise InputError(f"expected num_goals 1 beside a goal, found {task.num_goals}")
    if task.scenarios is not None:
        for name, value in {"start": None, "goal": None, "pairs": "random", "num_goals": 1, "track": None}.items():
            if (found := getattr(task, name)) != value:
                raise InputError(f"scenarios, which have starts and goals: expected {name} {value!r}, found {found!r}")
    if task.reward == PROGRESS and task.num_goals > 1:
        raise InputError(f"reward {PROGRESS!r}: expected num_goals 1 beside it, found {task.num_goals}")
    if task.lidar_noise is not None and _LIDAR not in task.sensors:
        found = ", ".join(task.sensors) or "none"
        raise InputError(f"lidar_noise {task.lidar_noise}: expected the sensor lidar, found {found}")
    if task.odometry_noise and (task.position_noise or task.exact_pose):
        beside = "exact_pose" if task.exact_pose else "position_noise"
        raise InputError(f"odometry_noise {task.odometry_noise:g}: expected no {beside} beside it, found it")
    if task.hide:
        _check_hidden(task)

    # Tracks.
    if task.track is not None:
        _check_track(task, task.track)
    elif task.exact_pose:
        raise InputError("exact_pose: expected a track whose pose is odometry beside it, found none")
    elif task.level != FIRST_LEVEL:
        levels = ", ".join(map(str, task.level))
        raise InputError(f"level {levels}: expected a track beside it, found none; tracks: {', '.join(TRACKS)}")


def _check_hidden(task: Task) -> None:
    """Raises `InputError` if something is hidden twice, or another option would tell it."""
    hidden = ",".join(task.hide)
    if len(set(task.hide)) < len(task.hide):
        raise InputError(f"expected each of {', '.join(HIDEABLE)} once to hide, found {hidden}")
    if task.task != "local":
        raise InputError(f"hide {hidden}: expected the task 'local', found {task.task!r}")
    if task.num_goals > 1:
        raise InputError(f"hide {hidden}: expected num_goals 1, found {task.num_goals}")
    cameras = [name for name in task.sensors if name != _LIDAR]
    telling = cameras if "goal" in task.hide else [name for name in cameras if name != "egocentric"]
    if telling:
        what = "where the goal is" if "goal" in task.hide else "the maze from above"
        raise InputError(f"hide {hidden}: expected sensors without {telling[0]!r}, which shows {what}")


def _check_track(task: Task, name: str) -> None:
    """Raises `InputError` if an option contradicts the track called `name`."""
    if task.mazes is None and not task.is_drawn and task.size not in (0, KINDS_SIZE):
        raise InputError(f"track {name!r}: expected size {KINDS_SIZE}, found {task.size}")
    if task.time_limit:
        raise InputError(f"track {name!r}: has its own time limit, found time_limit {task.time_limit}")
    for option, value in {"task": "local", "start": None, "goal": None, "pairs": "random", "num_goals": 1}.items():
        if (found := getattr(task, option)) != value:
            raise InputError(f"track {name!r}: expected {option} {value!r}, found {found!r}")
    for perturbation, strength in task.perturbations.items():
        if strength:
            raise InputError(f"track {name!r}: expected no perturbation, found {perturbation} {strength}")
    if task.exact_pose and not TRACKS[name].hides_pose:
        raise InputError(f"track {name!r}: expected no exact_pose, for the pose is exact; it belongs to lost poses")
    for sensor in _SHOWING_POSE if TRACKS[name].hides_pose else ():
        if sensor in task.sensors:
            raise InputError(f"track {name!r}: expected sensors without {sensor!r}, which shows where the body is")


def check_shown(task: Task) -> None:
    """Raises `InputError` if a map of the task's `context_size` can't be shown."""
    if task.track is None and task.context_size < MIN_CONTEXT_SIZE:
        raise InputError(
            f"expected context_size from {MIN_CONTEXT_SIZE} to {MAX_CONTEXT_SIZE}, found {task.context_size}"
        )
    if task.track is not None:
        context_size = TRACKS[task.track].pixels_per_cell * task.size
        if task.context_size != context_size:
            raise InputError(f"track {task.track!r}: expected context_size {context_size}, found {task.context_size}")


def _check_mazes(task: Task, mazes: Mazes) -> None:
    """Raises `InputError` if mazes are not of one size and scale, or the task can't be played in one of them."""
    if isinstance(mazes, FreshMazes):
        if task.textures:
            raise InputError("fresh mazes: expected no textures, which take long to make, found textures")
        for name in ENDS:
            if (end := getattr(task, name)) is not None:
                raise InputError(f"fresh mazes: expected no {name}, which may be a wall in one of them, found {end!r}")
        mazes.max_boxes  # noqa: B018 - raises if a kind can't make mazes of this size
        return
    require_one_size(mazes)
    name, cell_size = mazes[0].name, mazes[0].cell_size
    if cell_size < MIN_CELL_SIZE:
        raise InputError(
            f"{name}: expected cells of at least {MIN_CELL_SIZE} m, through which the body passes, "
            f"found {cell_size} m; {THIN_WALLS}"
        )
    if task.track is not None and cell_size != 1:
        raise InputError(f"track {task.track!r}: expected cells of 1 m, found {cell_size} m")
    for maze in mazes:
        check_maze(task, maze)


def check_maze(task: Task, maze: Maze) -> None:
    """Raises `InputError` if a maze has no two cells for a start and a goal, or the task's track does not take it."""
    if task.track is not None:
        TRACKS[task.track].require(maze, task.level)
    if len(maze.free_cells) < 2:
        raise InputError(f"{maze.name}: expected two free cells for a start and a goal, found one")
    start, goal = task.ends(maze)
    if start is not None and start == goal:
        raise InputError(f"{maze.name}: expected start and goal in different cells, found both in {start}")


def check_distances(task: Task, maze: Maze) -> None:
    """Raises `InputError` if no goal of the local task is as far away in a maze as wanted."""
    if task.scenarios is not None:
        if not len(task.scenarios.numbers(task.distances)):
            found = task.scenarios.distances
            raise InputError(
                f"{maze.name}: expected distances that scenarios have, from {found.min()} to {found.max()} cells, "
                f"found {', '.join(map(str, task.distances))}"[:200]
            )
        return
    if task.task != "local" or task.num_ends == 2:
        return
    if max(task.distances) > (farthest := task.farthest(maze)):
        raise InputError(
            f"{maze.name}: expected distances of at most {farthest} cells, as far as the maze reaches, "
            f"found {max(task.distances)}; choose others (--distances)"
        )
