"""The options of a training run."""

from __future__ import annotations

import dataclasses
from typing import Annotated

from annotated_types import Ge, Interval

from mazebench.errors import InputError
from mazebench.options import Doc, OneOf, Options, Overrides
from mazebench.tasks.task_options import LOCAL
from mazebench.tasks.tracks import TRACKS

# Fields of a task for which trainings have one value only: the default, or the learner's.
FIXED = ("start", "goal", "landmark_distance", "split", "context_size", "num_goals", "actions")
NEAR = 8  # m, to goals on a track in the beginning
WIDEN_SHARE = 0.4  # of a run, after which goals are as far as they get
_LONGEST_MINUTES = 366 * 24 * 60  # a year


@dataclasses.dataclass(frozen=True, kw_only=True)
class TrainOptions(Options):
    """Options of a training: the agent, the values of its config, and the length of the run.

    Raises:
      InputError: if a value is not allowed, or the options don't say when to stop.
    """

    agent: str
    task: Annotated[
        tuple[Annotated[str, OneOf(LOCAL, *TRACKS)], ...],
        Doc(
            "local, or a track, a named way in which the map or the senses are imperfect; of several tracks, as "
            "building,rebuilt, for agents that can, each episode draws one."
        ),
    ] = (LOCAL,)
    minutes: Annotated[float | None, Interval(ge=0.01, le=_LONGEST_MINUTES), Doc("How long this command trains.")] = (
        None
    )
    env_steps: Annotated[int | None, Ge(1), Doc("Agent steps of the run, of all commands together.")] = None
    seed: Annotated[int, Interval(ge=0, le=2**63 - 1), Doc("Seed of everything that is drawn.")] = 0
    checkpoint_steps: Annotated[
        int, Ge(1), Doc("Agent steps between milestones: checkpoints with an evaluation, to resume from exactly.")
    ] = 200_000
    checkpoint_minutes: Annotated[
        float,
        Interval(ge=0, le=_LONGEST_MINUTES),
        Doc("Minutes between savepoints, which are saved between milestones, and when the run is stopped; 0 for none."),
    ] = 5.0
    eval_mazes: Annotated[int, Ge(1), Doc("Held-out mazes of an evaluation, with 10 episodes in each.")] = 20
    first_distance: Annotated[
        int | None,
        Ge(0),
        Doc(
            "Cells, on a track metres, that goals are away at most in the beginning; 0 for all distances at once. If "
            f"not given, {NEAR} on a track, else 0."
        ),
    ] = None
    widen_steps: Annotated[
        int | None,
        Ge(1),
        Doc(
            "Agent steps over which that grows to the farthest distance of the task; if not given, "
            f"{WIDEN_SHARE:g} of the run, by --minutes or --env-steps."
        ),
    ] = None
    overrides: Overrides = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(set(self.task)) < len(self.task):
            raise InputError(f"expected different tracks, found {', '.join(self.task)}")
        if self.minutes is None and self.env_steps is None:
            raise InputError("expected --minutes or --env-steps, found neither")
