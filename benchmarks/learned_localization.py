"""Learns how the shown map lies from what was seen, in the place of the navigator's own rule.

    python -m benchmarks.learned_localization --out runs/localization.pt          (five minutes on one core)
    mazebench eval --agent benchmarks.learned_localization:LearnedNavigator --checkpoint runs/localization.pt \
        --track building --level 3 --split dev

It is a histogram filter with a learned observation model, as in Active Neural Localization (Chaplot et al. 2018). The
hypotheses are the navigator's: placements of the map on the grid of what was seen. Each time that the body enters a
new cell, a network compares what was seen around it with the map there, and adds to the log weight of each hypothesis.
It is trained to give the weight to the true one at all times of an episode.

`T` is the number of cells that a body entered, `H` of hypotheses, `W` the cells on a side of a window around the body,
`N` of the map, `L` of the grid.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import pathlib
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import torch
from mazebench_agents.common.path_layer import cost_layers
from mazebench_agents.navigator import Navigator
from mazebench_agents.robot.map_matching import MapBelief
from mazebench_agents.robot.senses import Memory
from torch import nn
from torch.nn import functional

import mazebench
from mazebench.agent import Inputs, Interface
from mazebench.maps.kinds import KNOWN

SETTINGS = (("building", 3), ("adrift", 1))
HALF = 5  # cells from the body to the edge of its window, the lidar's reach
WINDOW = 2 * HALF + 1
UNIT = 4.0  # log odds of evidence that count as 1
CHANNELS = 16
BATCH = 8  # episodes
MOST_LOOKS = 48  # of an episode that are learned from


class Look(NamedTuple):
    """The evidence of walls when the body entered a cell, and the map there."""

    seen: np.ndarray  # [2, W, W] float32, evidence now, and when it entered the cell before
    shown: np.ndarray  # [H, W, W] float32, the map by each hypothesis


class Model(nn.Module):
    """The observation model: by how much a look makes each hypothesis likelier."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = cost_layers(6, CHANNELS)

    def forward(self, seen: torch.Tensor, shown: torch.Tensor) -> torch.Tensor:
        """Returns `[T, H]`, to be added to log weights, of T looks: `[T, 2, W, W]` and `[T, H, W, W]`."""
        evidence = torch.cat([seen.clamp(min=0), (-seen).clamp(min=0)], dim=1)[:, None]
        planes = [
            evidence.expand(-1, shown.shape[1], -1, -1, -1),
            shown[:, :, None],
            torch.ones_like(shown)[:, :, None],
        ]
        scores = self.layers(torch.cat(planes, dim=2).flatten(0, 1))
        return scores.sum(dim=(1, 2, 3)).reshape(shown.shape[:2])


@dataclasses.dataclass
class LearnedBelief(MapBelief):
    """Weighs its hypotheses by a model; without one, by the navigator's own rule, and remembers its first looks."""

    model: ClassVar[Model | None] = None

    looks: list[Look] = dataclasses.field(default_factory=list)  # to learn from

    def __post_init__(self) -> None:
        self.prior = self.log_weights.copy()  # [H]
        self._before = np.zeros(self.weighed.shape)  # [L, L], the evidence when a cell was entered last

    def update(self, evidence: np.ndarray, visited: np.ndarray) -> bool:
        """Takes in what was seen, see `MapBelief`."""
        entered = np.argwhere(visited & ~self.visited)
        if len(entered) > 0 and len(self.placements) > 1 and len(self.looks) < MOST_LOOKS:
            look = self._look(evidence, *entered[-1].tolist())
            self._before = evidence.copy()
            if self.model is None:
                self.looks.append(look)
            else:
                with torch.no_grad():
                    told = self.model(*(torch.from_numpy(each[None]) for each in look))
                self.log_weights += told[0].double().numpy()
        if self.model is None:
            return super().update(evidence, visited)
        # Of the rule, only that the goal is in no cell that was visited.
        return super().update(np.zeros_like(evidence), visited)

    def _look(self, evidence: np.ndarray, row: int, column: int) -> Look:
        seen = [window(plane, row, column, outside=0.0) / UNIT for plane in (evidence, self._before)]
        shown = [
            window(self.walls[orientation], top + row, left + column, outside=1.0)
            for orientation, top, left in self.placements.tolist()
        ]
        return Look(np.array(seen, np.float32), np.array(shown, np.float32))


def window(plane: np.ndarray, row: int, column: int, outside: float) -> np.ndarray:
    """Returns `[W, W]` of a plane around a cell, which may lie outside of it."""
    padded = np.pad(plane, WINDOW, constant_values=outside)
    top, left = (min(max(index + WINDOW - HALF, 0), len(padded) - WINDOW) for index in (row, column))
    return padded[top : top + WINDOW, left : left + WINDOW]


