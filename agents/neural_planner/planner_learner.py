"""The learner of the neural planner: PPO from rewards on the last rollout, or imitation of the oracle on several.

`B` is the number of environments, `R` of steps in all of them together, `G` of grids that these are on.
"""

from __future__ import annotations

import pathlib
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import torch
from torch.nn import functional

from mazebench.constants import NUM_ACTIONS
from mazebench.errors import InputError
from mazebench.storage.array_files import read_arrays
from mazebench.tasks.task import Task
from mazebench.training.experience import Experience

from ..common.actor import NetworkAgent, one_torch_thread
from ..common.descent import Descent, in_numbers
from ..common.learner import REPLAY_FILE, NetworkLearner
from ..expert import Expert
from .network import Choice, Situation

_LEAST_RATE = 0.02  # of the learning rate, at the end


class Rows(NamedTuple):
    """Steps on grids of one size."""

    grids: torch.Tensor  # [G, 4, L, L] uint8
    grid: torch.Tensor  # [R] int, the grid of each step
    pose: torch.Tensor  # [R, 3], this and the next two as in `Situation`
    ranges: torch.Tensor  # [R, 32]
    motion: torch.Tensor  # [R, 15]
    action: torch.Tensor  # [R] int
    log_probability: torch.Tensor  # [R], of the action when it was chosen
    advantage: torch.Tensor  # [R]
    value: torch.Tensor  # [R], what the value should be
    label: torch.Tensor  # [R, 6], the probabilities of actions by the oracle; without one, zeros


class _Step(NamedTuple):
    """A step in B environments; the parts of `Experience` that are learned from."""

    choice: Choice
    action: np.ndarray  # [B] int
    reward: np.ndarray  # [B] float
    terminated: np.ndarray  # [B] bool
    ended: np.ndarray  # [B] bool
    label: np.ndarray  # [B, 6] float32, the probabilities of actions by the oracle; without one, zeros


