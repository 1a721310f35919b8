"""The parts of learners from rollouts: what a step keeps, the rows of a rollout, and minibatches of them.

`B` is the number of environments, `R` of steps in all of them together, `G` of grids or maps that these are on.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import torch

from mazebench.options import Options
from mazebench.training.experience import Experience

from . import config_values
from .actor import NetworkAgent, one_torch_thread
from .config_values import Count, Factor, Length
from .descent import Descent, in_numbers
from .learner import NetworkLearner

_LEAST_RATE = 0.02  # of the learning rate, at the end


@dataclasses.dataclass(frozen=True, kw_only=True)
class RolloutConfig(Options):
    """Sized for one core: a million steps in less than an hour."""

    # Experience
    num_envs: Count = 80  # side by side
    rollout_steps: Length = 50  # in each between two updates; the default milestones then end rollouts, too
    # Of the environment; over the second half, the learning rate falls to 2 %. None: those of the run.
    total_steps: config_values.Rows | None = None

    # Learning
    epochs: Length = 3  # an update has as many minibatches as so many passes over the newest rollout
    minibatches: Length = 8  # of a pass
    learning_rate: Factor = 7e-4  # Adam's
    max_gradient_norm: Factor = 0.5


class Seen(NamedTuple):
    """The readings of a network in a step in B environments."""

    shared: list[np.ndarray]  # B of [...]; the same object for all steps that share it, such as those on one map
    parts: tuple[Any, ...] = ()  # [B, ...] each, the rest


class Rows(NamedTuple):
    """Steps on grids or maps of one size."""

    shared: torch.Tensor  # [G, ...], what steps share
    group: torch.Tensor  # [R] int, the one of each step
    parts: tuple[torch.Tensor, ...]  # [R, ...] each: the other parts of `Seen`, then what the learner adds

    def on(self, chosen: np.ndarray) -> Rows:
        """Returns the steps on the grids or maps `chosen`, in whose order these then are."""
        number = torch.full((len(self.shared),), -1)
        number[torch.from_numpy(chosen)] = torch.arange(len(chosen))
        taken = number[self.group] >= 0
        return Rows(self.shared[chosen], number[self.group[taken]], tuple(part[taken] for part in self.parts))


class _Step(NamedTuple):
    """A step in B environments."""

    stream: int
    seen: Seen
    terminated: np.ndarray  # [B] bool
    ended: np.ndarray  # [B] bool


class RolloutLearner(NetworkLearner):
    """Updates the network of its actor after each rollout, from this one and perhaps some before it."""

    min_rows = 0
    num_kept = 1  # rollouts that an update learns from
    num_ahead = 1  # last steps that wait for the next update: their value bootstraps the steps before them
    teacher = "rewards"

    def __init__(self, actor: NetworkAgent, seed: int):
        """The actor's config has the fields of `RolloutConfig`."""
        config = self._config = actor.config
        self.steps_per_update: int = config.num_envs * config.rollout_steps
        total = config.total_steps
        num_gradients = max(1, (total or 0) // self.steps_per_update) * config.epochs * config.minibatches
        descent = Descent(
            actor.network,
            torch.optim.Adam(
                [{"params": [each], "rate": actor.rate(name)} for name, each in actor.network.named_parameters()],
                lr=config.learning_rate,
            ),
            max_gradient_norm=config.max_gradient_norm,
            # Constant in the first half of the run, then falling to nearly 0.
            rate=lambda step: min(
                1.0, max(_LEAST_RATE, 2 - 2 * (self.share_done if total is None else step / num_gradients))
            ),
        )
        super().__init__(actor, seed, descent)
        self._steps: list[_Step] = []  # of the rollout that is under way, oldest first
        self._kept: list[dict[int, Rows]] = []  # the last rollouts, by the size of what steps share

    def seen(self, experience: Experience) -> Seen:
        """Returns what is kept of one step in all environments."""
        raise NotImplementedError

    def columns(self, parts: list[np.ndarray]) -> list[np.ndarray]:
        """Returns the parts of rows, without the steps ahead, of the parts `[T, B, ...]` that `seen` returned."""
        return [part[: len(part) - self.num_ahead] for part in parts]

    def losses(self, rows: Rows) -> dict[str, torch.Tensor]:
        """Returns "loss", of which the gradient is taken, and other scalars by name."""
        raise NotImplementedError

    @property
    def num_rows(self) -> int:
        """The number of steps of the rollout that is under way."""
        return sum(len(step.ended) for step in self._steps)

    def description(self) -> str:
        """Returns the size of the network, and who teaches it."""
        weights = sum(parameter.numel() for parameter in self.actor.network.parameters())
        return f"{weights:,} weights, taught by {self.teacher}"

    def observe(self, experience: Experience) -> None:
        """Keeps one step in all environments."""
        if self._steps and self._steps[-1].stream != experience.stream:
            # New trajectories began, at a milestone: a run that is resumed there has no steps from before.
            self._steps.clear()
        self._steps.append(_Step(experience.stream, self.seen(experience), experience.terminated, experience.ended))

    @one_torch_thread()
    def update(self) -> dict[str, float]:
        """Learns from the rollout; returns the means of its losses and other scalars by name."""
        # The share of the rollout's episodes that ended in the goal; 0 if none ended.
        taken = self._steps[: len(self._steps) - self.num_ahead]
        num_reached = sum(int(step.terminated.sum()) for step in taken)
        num_ended = sum(int(step.ended.sum()) for step in taken)
        config, sums = self._config, {"success": num_reached / max(1, num_ended)}
        newest = self._forget()
        if newest:
            self._kept.append(newest)
        del self._kept[: -self.num_kept]

        # The steps that share something stay together, so that it is read once. What has one size is read at once.
        batches = []
        for size, rows in newest.items():
            joined = _joined([rollout[size] for rollout in self._kept if size in rollout])
            batches.append(self._minibatches(joined, max(1, len(rows.shared) // config.minibatches)))
        num_minibatches = config.epochs * config.minibatches if batches else 0
        for _ in range(num_minibatches):
            minibatch = [next(each) for each in batches]
            total = sum(len(rows.group) for rows in minibatch)
            losses: dict[str, torch.Tensor] = {}
            for rows in minibatch:
                for name, value in self.losses(rows).items():
                    losses[name] = losses.get(name, torch.zeros(())) + value * (len(rows.group) / total)
            losses["gradient_norm"] = self.descent.step(losses["loss"])
            for name, number in in_numbers(losses).items():
                sums[name] = sums.get(name, 0.0) + number / num_minibatches
        return sums

    def _minibatches(self, rows: Rows, num_shared: int) -> Iterator[Rows]:
        """Yields the rows on so many grids or maps at a time, again and again, each time in another order."""
        while True:
            order = self.rng.permutation(len(rows.shared))
            for begin in range(0, len(order) - num_shared + 1, num_shared):
                yield rows.on(order[begin : begin + num_shared])

    def _forget(self) -> dict[int, Rows]:
        """Returns the rollout's rows by the size of what they share, and forgets its steps but for those ahead."""
        steps, num_taken = self._steps, len(self._steps) - self.num_ahead
        parts = self.columns([np.stack(part) for part in zip(*(step.seen.parts for step in steps), strict=True)])
        taken, self._steps = steps[:num_taken], steps[num_taken:]
        if not taken:
            return {}
        sizes = np.array([[each.shape[-1] for each in step.seen.shared] for step in taken])
        rollout = {}
        for size in dict.fromkeys(sizes.ravel().tolist()):
            where = np.nonzero(sizes == size)
            shared = [taken[step].seen.shared[slot] for step, slot in zip(*where, strict=True)]
            number: dict[int, int] = {}  # by the identity of the array
            index = torch.tensor([number.setdefault(id(each), len(number)) for each in shared])
            different = torch.from_numpy(np.stack(list({id(each): each for each in shared}.values())))
            rollout[size] = Rows(different, index, tuple(torch.from_numpy(part[where]) for part in parts))
        return rollout


def _joined(rollouts: list[Rows]) -> Rows:
    """Returns the rows of several rollouts."""
    offsets = np.cumsum([0, *(len(rows.shared) for rows in rollouts)]).tolist()
    index = torch.cat([rows.group + offset for rows, offset in zip(rollouts, offsets, strict=False)])
    parts = tuple(map(torch.cat, zip(*(rows.parts for rows in rollouts), strict=True)))
    return Rows(torch.cat([rows.shared for rows in rollouts]), index, parts)
