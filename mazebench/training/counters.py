"""How far a training run is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

import pydantic


class Counters(pydantic.BaseModel):
    """How far a run is."""

    model_config = pydantic.ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    env_steps: pydantic.NonNegativeInt
    updates: pydantic.NonNegativeInt
    milestone_steps: pydantic.NonNegativeInt  # env_steps of the last milestone
    logged_steps: pydantic.NonNegativeInt  # env_steps of the last line of metrics
    logged_updates: pydantic.NonNegativeInt  # updates of that line
    loss_sums: dict[str, float]  # over the updates since then, by name

    @pydantic.model_validator(mode="after")
    def _check(self) -> Self:
        num_updates = self.updates - self.logged_updates
        if not self.milestone_steps <= self.logged_steps <= self.env_steps or num_updates < bool(self.loss_sums):
            raise ValueError("expected no milestone after the last step, and updates since then where there are losses")
        return self

    @property
    def is_milestone(self) -> bool:
        """Whether the run is at a milestone."""
        return self.env_steps == self.milestone_steps

    def after_steps(self, num_steps: int) -> Self:
        """Returns the counters after more agent steps."""
        return self.model_copy(update={"env_steps": self.env_steps + num_steps})

    def after_update(self, losses: Mapping[str, float]) -> Self:
        """Returns the counters after one more update, which returned `losses`."""
        sums = {name: self.loss_sums.get(name, 0.0) + value for name, value in losses.items()}
        return self.model_copy(update={"updates": self.updates + 1, "loss_sums": sums})

    def after_line(self) -> Self:
        """Returns the counters after a line of metrics was written here."""
        changes = {"logged_steps": self.env_steps, "logged_updates": self.updates, "loss_sums": {}}
        return self.model_copy(update=changes)

    def at_milestone(self) -> Self:
        """Returns the counters of a milestone here, which has a line of metrics."""
        return self.after_line().model_copy(update={"milestone_steps": self.env_steps})

    def mean_losses(self) -> dict[str, float]:
        """Returns the means over the updates since the last line of metrics, by name."""
        return {name: value / (self.updates - self.logged_updates) for name, value in self.loss_sums.items()}


BEGINNING = Counters(env_steps=0, updates=0, milestone_steps=0, logged_steps=0, logged_updates=0, loss_sums={})
