"""The learner of the belief: from simulated walks in random layouts with right and wrong maps.

`B` is the number of scenes in a batch, `H` and `W` of cells on the sides of the largest.
"""

from __future__ import annotations

import dataclasses
import math
import pathlib
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import torch
from scipy import ndimage
from torch.nn import functional

from mazebench.errors import InputError
from mazebench.maps.drawn import Mazes
from mazebench.maps.maze import Cell
from mazebench.tasks.spec import TaskSpec
from mazebench.training.experience import Experience

from ..common.actor import one_torch_thread
from ..common.checkpoint import AGENT_FILE, load_checkpoint, save_checkpoint
from ..common.descent import Descent
from .layouts import draw_layout
from .network import GOAL, NUM_PLANES, WALL, BeliefNetwork, Picture, picture
from .walks import walk_to_goal
from .wrong_maps import Situation, draw_situation

_TRAINING_FILE = "training.safetensors"
_VIEWS = 2  # of a walk, each a scene; to draw a layout and a walk for each would take longer than to learn from it
_LAST_RATE = 0.01  # times the learning rate, at last
_WARM_UPDATES = 100  # in which the learning rate rises, until Adam knows the gradients' sizes
_LEAST = -30.0  # log weight of a cell that the goal is not in


class Batch(NamedTuple):
    """Scenes of one update, padded to one size."""

    planes: torch.Tensor  # [B, C, H, W]
    inside: torch.Tensor  # [B, 1, H, W], 1 in a scene
    rule: torch.Tensor  # [B, 2, H, W], see `Picture`
    walls: torch.Tensor  # [B, H, W], 1 for a wall
    weight: torch.Tensor  # [B, H, W], of the cells' losses; sums to 1 in each scene that has cells to estimate
    possible: torch.Tensor  # [B, H, W] bool, where the goal may be
    goal: torch.Tensor  # [B] int, the goal's cell as row * W + column; -1 where the view excludes it
    is_right: torch.Tensor  # [B] bool, whether the map is right


def draw_batch(mazes: Mazes, config: Any, rng: np.random.Generator) -> Batch:
    """Returns the scenes of one update."""
    size = int(rng.integers(min(config.least_size, mazes[0].size), mazes[0].size + 1))
    is_lost = rng.random() < config.lost_share
    scenes: list[tuple[Picture, Situation]] = []
    while len(scenes) < config.batch_size:
        situation = draw_situation(draw_layout(mazes, config.task_share, size, rng), is_lost, rng)
        scenes += [(picture(view), situation) for view in walk_to_goal(situation, _VIEWS, rng)]
    return _batch(scenes[: config.batch_size], config)


def losses(network: BeliefNetwork, batch: Batch) -> dict[str, torch.Tensor]:
    """Returns cross-entropies of walls and of the goal, `[B]` each, by the network and by the rule alone.

    The goal's are 0 where the view excludes the goal.
    """
    logits = batch.rule + network(batch.planes, batch.inside)
    found = {}
    for name, each in (("", logits), ("rule_", batch.rule)):
        errors = functional.binary_cross_entropy_with_logits(each[:, WALL], batch.walls, reduction="none")
        found[f"{name}wall_loss"] = (errors * batch.weight).sum(dim=(1, 2))
        weights = each[:, GOAL].masked_fill(~batch.possible, _LEAST).flatten(1)
        found[f"{name}goal_loss"] = functional.cross_entropy(weights, batch.goal, reduction="none", ignore_index=-1)
    return found


