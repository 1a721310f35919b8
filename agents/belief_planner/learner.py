"""The learner of the belief planner: the belief learns from wrong maps and evidence, the rest from right maps.

`G` is the number of contexts in a batch, `T` of past steps of each, `M` the side of the map.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch

from mazebench.errors import InputError
from mazebench.maps.maze import Maze
from mazebench.world.lidar import Lidar

from ..common import symmetry
from ..common.layers import state_features
from ..common.replay import SequenceSample
from ..muzero.learner import MuZeroLearner
from .belief import belief_losses
from .evidence import NUM_EVIDENCE, SENSED, Readings, place
from .wrong_maps import planes_of, wrong_map

_PAST = 120  # steps from which evidence is made
_LONGEST_LEG = 40  # steps of the leg to the goal that have passed, at most
_WITH_LIDAR = 0.4  # share of contexts in which the body has a lidar


class Pictured(NamedTuple):
    """What the belief learns from."""

    shown: torch.Tensor  # [G, 2, M, M], maps and marks of the goal
    evidence: torch.Tensor  # [G, 3, M, M]
    truth: torch.Tensor  # [G, 2, M, M], walls and goals of the mazes


class BeliefPlannerLearner(MuZeroLearner):
    """Updates the network of its actor."""

    def __init__(self, actor: Any, mazes: tuple[Maze, ...], seed: int):
        super().__init__(actor, mazes, seed, keep_anchor=True)
        self._size = mazes[0].size
        if actor.trained_size != self._size:
            found = f"mazes of {self._size} and a context of {actor.trained_size} cells a side"
            raise InputError(f"agent {actor.name!r}: learns from contexts of the mazes' size, found {found}")
        self._lidar = Lidar(mazes)

    def sample(self) -> SequenceSample:
        """Draws the sequences of the next batch, and what came before them."""
        config = self._config
        shape = config.groups, config.sequences, config.sequence_steps
        return self._replay.sample_sequences(*shape, self._hindsight, self._rng, num_past=_PAST)

    def _losses(self, sample: SequenceSample) -> tuple[dict[str, torch.Tensor], dict[str, torch.Tensor]]:
        turned, weight = self._draw_symmetry(), self._config.belief_weight
        pictured = self._pictured(sample, turned)
        logits = self.actor.network.belief(pictured.shown, pictured.evidence)
        of_wall, of_goal = belief_losses(logits, pictured.evidence[:, SENSED], pictured.truth)
        marks = self._marks(sample.anchor, turned), self._positions(sample, turned)
        losses, metrics = self._unrolled(self._batch(sample, turned, pictured.truth, *marks))
        return losses | {"wall_loss": weight * of_wall, "goal_place_loss": weight * of_goal}, metrics

    def _pictured(self, sample: SequenceSample, turned: int) -> Pictured:
        """Returns wrong maps, or those that were shown in training, with the evidence of the past."""
        shown, truth = [], []
        for index, maze in enumerate(sample.maze.tolist()):
            walls = self._mazes[maze].walls
            start, goal = (divmod(int(cell[index]), self._size) for cell in (sample.anchor, sample.goal))
            truth.append(planes_of(walls, goal))
            if sample.shown is not None:
                shown.append(planes_of(sample.shown[index], goal))
            elif self._rng.random() < self._config.wrong_maps:
                shown.append(wrong_map(walls, start, goal, self._rng))
            else:
                shown.append(truth[-1])
        planes = np.stack(shown), self._evidence(sample), np.stack(truth)
        return Pictured(*(symmetry.turn_planes(torch.from_numpy(each), turned).to(self._device) for each in planes))

    @torch.no_grad()
    def _evidence(self, sample: SequenceSample) -> np.ndarray:
        """Returns the evidence `[G, 3, M, M]` of the past."""
        past, network = sample.past, self.actor.network
        anchor = np.stack(np.divmod(sample.anchor, self._size), axis=-1)
        features = state_features(torch.from_numpy(past.state), torch.from_numpy(sample.origin)[:, None])
        features = features.to(self._device)
        moved, velocity, wished = (
            values.cpu().numpy()
            for values in (
                network.on_map(features[..., :2]),
                network.velocity(features),
                network.wished(features, torch.from_numpy(past.action).to(self._device)),
            )
        )
        wished[:, 1:], wished[:, 0] = wished[:, :-1] * past.exists[:, :-1, None], 0.0
        context, step = np.nonzero(past.exists)
        num_on_leg = self._rng.integers(1, _LONGEST_LEG + 1, size=len(anchor))
        on_leg = past.exists & (np.arange(past.exists.shape[1]) >= past.exists.shape[1] - num_on_leg[:, None])
        on_leg &= ~(on_leg & (past.cell == sample.goal[:, None])).any(axis=1, keepdims=True)
        has_lidar = self._rng.random(len(anchor)) < _WITH_LIDAR * (sample.shown is None)
        planes = np.zeros((len(anchor), NUM_EVIDENCE, self._size, self._size), dtype=np.float32)
        for sees in (False, True):
            chosen = has_lidar[context] == sees
            rows = context[chosen], step[chosen]
            state = past.state[rows]
            ranges = np.zeros((len(state), 0), dtype=np.float32)
            if sees and len(state):
                ranges = self._lidar.ranges(sample.maze[rows[0]], state[:, [0, 1, 5]].astype(np.float64))
            position = anchor[rows[0]].astype(np.float32) + moved[rows]
            readings = Readings(rows[0], on_leg[rows], position, velocity[rows], wished[rows], state[:, 5], ranges)
            place(planes, readings, network.metre())
        return planes
