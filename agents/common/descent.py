"""Gradient steps of a network, and the target network that follows it where there is one."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from typing import Any

import torch


class Descent:
    """Steps of an optimizer of `network`, and perhaps `target`, the moving average of the network's parameters."""

    def __init__(
        self,
        network: Any,
        optimizer: torch.optim.Optimizer,
        *,
        max_gradient_norm: float,
        target_rate: float | None = None,
        rate: Callable[[int], float] | None = None,
    ):
        """Makes the target network, if there is one, equal to `network`, the torch.nn.Module that learns.

        Args:
          network: has the parameters that `optimizer` takes.
          optimizer: Adam or AdamW.
          max_gradient_norm: to which a longer gradient is shortened.
          target_rate: of the moving average, a step; None for no target network.
          rate: returns the factor of the learning rate at a step, the first one being 1; None if it never falls. A
            `rate` of an optimizer's group multiplies it.
        """
        self.network = network
        self.target: Any = None if target_rate is None else copy.deepcopy(network).requires_grad_(False)
        self._optimizer = optimizer
        self._max_gradient_norm, self._target_rate = max_gradient_norm, target_rate
        self._rate = rate
        self._num_steps = 0

    def step(self, loss: torch.Tensor) -> torch.Tensor:
        """Takes one step of the optimizer, moves the target network along, and returns the gradient's norm."""
        self._num_steps += 1
        if self._rate is not None:
            falling = self._rate(self._num_steps)
            for group in self._optimizer.param_groups:
                group["lr"] = group.get("rate", 1.0) * self._optimizer.defaults["lr"] * falling

        self._optimizer.zero_grad()
        loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(self.network.parameters(), self._max_gradient_norm)
        self._optimizer.step()

        if self._target_rate is not None:
            with torch.no_grad():
                for slow, fast in zip(self.target.parameters(), self.network.parameters(), strict=True):
                    slow.lerp_(fast, self._target_rate)
        return norm

    def tensors(self) -> dict[str, torch.Tensor]:
        """Returns what `load` restores, by name: all but the network."""
        tensors = {} if self.target is None else {f"target.{name}": t for name, t in self.target.state_dict().items()}
        if self._rate is not None:
            tensors["num_updates"] = torch.tensor(self._num_steps)
        for index, moments in self._optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{index}.{name}": torch.as_tensor(value) for name, value in moments.items()}
        return tensors

    def load(self, tensors: Mapping[str, torch.Tensor]) -> None:
        """Restores `tensors`."""
        if self.target is not None:
            self.target.load_state_dict(_below("target.", tensors))
        if self._rate is not None:
            self._num_steps = int(tensors["num_updates"])
        state: dict[int, dict[str, torch.Tensor]] = {}
        for name, value in _below("optimizer.", tensors).items():
            index, moment = name.split(".")
            state.setdefault(int(index), {})[moment] = value
        groups = self._optimizer.state_dict()["param_groups"]
        self._optimizer.load_state_dict({"state": state, "param_groups": groups})


def cosine(share: float) -> float:
    """Returns the factor of a learning rate after a share of a training, from 1 to 0.02 (Loshchilov & Hutter 2017)."""
    return max(0.02, 0.5 * (1 + math.cos(math.pi * share)))


def in_numbers(scalars: Mapping[str, torch.Tensor]) -> dict[str, Any]:
    """Returns scalars as plain numbers; they are copied at once, since a GPU ends all its work before each copy."""
    return dict(zip(scalars, torch.stack([value.detach() for value in scalars.values()]).tolist(), strict=True))


def _below(prefix: str, tensors: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Returns the tensors whose names begin with `prefix`, by the rest of the name."""
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}
