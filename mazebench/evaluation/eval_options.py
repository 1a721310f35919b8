"""The options of an evaluation, and of its run."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Annotated, Unpack

from annotated_types import Ge, Interval

from mazebench.constants import EPISODES_PER_DISTANCE
from mazebench.errors import InputError
from mazebench.options import Doc, options
from mazebench.tasks.task import Task, evaluation_task
from mazebench.tasks.task_fields import TaskOptions
from mazebench.tasks.tracks import DISTANCES

NUM_ENVS = 256  # environments side by side in a process, unless another number is asked for


@options
class EvalOptions:
    """An agent, the task that it is evaluated in, and which episodes. Equal options give the same `episodes.jsonl`.

    Raises:
      InputError: if a value is not allowed.
    """

    agent: str = dataclasses.field(kw_only=False)
    task: Task = dataclasses.field(kw_only=False)
    episodes_per_distance: Annotated[
        int, Ge(1), Doc("Episodes for each maze and distance (local task); the frozen ones of a track are all played.")
    ] = EPISODES_PER_DISTANCE
    checkpoint: Annotated[
        str | None, Doc("A learned agent's checkpoint or run folder; the shipped one if not given.")
    ] = None
    seed: Annotated[
        int, Interval(ge=0, le=2**53 - 1), Doc("Seed of what the agent draws, and of episodes that are not frozen.")
    ] = 0

    @classmethod
    def of(
        cls,
        agent: str,
        task: str | Task = "local",
        *,
        episodes_per_distance: int = EPISODES_PER_DISTANCE,
        checkpoint: str | pathlib.Path | None = None,
        seed: int = 0,
        **options: Unpack[TaskOptions],
    ) -> EvalOptions:
        """Returns the options of an evaluation in a task, or in the one that `evaluation_task` makes of its options.

        Raises:
          InputError: if a name is unknown or a value is not allowed.
        """
        if isinstance(task, Task) and options:
            raise InputError(f"expected no options beside a Task, found {next(iter(options))}")
        return cls(
            agent,
            task if isinstance(task, Task) else evaluation_task(task, **options),
            episodes_per_distance=episodes_per_distance,
            checkpoint=checkpoint,  # type: ignore[arg-type]  # a path becomes text
            seed=seed,
        )

    def __post_init__(self) -> None:
        task = self.task
        other = ", ".join(str(distance) for distance in task.distances if distance not in DISTANCES)
        if task.track is not None and task.frozen_split is not None and other:
            raise InputError(
                f"track {task.track!r}: expected distances from {DISTANCES[0]} to {DISTANCES[-1]}, "
                f"those of the frozen episodes, found {other}"
            )


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
