"""What the belief learns from: wrong maps, and evidence of the past.

`G` is the number of contexts in a batch, `T` of past steps of each, `M` the side of the map.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from mazebench.world.lidar import Lidar

from ..common import symmetry
from ..common.layers import state_features
from ..common.replay import SequenceSample
from ..common.training_maps import TrainingMaps
from .evidence import NUM_EVIDENCE, Readings, add_readings
from .network import BeliefPlannerNetwork
from .wrong_maps import planes_of, wrong_map

_LONGEST_LEG = 40  # steps of the leg to the goal that have passed, at most
_WITH_LIDAR = 0.4  # share of contexts in which the body has a lidar


class Pictures(NamedTuple):
    """What the belief learns from, in the turned world."""

    shown: torch.Tensor  # [G, 2, M, M], maps and marks of the goal
    evidence: torch.Tensor  # [G, 3, M, M]
    truth: torch.Tensor  # [G, 2, M, M], walls and goals of the mazes


def make_pictures(
    sample: SequenceSample,
    network: BeliefPlannerNetwork,
    *,
    maps: TrainingMaps,
    turned: int,
    lidar: Lidar,
    wrong_maps: float,
    rng: np.random.Generator,
) -> Pictures:
    """Returns what the belief learns from, on the network's device.

    The maps are those that were shown in training. Where these are the mazes, `wrong_maps` is the share of contexts in
    which a wrong map is drawn instead.
    """
    shown, truth = [], []
    for index, maze in enumerate(sample.maze.tolist()):
        walls = maps.walls(maze)
        start, goal = (divmod(int(cell[index]), maps.size) for cell in (sample.anchor, sample.goal))
        truth.append(planes_of(walls, goal))
        if sample.shown is not None:
            shown.append(planes_of(sample.shown[index], goal))
        elif rng.random() < wrong_maps:
            shown.append(wrong_map(walls, start, goal, rng))
        else:
            shown.append(truth[-1])
    evidence = past_evidence(sample, network, size=maps.size, lidar=lidar, rng=rng)
    device = network.support.device
    return Pictures(
        *(
            symmetry.turn_planes(torch.from_numpy(planes), turned).to(device)
            for planes in (np.stack(shown), evidence, np.stack(truth))
        )
    )


@torch.no_grad()
def past_evidence(
    sample: SequenceSample, network: BeliefPlannerNetwork, *, size: int, lidar: Lidar, rng: np.random.Generator
) -> np.ndarray:
    """Returns the evidence `[G, 3, M, M]` of what came before a sample's earliest steps, on maps of `size` M."""
    past, device = sample.past, network.support.device
    num_contexts, num_steps = len(past.exists), past.exists.shape[1]

    # Where the body was and how it moved, as the agent would have told.
    anchor = np.stack(np.divmod(sample.anchor, size), axis=-1)
    features = state_features(torch.from_numpy(past.state), torch.from_numpy(sample.origin)[:, None]).to(device)
    moved = network.on_map(features[..., :2]).cpu().numpy()
    velocity = network.velocity(features).cpu().numpy()
    wished_next = network.wished(features, torch.from_numpy(past.action).to(device)).cpu().numpy()
    wished = np.zeros_like(wished_next)
    wished[:, 1:] = wished_next[:, :-1] * past.exists[:, :-1, None]

    # The leg to the goal began some steps ago, after the body was last in the goal's cell.
    num_on_leg = rng.integers(1, _LONGEST_LEG + 1, size=num_contexts)
    on_leg = past.exists & (np.arange(num_steps) >= num_steps - num_on_leg[:, None])
    on_leg &= ~(on_leg & (past.cell == sample.goal[:, None])).any(axis=1, keepdims=True)

    # In some contexts, the body has a lidar, but where maps are shown that need not be the mazes.
    has_lidar = rng.random(num_contexts) < _WITH_LIDAR * (sample.shown is None)

    planes = np.zeros((num_contexts, NUM_EVIDENCE, size, size), dtype=np.float32)
    context, step = np.nonzero(past.exists)
    for sees in (False, True):
        chosen = has_lidar[context] == sees
        rows = context[chosen], step[chosen]
        state = past.state[rows]
        ranges = np.zeros((len(state), 0), dtype=np.float32)
        if sees and len(state):
            ranges = lidar.ranges(sample.maze[rows[0]], state[:, [0, 1, 5]].astype(np.float64))
        position = anchor[rows[0]].astype(np.float32) + moved[rows]
        readings = Readings(rows[0], on_leg[rows], position, velocity[rows], wished[rows], state[:, 5], ranges)
        add_readings(planes, readings, network.metre())
    return planes