class PlannerLearner(NetworkLearner):
    """Updates the network of its actor after each rollout; imitation learns from the rollouts before it, too."""

    min_rows = 0

    def __init__(self, actor: NetworkAgent, task: Task, seed: int):
        """The steps are taken in the mazes of `task`."""
        config = self._config = actor.config
        self.steps_per_update: int = config.num_envs * config.rollout_steps
        num_gradients = max(1, config.total_steps // self.steps_per_update) * config.epochs * config.minibatches
        descent = Descent(
            actor.network,
            torch.optim.Adam(actor.network.parameters(), lr=config.learning_rate),
            max_gradient_norm=config.max_gradient_norm,
            # Constant in the first half of the run, then falling to nearly 0.
            rate=lambda step: min(1.0, max(_LEAST_RATE, 2 - 2 * step / num_gradients)),
        )
        super().__init__(actor, seed, descent)
        self._steps: list[_Step] = []  # of the rollout that is under way, oldest first
        self._expert = Expert(task.mazes, config.num_envs, task.body)
        self._kept: list[dict[int, Rows]] = []  # the last rollouts, by the size of grids

    @property
    def num_rows(self) -> int:
        """The number of steps of the rollout that is under way."""
        return sum(len(step.action) for step in self._steps)

    def description(self) -> str:
        """Returns the size of the network, and who teaches it."""
        weights = sum(parameter.numel() for parameter in self.actor.network.parameters())
        return f"{weights:,} weights, taught by {'rewards' if self._config.teacher == 'reward' else 'the oracle'}"

    def observe(self, experience: Experience) -> None:
        """Keeps one step in all environments, with the oracle's labels if it teaches."""
        choice = experience.notes
        if self._steps and self._steps[-1].choice.stream != choice.stream:
            # New trajectories began, at a milestone: a run that is resumed there has no steps from before.
            self._steps.clear()
        label = np.zeros((len(experience.action), NUM_ACTIONS), np.float32)
        if self._config.teacher == "oracle":
            # The probabilities of actions by the oracle's look-ahead from the true state.
            costs = self._expert.costs(experience.maze, experience.goal, experience.pose, experience.velocity)
            weights = np.exp(-(costs - costs.min(axis=1, keepdims=True)) / self._config.label_temperature)
            label = (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)
        ends = experience.reward, experience.terminated, experience.ended
        self._steps.append(_Step(choice, experience.action, *ends, label))

    @one_torch_thread()
    def update(self) -> dict[str, float]:
        """Learns from the rollout; returns the means of its losses and other scalars by name."""
        # The share of the rollout's episodes that ended in the goal; 0 if none ended.
        num_reached = sum(int(step.terminated.sum()) for step in self._steps[:-1])
        num_ended = sum(int(step.ended.sum()) for step in self._steps[:-1])
        config, sums = self._config, {"success": num_reached / max(1, num_ended)}
        newest = self._forget()
        if newest:
            self._kept.append(newest)
        del self._kept[: -config.kept_rollouts if config.teacher == "oracle" else -1]

        # The steps of a plan stay together, so that each is planned once. Grids of one size are computed at once.
        batches = []
        for size, rows in newest.items():
            parts = [rollout[size] for rollout in self._kept if size in rollout]
            offsets = np.cumsum([0, *(len(part.grids) for part in parts)]).tolist()
            grid = torch.cat([part.grid + offset for part, offset in zip(parts, offsets, strict=False)])
            rest = map(torch.cat, zip(*(part[2:] for part in parts), strict=True))
            joined = Rows(torch.cat([part.grids for part in parts]), grid, *rest)
            batches.append(self._minibatches(joined, max(1, len(rows.grids) // config.minibatches)))
        num_minibatches = config.epochs * config.minibatches if batches else 0
        for _ in range(num_minibatches):
            minibatch = [next(each) for each in batches]
            total = sum(len(rows.action) for rows in minibatch)
            losses: dict[str, torch.Tensor] = {}
            for rows in minibatch:
                for name, value in self._losses(rows).items():
                    losses[name] = losses.get(name, torch.zeros(())) + value * (len(rows.action) / total)
            losses["gradient_norm"] = self.descent.step(losses["loss"])
            for name, number in in_numbers(losses).items():
                sums[name] = sums.get(name, 0.0) + number / num_minibatches
        return sums

    def _minibatches(self, rows: Rows, num_grids: int) -> Iterator[Rows]:
        """Yields the rows on so many grids at a time, again and again, each time in another order."""
        while True:
            order = self.rng.permutation(len(rows.grids))
            for begin in range(0, len(order) - num_grids + 1, num_grids):
                chosen, number = order[begin : begin + num_grids], torch.full((len(rows.grids),), -1)
                number[torch.from_numpy(chosen)] = torch.arange(num_grids)
                taken = number[rows.grid] >= 0
                yield Rows(rows.grids[chosen], number[rows.grid[taken]], *(part[taken] for part in rows[2:]))

    def _losses(self, rows: Rows) -> dict[str, torch.Tensor]:
        """Returns the loss and its parts."""
        config = self._config
        plan = self.actor.network.plan(rows.grids)
        logits, value = self.actor.network(plan, rows.grid, Situation(rows.pose, rows.ranges, rows.motion))
        log_probabilities = functional.log_softmax(logits, dim=1)
        entropy = -(log_probabilities.exp() * log_probabilities).sum(dim=1).mean()
        wall = plan.wall > 0.5
        scalars = {"entropy": entropy, "wall_cost": plan.cost[wall].mean(), "free_cost": plan.cost[~wall].mean()}
        if config.teacher == "oracle":
            imitation = -(rows.label * log_probabilities).sum(dim=1).mean()
            right = (logits.argmax(dim=1) == rows.label.argmax(dim=1)).float().mean()
            return {"loss": imitation, "imitation_loss": imitation, "agreement": right, **scalars}
        taken = log_probabilities.gather(1, rows.action[:, None])[:, 0]
        policy_loss = clipped_loss(taken - rows.log_probability, rows.advantage, config.clip)
        value_loss = functional.mse_loss(value, rows.value)
        loss = policy_loss + config.value_weight * value_loss - config.entropy_weight * entropy
        return {"loss": loss, "policy_loss": policy_loss, "value_loss": value_loss, **scalars}

    def _forget(self) -> dict[int, Rows]:
        """Returns the rollout's steps by the size of the grids that they are on, and forgets them.

        The last step in each environment stays, for its value bootstraps the steps before it.
        """
        config, steps = self._config, self._steps
        discount, trace = 1 - 1 / config.discount_steps, 1 - 1 / config.trace_steps
        value = np.stack([step.choice.value for step in steps])
        reward = config.reward_scale * np.stack([step.reward for step in steps])
        terminated, ended = np.stack([step.terminated for step in steps]), np.stack([step.ended for step in steps])
        advantage = advantages(reward, value, terminated, ended, discount, trace)

        # All parts of the rows, `[T - 1, B, ...]`.
        taken, self._steps = steps[:-1], steps[-1:]
        if not taken:
            return {}
        parts = [
            *(np.stack(part) for part in zip(*(step.choice.situation for step in taken), strict=True)),
            np.stack([step.action for step in taken]),
            np.stack([step.choice.log_probability for step in taken]),
            advantage.astype(np.float32),
            (advantage + value[:-1]).astype(np.float32),
            np.stack([step.label for step in taken]),
        ]

        # The steps on grids of each size, and the grids, which several steps may share.
        sizes, rollout = np.array([[grid.shape[-1] for grid in step.choice.grids] for step in taken]), {}
        for size in dict.fromkeys(sizes.ravel().tolist()):
            where = np.nonzero(sizes == size)
            grids = [taken[step].choice.grids[slot] for step, slot in zip(*where, strict=True)]
            index: dict[int, int] = {}  # of a grid, by the identity of its array
            grid = torch.tensor([index.setdefault(id(each), len(index)) for each in grids])
            different = torch.from_numpy(np.stack(list({id(each): each for each in grids}.values())))
            rollout[size] = Rows(different, grid, *(torch.from_numpy(part[where]) for part in parts))
        return rollout

    def save(self, folder: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes what every learner does, and the rollouts that are kept."""
        super().save(folder, provenance)
        if self._config.teacher == "oracle":
            arrays: dict[str, Any] = {
                f"{number}-{size}-{name}": array.numpy()
                for number, rollout in enumerate(self._kept)
                for size, rows in rollout.items()
                for name, array in zip(Rows._fields, rows, strict=True)
            }
            with (folder / REPLAY_FILE).open("wb") as file:
                np.savez_compressed(file, **arrays)

    def load(self, folder: pathlib.Path) -> None:
        """Restores what `save` wrote; without the rollouts' file, imitation begins with new ones.

        Raises:
          InputError: if a file is damaged, or another agent's.
        """
        super().load(folder)
        self._kept = []
        path = folder / REPLAY_FILE
        if not path.exists():
            return
        arrays = read_arrays(path, "file of rollouts")
        try:
            for number, size in sorted({tuple(map(int, name.split("-")[:2])) for name in arrays}):
                self._kept += [{} for _ in range(number + 1 - len(self._kept))]
                found = (torch.from_numpy(arrays[f"{number}-{size}-{name}"]) for name in Rows._fields)
                self._kept[number][size] = Rows(*found)
        except (KeyError, ValueError) as error:
            raise InputError(f"{path}: expected rollouts, found a damaged file: {error}") from error


def advantages(
    reward: np.ndarray, value: np.ndarray, terminated: np.ndarray, ended: np.ndarray, discount: float, trace: float
) -> np.ndarray:
    """Returns generalized advantage estimates `[T - 1, B]` (Schulman et al. 2016, eq. 16) of all steps but the last.

    Where an episode was cut short, the value of the state before its last step stands for all rewards that follow.
    Arrays are `[T, B]`: the value is that of the state before each step; a step that `terminated` reached the goal.
    """
    found, following = np.zeros_like(value), np.zeros_like(value[0])
    for step in range(len(value) - 2, -1, -1):
        next_value = np.where(ended[step], np.where(terminated[step], 0.0, value[step]), value[step + 1])
        error = reward[step] + discount * next_value - value[step]
        found[step] = following = error + discount * trace * ~ended[step] * following
    return found[:-1]


def clipped_loss(log_ratio: torch.Tensor, advantage: torch.Tensor, clip: float) -> torch.Tensor:
    """Returns PPO's loss (Schulman et al. 2017, eq. 7), with advantages scaled to a mean of 0 and a deviation of 1."""
    scaled = (advantage - advantage.mean()) / (advantage.std(correction=0) + 1e-6)
    ratio = log_ratio.exp()
    return -torch.minimum(ratio * scaled, ratio.clamp(1 - clip, 1 + clip) * scaled).mean()
