"""The options of a training run."""

from __future__ import annotations

import dataclasses
from typing import Any

from mazebench.errors import InputError
from mazebench.options import option, options_of
from mazebench.tasks.options import TaskOptions

# Options of a task for which trainings have one value only; the agent chooses context size and number of goals.
FIXED = {
    "task": "local",
    "start": None,
    "goal": None,
    "num_goals": 1,
    "continuous": False,
    "context_size": 0,
    "landmark_distance": 5,
}
_LONGEST_MINUTES = 366 * 24 * 60  # a year


@dataclasses.dataclass(frozen=True, kw_only=True)
class TrainOptions(TaskOptions):
    """What is trained, in which task, and for how long.

    Raises:
      InputError: if a value is not allowed, the options don't say when to stop, or they name a cluster for no workers.
    """

    agent: str = dataclasses.field(kw_only=False)
    overrides: tuple[tuple[str, str], ...] = ()  # values of the agent's config, by name
    size: int | None = option(
        None,
        "Cells a side of the benchmark's training mazes: 13 (if not given), 15, 17, 19 or 21; a track has its own.",
    )
    distances: tuple[int, ...] = option(
        (), "Cells from start to goal, as 1-5,8; if not given, the agent's, 1-5 or those of the track.", lowest=1
    )
    minutes: float | None = option(None, "How long this sitting lasts.", lowest=0.01, highest=_LONGEST_MINUTES)
    env_steps: int | None = option(None, "Agent steps of the run, all sittings together.", lowest=1)
    seed: int = option(0, "Seed of everything that is drawn.", lowest=0, highest=2**63 - 1)
    checkpoint_steps: int = option(
        200_000, "Agent steps between milestones: checkpoints with an evaluation, to resume from exactly.", lowest=1
    )
    checkpoint_minutes: float = option(
        5.0,
        "Minutes between savepoints, which are saved between milestones, and when the run is stopped; 0 for none.",
        lowest=0,
        highest=_LONGEST_MINUTES,
    )
    eval_mazes: int = option(20, "Held-out mazes of an evaluation, with 10 episodes in each.", lowest=1)
    workers: int = option(0, "Ray actors that collect; 0 collects in this process.", lowest=0)
    ray_address: str | None = option(None, "Address of a Ray cluster for the workers; local if not given.")

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, value in FIXED.items():
            if getattr(self, name) != value:
                raise InputError(f"expected {name} {value!r} in a training, found {getattr(self, name)!r}")
        if self.minutes is None and self.env_steps is None:
            raise InputError("expected --minutes or --env-steps, found neither")
        if self.ray_address is not None and not self.workers:
            raise InputError("--ray-address needs --workers, the number of actors on the cluster")

    @property
    def chosen_task(self) -> dict[str, Any]:
        """The options of the task that differ from their defaults."""
        fields = {field.name: field for field in dataclasses.fields(self) if field.name in options_of(TaskOptions)}
        values = {name: getattr(self, name) for name in fields}
        return {name: value for name, value in values.items() if value != fields[name].default}


# Of the command line: all but the agent, its config and the fixed options; those of the task last.
TRAIN_CHOICES = tuple(
    sorted(
        (name for name in options_of(TrainOptions) if name not in FIXED),
        key=lambda name: name not in TrainOptions.__annotations__,
    )
)
