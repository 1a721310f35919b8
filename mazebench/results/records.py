"""The record of an episode and the summary of an evaluation: what is written to disk, and checked when read back."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
import pydantic

from mazebench.maps.maze import MAX_SIZE, MIN_SIZE

_LARGEST = 2**53  # from here on, not every whole number is a float

Count = Annotated[int, pydantic.Field(ge=0, lt=_LARGEST)]
Length = Annotated[float, pydantic.Field(ge=0, lt=_LARGEST)]
Share = Annotated[float, pydantic.Field(ge=0, le=1)]
Size = Annotated[int, pydantic.Field(ge=MIN_SIZE, le=MAX_SIZE)]
Cell = tuple[Count, Count]
Name = Annotated[str, pydantic.Field(min_length=1, max_length=1000)]


class _Stored(pydantic.BaseModel):
    """Base of what is stored as JSON: values of the declared types, finite numbers, other keys kept."""

    model_config = pydantic.ConfigDict(frozen=True, extra="allow", strict=True, allow_inf_nan=False)


class Record(_Stored):
    """The result of one episode.

    The levels of the perturbations follow as further keys; on a track also `track`, `level` and its facts, such as
    `blocked`; in mazes whose cells are not 1 m wide also `cell_size`, in metres; where a user set them, `lidar_noise`
    and `odometry_noise`.
    """

    agent: Name
    task: Name
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

    def to_line(self) -> str:
        """Returns the record as a line of `episodes.jsonl`."""
        return json.dumps(self.model_dump(), separators=(",", ":"), allow_nan=False) + "\n"


class Figures(_Stored):
    """Means over some episodes with their 95 % intervals."""

    n: Count  # episodes
    success_rate: Share
    success_rate_ci95: tuple[Share, Share]
    spl: Share
    spl_ci95: tuple[Share, Share]
    spl_grid: Share
    spl_grid_ci95: tuple[Share, Share]
    # Episodes that are on time, by the factor as text ("1.25", "2"); None if the oracle's steps are not known.
    on_time: dict[str, Share] | None = None
    on_time_ci95: dict[str, tuple[Share, Share]] | None = None

    @property
    def means(self) -> dict[str, float]:
        """The means by the names of their metrics, such as "spl" and "on_time_1.25"."""
        on_time = {f"on_time_{factor}": share for factor, share in (self.on_time or {}).items()}
        return {"success_rate": self.success_rate, "spl": self.spl, "spl_grid": self.spl_grid} | on_time


class TaskProvenance(_Stored):
    """The options of an evaluation, as far as readers need them."""

    landmark_distance: Count
    seed: Count = 0
    start: Name | None = None
    goal: Name | None = None


class Provenance(_Stored):
    """The provenance of a result: versions, checkpoint, options, command, machine."""

    options: TaskProvenance
    task_version: int | None = None
    benchmark_manifest_sha256: str | None = None
    context_size: int = 0  # M
    mazes_sha256: str | None = None
    checkpoint_sha256: str | None = None
    agent_class: str | None = None  # as module:Class
    agent_package: str | None = None  # name and version; None for a `module:Class`
    agent_code_sha256: str | None = None  # of the package of an installed agent, of the file of a `module:Class`
    packages: dict[str, str | None] = {}
    command: list[str] = []
    python: str = "unknown"
    machine: dict[str, Any] = {}


class Summary(_Stored):
    """The result of one evaluation."""

    agent: Name
    privileged: bool = False  # whether the agent was given the true maze and pose
    untrained_scale: bool = False  # whether the agent learned on maps of another scale, in metres a cell of the context
    task: Name
    size: Size
    split: Name
    cell_size: Annotated[float, pydantic.Field(gt=0, lt=_LARGEST)] | None = None  # m, where it is not 1
    track: str | None = None
    level: int | None = None  # of the track
    lidar_noise: Name | None = None  # the option, where it was given: "turtlebot3", or as "0.1,0.05"
    odometry_noise: Share | None = None  # the option, where it was given
    hide: Name | None = None  # what the context did not show: "map", "goal" or "map,goal"
    exact_pose: bool = False  # whether the observed pose was the true one on a track whose pose is odometry
    suite: str | None = None  # of a part of a suite, with the part's name
    part: str | None = None
    benchmark: Name
    episodes: Annotated[int, pydantic.Field(ge=1, lt=_LARGEST)]
    perturbation: dict[str, Length]  # level by name
    provenance: Provenance
    overall: Figures
    by_distance: dict[str, Figures]
    by_fact: dict[str, Figures] = {}  # of the groups that a track tells apart: "blocked", "not blocked", kinds of mazes

    @property
    def who(self) -> str:
        """The agent, with what sets its result apart: "navigator without map", "oracle (privileged)"."""
        return self.row + (" (privileged)" if self.privileged else "")

    @property
    def row(self) -> str:
        """The agent, and what it was told less or more than others: "navigator without map"."""
        without = "" if self.hide is None else f" without {self.hide.replace(',', ' and ')}"
        return self.agent + without + (" with the true pose" if self.exact_pose else "")

    @property
    def senses(self) -> tuple[str, ...]:
        """The noise on the senses that a user set, in words."""
        noise = {"lidar noise": self.lidar_noise, "odometry noise": self.odometry_noise}
        return tuple(f"{name} {value}" for name, value in noise.items() if value is not None)

    def to_dict(self) -> dict[str, Any]:
        """Returns the content of `summary.json`."""
        optional = {"untrained_scale", "cell_size", "hide", "exact_pose", "lidar_noise", "odometry_noise"}
        optional |= {"suite", "part", "track", "level", "by_fact"}
        defaults = {name: field.default for name, field in Summary.model_fields.items() if name in optional}
        return {key: value for key, value in self.model_dump().items() if key not in optional or value != defaults[key]}


def column(records: Sequence[Record], name: str) -> np.ndarray:
    """Returns `[E, ...]`: one field of all records."""
    return np.array([getattr(record, name) for record in records])
