"""The record of an episode and the summary of an evaluation: what is written to disk, and checked when read back."""

from __future__ import annotations

import collections
from collections.abc import Sequence
from typing import Annotated, Any, Self

import numpy as np
import pydantic

from mazebench.errors import one_line
from mazebench.maps.maze import MAX_SIZE, MIN_SIZE
from mazebench.results.naming import sensors_in_words
from mazebench.storage.json_files import to_line
from mazebench.tasks.sensors import LIDAR
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import TRACKS, distance_of

_LARGEST = 2**53  # from here on, not every whole number is a float

Count = Annotated[int, pydantic.Field(ge=0, lt=_LARGEST)]
Length = Annotated[float, pydantic.Field(ge=0, lt=_LARGEST)]
Share = Annotated[float, pydantic.Field(ge=0, le=1)]
Size = Annotated[int, pydantic.Field(ge=MIN_SIZE, le=MAX_SIZE)]
Cell = tuple[Count, Count]
# The options of a task, as JSON has them.
StoredTask = Annotated[
    pydantic.InstanceOf[TaskOptions],
    pydantic.BeforeValidator(lambda task: TaskOptions.from_json(task) if isinstance(task, dict) else task),
]
Name = Annotated[str, pydantic.Field(min_length=1, max_length=1000), pydantic.AfterValidator(one_line)]


def _printing(value: Any) -> Any:
    """Returns a value of JSON with what does not print escaped, such as commands to a terminal."""
    if isinstance(value, str):
        return one_line(value)
    if isinstance(value, dict):
        return {one_line(name) if isinstance(name, str) else name: _printing(each) for name, each in value.items()}
    return type(value)(map(_printing, value)) if type(value) in (list, tuple) else value


class _Stored(pydantic.BaseModel):
    """Base of what is stored as JSON: values of the declared types, finite numbers, other keys kept."""

    model_config = pydantic.ConfigDict(frozen=True, extra="allow", strict=True, allow_inf_nan=False)

    @pydantic.model_validator(mode="after")
    def _escape(self) -> Self:
        """Escapes what does not print in all texts and names of keys, but for an agent's own `notes`."""
        for values in (self.__dict__, self.__pydantic_extra__ or {}):
            escaped = {one_line(name): value if name == "notes" else _printing(value) for name, value in values.items()}
            values.clear()
            values.update(escaped)
        return self


class Record(_Stored):
    """The result of one episode, or of one leg of an episode with several goals.

    The strengths of the perturbations follow as further keys; on a track also `level` and its facts, such as
    `blocked`; in mazes whose cells are not 1 m wide also `cell_size`, in metres; where a user set them, `lidar_noise`
    and `odometry_noise`; of an agent that reports also `metrics.RECALLS` and `notes`. With several goals, `after_miss`
    says whether the goal before was missed: then the leg began where the body was.
    """

    agent: Name
    task: Name  # "local", "hierarchical" or the track
    size: Size  # N, cells a side of the maze
    split: Name  # "train", "eval", or "custom" for mazes, a start or a goal of one's own
    episode: Count  # index in the protocol's order
    maze: Name
    start: Cell  # (row, column)
    goal: Cell
    distance: Count  # cells from start to goal
    success: bool
    steps: Count  # agent steps
    path_length: Length  # m, driven
    shortest_path: Length  # m, of the body as a disc
    spl: Share  # by `shortest_path`
    spl_grid: Share  # by `distance`, in metres
    seed: Count  # of the episode: flips, warp, noise
    leg: Annotated[int, pydantic.Field(ge=1, lt=_LARGEST)]  # of the episode's goals, counted from 1
    oracle_steps: Annotated[int, pydantic.Field(ge=1, lt=_LARGEST)] | None  # None where the oracle missed the goal

    @property
    def asked_distance(self) -> int:
        """The distance as the option `distances` counts it: in metres on a track, else in cells."""
        cell_size = (self.model_extra or {}).get("cell_size", 1.0)
        return distance_of(self.distance, cell_size, self.task if self.task in TRACKS else None)

    @property
    def after_missed_goal(self) -> bool:
        """True of a leg that begins where the body was when the time to the goal before was up."""
        return (self.model_extra or {}).get("after_miss") is True

    def to_line(self) -> str:
        """Returns the record as a line of `episodes.jsonl`."""
        return to_line(self.model_dump())


