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
    """What came of one episode.

    The levels of the perturbations follow as further keys; on a track also `track`, `level` and its facts, such as
    `blocked`; in mazes whose cells are not 1 m wide also `cell_size`, in metres.
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
    spl_relative: Length | None = None  # SPL divided by the oracle's on the same episodes; None if that is not known


class TaskProvenance(_Stored):
    """The options of an evaluation, as far as readers need them."""

    landmark_distance: Count
    seed: Count = 0
    start: Name | None = None
    goal: Name | None = None


class Provenance(_Stored):
    """Where a result came from: versions, checkpoint, options, command, machine."""

    options: TaskProvenance
    task_version: int | None = None
    benchmark_manifest_sha256: str | None = None
    mazes_sha256: str | None = None
    checkpoint_sha256: str | None = None
    agent_class: str | None = None  # as module:Class
    agent_package: str | None = None  # name and version; None for a `module:Class`
    agent_code_sha256: str | None = None  # of the package of an installed agent, of the file of a `module:Class`
    packages: dict[str, str | None] = {}


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
    suite: str | None = None  # of a part of a suite, with the part's name
    part: str | None = None
    benchmark: Name
    episodes: Annotated[int, pydantic.Field(ge=1, lt=_LARGEST)]
    perturbation: dict[str, Length]  # level by name
    provenance: Provenance
    overall: Figures
    by_distance: dict[str, Figures]
    by_fact: dict[str, Figures] = {}  # of what the track says of each episode, as "blocked" and "not blocked"

    def to_dict(self) -> dict[str, Any]:
        """Returns the content of `summary.json`."""
        optional = ("untrained_scale", "cell_size", "suite", "part", "track", "level", "by_fact")
        return {key: value for key, value in self.model_dump().items() if not (key in optional and not value)}


def column(records: Sequence[Record], name: str) -> np.ndarray:
    """Returns `[E, ...]`: one field of all records."""
    return np.array([getattr(record, name) for record in records])
