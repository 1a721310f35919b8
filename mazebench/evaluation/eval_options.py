"""The options of an evaluation, and of its run."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from annotated_types import Ge, Interval

from mazebench.constants import EPISODES_PER_DISTANCE, FROZEN_PER_MAZE
from mazebench.errors import InputError
from mazebench.options import Doc, Options, Overrides, ReadBy, options_in
from mazebench.tasks.task import Task, as_asked, options_of
from mazebench.tasks.task_options import TaskOptions

if TYPE_CHECKING:
    from mazebench.tasks.trials import Trial

EPISODES = ("episodes_per_distance", "episodes_per_maze")  # fields that say how many episodes there are
MOST_RECORDED = 200  # episodes of which trajectories are written unless one says so
NUM_ENVS = 256  # environments side by side in a process, unless another number is asked for


@dataclasses.dataclass(frozen=True, kw_only=True)
class EvalOptions(Options):
    """An agent, the task that it is evaluated in, and which episodes. Equal options give the same `episodes.jsonl`.

    Raises:
      InputError: if a value is not allowed.
    """

    agent: str
    task: TaskOptions
    episodes_per_distance: Annotated[
        int | None,
        Ge(1),
        Doc(
            f"Episodes for each maze and distance (local task); {EPISODES_PER_DISTANCE} if not given. In mazes of your "
            "own, a track has 48 episodes a maze if not given. The frozen ones of a track are all played."
        ),
    ] = None
    episodes_per_maze: Annotated[
        int | None,
        Interval(ge=1, le=FROZEN_PER_MAZE),
        Doc("Of a track's frozen episodes, so many in each maze; all if not given."),
    ] = None
    checkpoint: Annotated[
        str | None, Doc("A learned agent's checkpoint or run folder; the shipped one if not given.")
    ] = None
    seed: Annotated[
        int, Interval(ge=0, le=2**53 - 1), Doc("Seed of what the agent draws, and of episodes that are not frozen.")
    ] = 0
    overrides: Overrides = dataclasses.field(default_factory=dict)


def eval_options(agent: str, task: str | Task | TaskOptions = "local", **options: Any) -> EvalOptions:
    """Returns the options of an evaluation, given by name with those of its task.

    Raises:
      InputError: if there is no such option, or a value is not allowed.
    """
    of_evaluation = options_in(options, EvalOptions)
    of_task = {name: value for name, value in options.items() if name not in of_evaluation}
    return EvalOptions.of(of_evaluation, agent=agent, task=options_of(as_asked(task, of_task)))


def read_cluster(cluster: str | None) -> str | None:
    """Returns the name of a cluster.

    Raises:
      InputError: if it is not one of Ray.
    """
    if cluster not in (None, "ray") and not str(cluster).startswith("ray://"):
        raise InputError(f"expected --cluster ray or ray://HOST:PORT, found {cluster!r}")
    return cluster


@dataclasses.dataclass(frozen=True, kw_only=True)
class RunOptions(Options):
    """Options of the run of an evaluation, which make no difference to its results.

    Raises:
      InputError: if a value is not allowed.
    """

    resume: Annotated[bool, Doc("Go on with the run in --out.")] = False
    record: Annotated[
        bool | None,
        Doc(f"Write trajectories too; by default, suites do, and so do evaluations of up to {MOST_RECORDED} episodes."),
    ] = None
    num_envs: Annotated[int, Ge(1), Doc("Environments side by side in each process, at most.")] = NUM_ENVS
    workers: Annotated[int, Ge(0), Doc("Processes; 0 runs in this one.")] = 0
    cluster: Annotated[
        str | None,
        ReadBy(read_cluster),
        Doc("Run on the Ray cluster of this machine, ray, or on that at ray://HOST:PORT; --workers tasks at once."),
    ] = None


class Shard(NamedTuple):
    """One of the shares into which a run is cut, by mazes."""

    number: int  # from 1
    of: int

    def numbers(self, trials: Sequence[Trial], position: int = 0) -> list[int]:
        """Returns the episodes of the evaluation at some position in a run, all those of a maze or none."""
        in_turn = (self.number - 1 - position) % self.of
        return [number for number, trial in enumerate(trials) if trial.episode.maze % self.of == in_turn]


WHOLE = Shard(1, 1)
