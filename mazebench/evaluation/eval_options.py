"""The options of an evaluation, and of its run."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any

from annotated_types import Ge

from mazebench.constants import EPISODES_PER_DISTANCE
from mazebench.errors import InputError
from mazebench.maps.benchmark import FROZEN_SPLITS, PAPER_BENCHMARK, TRACKS_BENCHMARK
from mazebench.maps.maze_options import MazeOptions
from mazebench.options import Doc, fields_of, from_names, options
from mazebench.tasks.task_options import TaskOptions, Variants, is_own
from mazebench.tasks.tracks.track import DISTANCES

NUM_ENVS = 256  # environments side by side in a process, unless another number is asked for


@options
class EvalOptions:
    """Options of an evaluation. Two runs with equal options give the same `episodes.jsonl`.

    Raises:
      InputError: if a value is not allowed.
    """

    agent: str = dataclasses.field(kw_only=False)
    task: TaskOptions = TaskOptions()
    maze_options: MazeOptions = MazeOptions(split="eval")
    episodes_per_distance: Annotated[int, Ge(1), Doc("Episodes for each maze and distance (local task).")] = (
        EPISODES_PER_DISTANCE
    )
    checkpoint: Annotated[
        str | None, Doc("A learned agent's checkpoint or run folder; the shipped one if not given.")
    ] = None
    seed: Annotated[int, Ge(0), Doc("Seed of what the agent draws, and of episodes that are not frozen.")] = 0

    @classmethod
    def of(cls, agent: str, **values: Any) -> EvalOptions:
        """Returns the options of an agent's evaluation; `values` are those of the task, the mazes and these, by name.

        They may include what evaluations don't vary, as the provenance of a summary does.

        Raises:
          InputError: if a name is unknown or a value is not allowed.
        """
        for name, option in fields_of(Variants).items():
            if (found := values.pop(name, option.default)) != option.default:
                raise InputError(f"expected {name} {option.default!r} in an evaluation, found {found!r}")
        return from_names(cls, values, agent=agent)

    def __post_init__(self) -> None:
        track, level = self.task.track, self.task.level
        if not isinstance(self.maze_options.mazes, str | None):
            raise InputError(
                f"expected mazes as a path in an evaluation, found {type(self.maze_options.mazes).__name__}"
            )
        if self.maze_options.fresh:
            raise InputError("expected no fresh mazes in an evaluation; num_mazes says how many of each kind are drawn")
        if len(level) > 1:
            found = ", ".join(map(str, level))
            raise InputError(f"expected one level in an evaluation, found {found}; the suite 'tracks' has all levels")
        other = ", ".join(str(distance) for distance in self.task.distances if distance not in DISTANCES)
        if track is not None and self.is_frozen and other:
            raise InputError(
                f"track {track!r}: expected distances from {DISTANCES[0]} to {DISTANCES[-1]}, "
                f"those of the frozen episodes, found {other}"
            )

    @property
    def is_own(self) -> bool:
        """True if mazes, start or goal are not the benchmark's."""
        return is_own(self.task, self.maze_options) or self.maze_options.is_drawn

    @property
    def is_frozen(self) -> bool:
        """True if mazes of the benchmark are asked for whose episodes are frozen."""
        return not self.is_own and self.maze_options.split in FROZEN_SPLITS

    @property
    def benchmark(self) -> str:
        """The benchmark that the evaluation belongs to."""
        return PAPER_BENCHMARK if self.task.track is None else TRACKS_BENCHMARK


@options
class RunOptions:
    """Options of the run of an evaluation, which make no difference to its results.

    Raises:
      InputError: if a value is not allowed.
    """

    resume: Annotated[bool, Doc("Go on with the run in --out.")] = False
    record: Annotated[bool | None, Doc("Write trajectories too; a suite does by default.")] = None
    num_envs: Annotated[int, Ge(1), Doc("Environments side by side in each process, at most.")] = NUM_ENVS
    workers: Annotated[int, Ge(0), Doc("Processes; 0 runs in this one, and with --ray on all its CPUs.")] = 0
    ray: Annotated[bool, Doc("Run the workers on Ray; without an address, on this machine.")] = False
    ray_address: Annotated[
        str | None, Doc("Address of a Ray cluster for the workers; auto finds one that runs here.")
    ] = None

    @property
    def cluster(self) -> str | None:
        """The address of the Ray cluster, "local" for one on this machine; None to run without Ray."""
        return self.ray_address or ("local" if self.ray else None)