class Figures(_Stored):
    """Means over some episodes with their 95 % intervals. Further metrics follow as further keys."""

    n: Count  # episodes
    success_rate: Share
    success_rate_ci95: tuple[Share, Share]
    spl: Share
    spl_ci95: tuple[Share, Share]
    spl_grid: Share
    spl_grid_ci95: tuple[Share, Share]
    on_time: dict[str, Share]  # by the factor of the oracle's steps as text: "1.25", "2"
    on_time_ci95: dict[str, tuple[Share, Share]]
    recall: dict[str, Share] = {}  # by the names of recalls; left out where no poses were reported
    recall_ci95: dict[str, tuple[Share, Share]] = {}


class Provenance(_Stored):
    """The provenance of a result: versions, checkpoint, seed, command, machine."""

    seed: Count
    episodes_per_distance: Count | None  # None: 48 in each maze
    task_version: int
    looks_version: int | None = None  # of pictures in `varied`; None also where version 1 drew them
    benchmark_manifest_sha256: str
    mazes_sha256: str
    checkpoint_sha256: str | None
    map_reader_sha256: str | None = None  # of the file that `Agent.map_reader` names; left out where it names none
    agent_class: str  # as module:Class
    agent_package: str | None  # name and version; None for a `module:Class`
    agent_code_sha256: str | None  # of the agent's files, see `code_hash`; None where it is in no file
    packages: dict[str, str | None]
    command: list[str]
    python: str
    machine: dict[str, Any]


class PairFigures(_Stored):
    """The agreement of a maze with the older map that was shown of it, as `mazebench.maps.pair.Pair` has it."""

    covered: Share
    wall_now: Length  # m2, as the other two
    free_now: Length
    on_one_map: Length
    pose: tuple[float, float, float] | None = None  # x, y (m), yaw (rad), if the option `align` found it


class Summary(_Stored):
    """The result of one evaluation."""

    agent: Name
    privileged: bool  # whether the agent was given the true maze and pose
    untrained_scale: bool = False  # whether the agent learned on maps of another scale, in metres a cell of the context
    config: dict[str, Any] = {}  # values of the agent's config that are not the default ones and may change results
    task: StoredTask  # as this agent played it
    suite: Name | None = None  # of a part of a suite, with the part's name
    part: Name | None = None
    benchmark: Name
    episodes: Annotated[int, pydantic.Field(ge=1, lt=_LARGEST)]
    provenance: Provenance
    overall: Figures
    by_distance: dict[str, Figures]
    pairs: dict[Name, PairFigures] = {}  # by maze, of the older maps that were shown
    counts: dict[str, int | float] = {}  # sums of the whole numbers that the agent noted of episodes, and of money
    by_fact: dict[str, Figures] = {}  # of the groups that a track tells apart: "blocked", "not blocked", kinds of mazes

    @property
    def who(self) -> str:
        """The agent, with what sets its result apart: "navigator without map", "oracle (privileged)"."""
        return self.row + (" (privileged)" if self.privileged else "")

    @property
    def row(self) -> str:
        """The agent with what sets its result apart, except for privileges: "navigator without map".

        These are values of its config, its actions unless it has the six, its sensors unless they are the task's own
        (the lidar on a track), and what it was told less or more.
        """
        config = "".join(f" {name}={value}" for name, value in self.config.items())
        acting = "" if self.task.actions in (None, "six") else f" with {self.task.actions} actions"
        sensors = sensors_in_words(self.task)
        acting += "" if sensors == (LIDAR if self.task.track else "") else f" with {sensors}"
        without = f" without {' and '.join(self.task.hide)}" if self.task.hide else ""
        return self.agent + config + acting + without + (" with the true pose" if self.task.exact_pose else "")

    def to_dict(self) -> dict[str, Any]:
        """Returns the content of `summary.json`."""
        values = self.model_dump(exclude={"task"}, exclude_defaults=True)
        return {"agent": self.agent, "task": self.task.to_json(), **values}


def counts_in(records: Sequence[Record]) -> dict[str, int]:
    """Returns sums of the whole numbers in the agent's notes; of several goals, the last leg has those of all."""
    last = {record.episode: (record.model_extra or {}).get("notes") for record in records}
    counts: collections.Counter[str] = collections.Counter()
    for notes in last.values():
        counts.update(
            {name: value for name, value in notes.items() if type(value) is int} if isinstance(notes, dict) else {}
        )
    return dict(counts)


def column(records: Sequence[Record], name: str) -> np.ndarray:
    """Returns `[E, ...]`: one field of all records."""
    return np.array([getattr(record, name) for record in records])
