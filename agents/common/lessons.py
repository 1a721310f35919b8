"""The training of a network on a stream of samples that are drawn as it learns, and the program around it."""

from __future__ import annotations

import abc
import argparse
import pathlib
import time
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np
import torch

from .actor import one_torch_thread
from .checkpoint import load_checkpoint, save_checkpoint
from .descent import Descent, cosine
from .symmetry import NUM_SYMMETRIES

_WARM_UP = 100  # updates, in which the learning rate grows
_REPORTED = 200  # updates


class Lessons(abc.ABC):
    """The samples that a network learns from."""

    name: ClassVar[str]  # of the network
    num_updates: ClassVar[int]  # if not given
    learning_rate: ClassVar[float]
    batch: ClassVar[int]  # samples

    @abc.abstractmethod
    def __init__(self, seed: int, begin: int = 0):
        """Draws from a seed; a training that goes on after `begin` updates draws other samples."""

    @abc.abstractmethod
    def make_network(self) -> Any:
        """Returns a new torch.nn.Module."""

    @abc.abstractmethod
    def next_loss(self, network: Any) -> torch.Tensor:
        """Returns the loss of the next batch."""


class KeptLessons(Lessons):
    """Lessons whose batches are of the last samples, each turned by one of the symmetries."""

    new: ClassVar[int] = 8  # samples per update, in the place of the oldest ones
    first: ClassVar[int] = 512  # samples before the first update
    kept: ClassVar[int] = 8192  # samples that batches are taken from

    def __init__(self, seed: int, begin: int = 0):
        self._rng, self._num_drawn = np.random.default_rng([seed, begin]), 0
        self._parts: list[np.ndarray] = []

    @abc.abstractmethod
    def sample(self) -> tuple[np.ndarray, ...]:
        """Returns the parts of the next sample, of one shape and type each time."""

    @abc.abstractmethod
    def loss(self, network: Any, parts: list[torch.Tensor], symmetry: int) -> torch.Tensor:
        """Returns the loss of a batch, whose parts `[B, ...]` are to be turned by a symmetry."""

    def next_loss(self, network: Any) -> torch.Tensor:
        for _ in range(self.new if self._num_drawn else self.first):
            sample, place = self.sample(), self._num_drawn % self.kept
            self._parts = self._parts or [np.empty((self.kept, *part.shape), part.dtype) for part in sample]
            for kept, part in zip(self._parts, sample, strict=True):
                kept[place] = part
            self._num_drawn += 1
        chosen = self._rng.integers(min(self._num_drawn, self.kept), size=self.batch)
        symmetry = int(self._rng.integers(NUM_SYMMETRIES))
        return self.loss(network, [torch.from_numpy(part[chosen]) for part in self._parts], symmetry)


class Training:
    """A training under way, `num_updates` long."""

    def __init__(
        self, lessons: type[Lessons], num_updates: int, seed: int, tensors: Mapping[str, torch.Tensor] | None = None
    ):
        """Begins, or goes on from the `tensors` of an earlier one, with other samples."""
        torch.manual_seed(seed)
        self._begin = 0 if tensors is None else int(tensors["num_updates"])
        self._lessons, self._num_updates = lessons(seed, self._begin), num_updates
        self._network = self._lessons.make_network()
        self._network.to(memory_format=torch.channels_last)  # a quarter faster
        self._descent = Descent(
            self._network,
            torch.optim.Adam(self._network.parameters(), lessons.learning_rate),
            max_gradient_norm=1.0,
            target_rate=0.005,
            rate=lambda update: min(1.0, update / _WARM_UP) * cosine((update - 1) / num_updates),
        )
        if tensors is not None:
            self._network.load_state_dict({name: tensors[name] for name in self._network.state_dict()})
            self._descent.load(tensors)

    @property
    def network(self) -> Any:
        """The moving average of the networks so far, which is the result."""
        return self._descent.target

    def tensors(self) -> dict[str, torch.Tensor]:
        """Returns what another training goes on from."""
        return self._network.state_dict() | self._descent.tensors()

    def run(self) -> Iterator[tuple[int, float]]:
        """Yields the number of updates and their mean loss, every few hundred updates."""
        losses: list[float] = []
        for update in range(self._begin + 1, self._num_updates + 1):
            loss = self._lessons.next_loss(self._network)
            self._descent.step(loss)
            losses.append(loss.item())
            if update % _REPORTED == 0 or update == self._num_updates:
                yield update, float(np.mean(losses[-_REPORTED:]))


@one_torch_thread()
def main(lessons: type[Lessons], description: str | None) -> None:
    """Trains as the command line says, and writes the network now and then."""
    parser = argparse.ArgumentParser(description=(description or "").partition("\n")[0])
    parser.add_argument("--updates", type=int, default=lessons.num_updates, help=f"of {lessons.batch} samples each")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="the file to write")
    parser.add_argument("--resume", action="store_true", help="go on from the file NAME.training, which is written too")
    options = parser.parse_args()
    state = options.out.with_suffix(".training")
    before = load_checkpoint(state, lessons.name)[0] if options.resume else None
    training = Training(lessons, options.updates, options.seed, before)
    provenance = {"agent": lessons.name, "seed": options.seed}
    for update, loss in training.run():
        provenance["updates"] = update
        save_checkpoint(options.out, training.network.state_dict(), provenance)
        save_checkpoint(state, training.tensors(), provenance)
        print(f"{update:,} updates, {time.process_time():.0f} s of CPU, loss {loss:.5f}", flush=True)