class BeliefPlannerLearner:
    """Updates the network of its actor; what the actor does in its environments paces the updates, and is not used."""

    def __init__(self, actor: Any, task: TaskSpec, seed: int):
        self.actor = actor
        config = actor.config
        self.num_envs: int = config.num_envs
        self.min_rows: int = config.min_rows
        self.steps_per_update: int = config.steps_per_update
        self._mazes, self._seed = task.mazes, seed
        self._optimizer = torch.optim.AdamW(
            actor.network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        self._descent = Descent(
            actor.network, self._optimizer, max_gradient_norm=config.max_gradient_norm, target_rate=1.0
        )
        self._counts = torch.zeros(2, dtype=torch.int64)  # updates, and rows that were observed

    @property
    def num_rows(self) -> int:
        """The number of agent steps so far; none is stored."""
        return int(self._counts[1])

    def config(self) -> dict[str, Any]:
        """Returns all values of the config."""
        return dataclasses.asdict(self.actor.config)

    def description(self) -> str:
        """Returns the size of the network in one line."""
        weights = sum(parameter.numel() for parameter in self.actor.network.parameters())
        return f"{weights:,} weights; learns from simulated walks, without a replay"

    def observe(self, experience: Experience, first_env: int = 0) -> None:
        """Counts one step in the environments from `first_env` on."""
        self._counts[1] += len(experience.action)

    @one_torch_thread()
    def update(self) -> dict[str, float]:
        """Learns from one batch; returns its losses, and those of the rule alone.

        The scenes of an update follow from the seed and the update's number.
        """
        config, num_updates = self.actor.config, int(self._counts[0])
        batch = draw_batch(self._mazes, config, np.random.default_rng([self._seed, 1, num_updates]))
        by_scene = losses(self.actor.network, batch)

        share_done = min(1.0, num_updates / config.num_updates)
        falling = _LAST_RATE + (1 - _LAST_RATE) * (1 + math.cos(math.pi * share_done)) / 2
        for group in self._optimizer.param_groups:
            group["lr"] = config.learning_rate * falling * min(1.0, (num_updates + 1) / _WARM_UPDATES)
        loss = (by_scene["wall_loss"] + config.goal_weight * by_scene["goal_loss"]).mean()
        norm = self._descent.step(loss)
        self._counts[0] += 1

        metrics = {name: float(each.detach().mean()) for name, each in by_scene.items()}
        for name in ("wall_loss", "rule_wall_loss"):
            if batch.is_right.any():
                metrics[f"right_{name}"] = float(by_scene[name][batch.is_right].detach().mean())
        return metrics | {"gradient_norm": float(norm)}

    def save(self, folder: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes the agent, the optimizer and the counts."""
        self.actor.save(folder / AGENT_FILE, provenance)
        tensors = self._descent.tensors() | {"counts": self._counts}
        save_checkpoint(folder / _TRAINING_FILE, tensors, {"agent": self.actor.name})

    def load(self, folder: pathlib.Path) -> None:
        """Restores what `save` wrote.

        Raises:
          InputError: if a file is damaged, or another agent's.
        """
        self.actor.load(folder / AGENT_FILE)
        tensors, _ = load_checkpoint(folder / _TRAINING_FILE, self.actor.name)
        counts = tensors.pop("counts", torch.zeros(0))
        if counts.shape != (2,) or counts.dtype != torch.int64 or counts.min() < 0:
            raise InputError(f"{folder / _TRAINING_FILE}: expected counts of updates and rows, found {counts.tolist()}")
        self._counts = counts.clone()
        self._descent.load(folder / _TRAINING_FILE, tensors)


def _batch(scenes: list[tuple[Picture, Situation]], config: Any) -> Batch:
    """Returns scenes with their situations as one batch."""
    height = max(scene.unseen.shape[0] for scene, _ in scenes)
    width = max(scene.unseen.shape[1] for scene, _ in scenes)
    shape = (len(scenes), height, width)
    planes = np.zeros((len(scenes), NUM_PLANES, height, width), dtype=np.float32)
    rule = np.zeros((len(scenes), 2, height, width), dtype=np.float32)
    inside, walls, weight = (np.zeros(shape, dtype=np.float32) for _ in range(3))
    possible, goal = np.zeros(shape, dtype=bool), np.full(len(scenes), -1)
    for index, (scene, situation) in enumerate(scenes):
        rows, columns = scene.unseen.shape
        planes[index, :, :rows, :columns], rule[index, :, :rows, :columns] = scene.planes, scene.rule
        inside[index, :rows, :columns] = 1
        walls[index, :rows, :columns] = situation.walls[scene.box]
        weight[index, :rows, :columns] = _weight(scene, config)
        possible[index, :rows, :columns] = scene.possible
        goal[index] = _goal_in(scene, situation.goal, width)
    return Batch(
        planes=torch.from_numpy(planes),
        inside=torch.from_numpy(inside)[:, None],
        rule=torch.from_numpy(rule),
        walls=torch.from_numpy(walls),
        weight=torch.from_numpy(weight),
        possible=torch.from_numpy(possible),
        goal=torch.from_numpy(goal),
        is_right=torch.tensor([situation.wrong == "right" for _, situation in scenes]),
    )


def _weight(scene: Picture, config: Any) -> np.ndarray:
    """Returns `[H, W]` float: the weights of the cells' losses; more near seen cells, where decisions are made next."""
    is_near = ndimage.distance_transform_cdt(scene.unseen, metric="chessboard") <= config.near_cells
    weight = scene.unseen * (1 + config.near_weight * is_near)
    return weight / max(1.0, weight.sum())


def _goal_in(scene: Picture, goal: Cell, width: int) -> int:
    """Returns the index of the goal's cell among those of a row of `width`; -1 if the view excludes it."""
    row, column = goal[0] - scene.box[0].start, goal[1] - scene.box[1].start
    rows, columns = scene.possible.shape
    is_possible = 0 <= row < rows and 0 <= column < columns and scene.possible[row, column]
    return row * width + column if is_possible else -1
