"""The options of a training run."""

from __future__ import annotations

import dataclasses

from mazebench.errors import InputError


@dataclasses.dataclass(frozen=True)
class TrainOptions:
    """What is trained, and for how long.

    Raises:
      InputError: if the options don't say when to stop, or name a cluster for no workers.
    """

    agent: str
    size: int = 13
    pairs: str = "random"  # or "fixed": one start-goal pair a maze, the paper's extremely-low-data regime
    seed: int = 0
    overrides: tuple[tuple[str, str], ...] = ()  # values of the agent's config, by name
    minutes: float | None = None  # of this sitting
    env_steps: int | None = None  # of the run, all sittings together
    checkpoint_steps: int = 200_000  # agent steps between checkpoints, each with an evaluation
    eval_mazes: int = 20  # held-out mazes of an evaluation, with 10 episodes each
    workers: int = 0  # Ray actors that collect; 0 collects in this process
    ray_address: str | None = None  # of a cluster; None starts one on this machine

    def __post_init__(self) -> None:
        if self.minutes is None and self.env_steps is None:
            raise InputError("expected --minutes or --env-steps, found neither")
        if self.ray_address is not None and not self.workers:
            raise InputError("--ray needs --workers, the number of actors on the cluster")