class LearnedNavigator(Navigator):
    """The navigator, with the learned belief of how the map lies."""

    needs_sensors = ("lidar",)
    learns = True

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns an agent with the model of a file."""
        if checkpoint is None:
            raise mazebench.InputError("expected --checkpoint, a file that learned_localization.py wrote, found none")
        model = Model()
        model.load_state_dict(torch.load(checkpoint, weights_only=True))
        return cls(interface, type("Belief", (LearnedBelief,), {"model": model}))


class WatchedNavigator(Navigator):
    """The navigator, whose beliefs are kept together with the placements that are true."""

    needs_sensors = ("lidar",)
    needs_truth = True
    watched: ClassVar[list[tuple[LearnedBelief, int]]] = []

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns an agent for the interface's mazes."""
        return cls(interface, LearnedBelief)

    def act(self, inputs: Inputs, state: Any, explore: bool = False) -> tuple[np.ndarray, Any]:
        """Returns actions `[B]`, see `Agent`."""
        actions, state = super().act(inputs, state, explore)
        begun = inputs.new_episode if inputs.active is None else inputs.new_episode & inputs.active
        for slot in np.flatnonzero(begun):
            assert inputs.truth is not None
            memory = state[slot].memory
            truth = true_placement(memory, inputs.truth.walls[slot], inputs.truth.pose[slot])
            self.watched.append((memory.belief, truth))
        return actions, state


def true_placement(memory: Memory, walls: np.ndarray, pose: np.ndarray) -> int:
    """Returns the hypothesis that lays the map on the grid as it lies, at the first observation of an episode.

    Args:
      memory: what the robot knows.
      walls: `[N, N]` bool, the true maze, whose cells are 1 m wide.
      pose: `[3]`, the true x, y and yaw.
    """
    belief = memory.belief
    # The grid is the maze, turned by quarter turns, with the body in the same place.
    turns = round((memory.body.yaw - float(pose[2])) / (math.pi / 2)) % 4
    turned, start = np.rot90(walls, turns), np.zeros_like(walls)
    start[len(walls) - 1 - int(pose[1]), int(pose[0])] = True
    corner = np.argwhere(np.rot90(start, turns))[0] - memory.cell
    # Of the maps that lie there, the one that differs least from the maze.
    differences = [
        np.abs(belief.walls[orientation] - turned).sum() if (top, left) == tuple(corner) else np.inf
        for orientation, top, left in belief.placements.tolist()
    ]
    return int(np.argmin(differences))


class Sample(NamedTuple):
    """An episode to learn from."""

    prior: torch.Tensor  # [H] float32, log weights before anything was seen
    seen: torch.Tensor  # [T, 2, W, W] float32
    shown: torch.Tensor  # [T, H, W, W] float32
    truth: int

    def log_posteriors(self, model: Model) -> torch.Tensor:
        """Returns `[T, H]`: the log probabilities of hypotheses after each look."""
        return functional.log_softmax(self.prior + model(self.seen, self.shown).cumsum(dim=0), dim=1)


def collect(track: str, level: int, **options: Any) -> list[Sample]:
    """Returns episodes of the navigator in new mazes of the known kinds."""
    WatchedNavigator.watched.clear()
    options = {"episodes_per_distance": 1, "kinds": KNOWN, "split": "train"} | options
    mazebench.evaluate(WatchedNavigator, track, level=level, **options)
    samples = []
    for belief, truth in WatchedNavigator.watched:
        if belief.looks:
            seen, shown = (torch.from_numpy(np.stack(each)) for each in zip(*belief.looks, strict=True))
            samples.append(Sample(torch.from_numpy(belief.prior).float(), seen, shown, truth))
    print(f"{len(samples)} episodes of {track} {level}", flush=True)
    return samples


def train(samples: list[Sample], num_updates: int, seed: int) -> Model:
    """Returns a model that was trained on some episodes."""
    torch.manual_seed(seed)
    rng, model = np.random.default_rng(seed), Model()
    optimizer = torch.optim.Adam(model.parameters(), 1e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, num_updates)
    losses: list[float] = []
    for update in range(1, num_updates + 1):
        chosen = [samples[index] for index in rng.integers(len(samples), size=BATCH)]
        loss = torch.stack([-each.log_posteriors(model)[:, each.truth].mean() for each in chosen]).mean()
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimizer.step()
        schedule.step()
        losses.append(loss.item())
        if update % 200 == 0:
            print(f"{update} updates, loss {np.mean(losses[-200:]):.4f}", flush=True)
    return model


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--mazes", type=int, default=10, help="of each kind and setting")
    parser.add_argument("--updates", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="localization.pt")
    arguments = parser.parse_args()
    samples = [
        sample
        for track, level in SETTINGS
        for sample in collect(track, level, num_mazes=arguments.mazes, seed=arguments.seed)
    ]
    torch.save(train(samples, arguments.updates, arguments.seed).state_dict(), arguments.out)
