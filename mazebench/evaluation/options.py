"""What is evaluated: the agent, the episodes and the task."""

from __future__ import annotations

import dataclasses
import pathlib

from mazebench.constants import EPISODES_PER_DISTANCE
from mazebench.errors import InputError
from mazebench.maps.benchmark import SPLITS, TRACKS_VERSION, VERSION
from mazebench.maps.options import MAP_OPTIONS, MapOptions
from mazebench.options import Options, option, options_of
from mazebench.tasks.mazes import load_task_mazes
from mazebench.tasks.options import EVAL_DISTANCES, TaskOptions
from mazebench.tasks.own import own_task
from mazebench.tasks.spec import TaskSpec
from mazebench.tasks.tracks import TRACKS

NUM_ENVS = 256  # environments side by side in a process, unless another number is asked for
# Options of a task for which evaluations have one value only.
FIXED = {"pairs": "random", "num_goals": 1, "continuous": False, "context_size": 0}


@dataclasses.dataclass(frozen=True, kw_only=True)
class EvalOptions(MapOptions, TaskOptions):
    """What is evaluated. Two runs with equal options give the same `episodes.jsonl`.

    Raises:
      InputError: if a value is out of its range.
    """

    agent: str = dataclasses.field(kw_only=False)
    size: int | None = option(
        None, "Cells a side of the benchmark's mazes: 13 (if not given), 15, 17, 19 or 21; a track has its own."
    )
    split: str = option("eval", "The benchmark's unseen mazes, or its training mazes.", choices=SPLITS)
    maps: str | None = option(None, "Mazes of your own: a text, picture, array or ROS map, or a folder of them.")
    distances: tuple[int, ...] = option(
        (),
        "Cells from start to goal, as 1-5,8,10 (local task); if not given, 1-15, those of the track, or as far as maps "
        "of your own reach.",
        lowest=1,
    )
    episodes_per_distance: int = option(
        EPISODES_PER_DISTANCE, "Episodes for each maze and distance (local task).", lowest=1
    )
    checkpoint: str | None = option(None, "A learned agent's checkpoint or run folder; the shipped one if not given.")
    seed: int = option(0, "Seed of what the agent draws, and of episodes that are not frozen.", lowest=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, value in FIXED.items():
            if getattr(self, name) != value:
                raise InputError(f"expected {name} {value!r} in an evaluation, found {getattr(self, name)!r}")
        if len(self.level) > 1:
            found = ", ".join(map(str, self.level))
            raise InputError(f"expected one level in an evaluation, found {found}; the suite 'tracks' plays all levels")
        own = EVAL_DISTANCES if self.track is None else TRACKS[self.track].distances(self.level[0])
        if self.is_own:
            return  # the mazes tell which distances there are
        if not self.distances:
            object.__setattr__(self, "distances", own)
        elif self.track is not None and self.is_frozen and not set(self.distances) <= set(own):
            other = ", ".join(str(distance) for distance in self.distances if distance not in own)
            raise InputError(
                f"track {self.track!r}, level {self.level[0]}: expected distances from {own[0]} to {own[-1]}, "
                f"those of the frozen episodes, found {other}"
            )

    @property
    def is_own(self) -> bool:
        """Whether mazes, start or goal are not the benchmark's."""
        return self.maps is not None or self.ends_given > 0

    @property
    def is_frozen(self) -> bool:
        """Whether the benchmark's eval mazes are asked for, which have frozen episodes."""
        return not self.is_own and self.split == "eval"

    @property
    def benchmark(self) -> str:
        """The version of the benchmark that the evaluation belongs to."""
        return VERSION if self.track is None else TRACKS_VERSION


@dataclasses.dataclass(frozen=True, kw_only=True)
class RunOptions(Options):
    """How an evaluation is run, which makes no difference to its results.

    Raises:
      InputError: if a value is not allowed.
    """

    resume: bool = option(False, "Go on with the run in the folder.")
    record: bool = option(False, "Write trajectories too.")
    num_envs: int = option(NUM_ENVS, "Environments side by side in each process, at most.", lowest=1)
    workers: int = option(0, "Processes; 0 runs in this one.", lowest=0)
    ray_address: str | None = option(None, "Address of a Ray cluster for the workers.")


# What is played, as the command line has it: all but the fixed options, the agent's own and the seed.
TASK_CHOICES = tuple(name for name in options_of(EvalOptions) if name not in (*FIXED, "checkpoint", "seed"))


def make_task(options: EvalOptions) -> TaskSpec:
    """Returns the task that `options` name; reads its mazes."""
    values = {field.name: getattr(options, field.name) for field in dataclasses.fields(TaskOptions)}
    maps = None if options.maps is None else pathlib.Path(options.maps)
    map_options = MapOptions(**{name: getattr(options, name) for name in MAP_OPTIONS})
    mazes = load_task_mazes(options, options.size, options.split, maps, map_options)
    if options.is_own:
        return own_task(mazes, **values | {"distances": options.distances or None})
    return TaskSpec(mazes=mazes, **values)
