"""The progress of a training run in steps and updates."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Self


@dataclasses.dataclass(frozen=True)
class Counters:
    """The progress of a run in steps and updates."""

    env_steps: int = 0
    updates: int = 0
    milestone_steps: int = 0  # env_steps of the last milestone
    logged_steps: int = 0  # env_steps of the last line of metrics
    loss_sums: Mapping[str, float] = dataclasses.field(default_factory=dict)  # over the updates since then, by name
    loss_counts: Mapping[str, int] = dataclasses.field(default_factory=dict)  # of these updates, those with the loss

    @property
    def is_milestone(self) -> bool:
        """True if the run is at a milestone."""
        return self.env_steps == self.milestone_steps

    def after_update(self, losses: Mapping[str, float]) -> Self:
        """Returns the counters after one more update, which returned `losses`."""
        sums = {name: self.loss_sums.get(name, 0.0) + value for name, value in losses.items()}
        counts = {name: self.loss_counts.get(name, 0) + 1 for name in losses}
        return dataclasses.replace(
            self,
            updates=self.updates + 1,
            loss_sums={**self.loss_sums, **sums},
            loss_counts={**self.loss_counts, **counts},
        )

    def after_line(self) -> Self:
        """Returns the counters after a line of metrics was written here."""
        return dataclasses.replace(self, logged_steps=self.env_steps, loss_sums={}, loss_counts={})

    def at_milestone(self) -> Self:
        """Returns the counters of a milestone here, which has a line of metrics."""
        return dataclasses.replace(self.after_line(), milestone_steps=self.env_steps)

    def mean_losses(self) -> dict[str, float]:
        """Returns the means over the updates since the last line of metrics that had the loss, by name."""
        return {name: value / self.loss_counts[name] for name, value in self.loss_sums.items()}
