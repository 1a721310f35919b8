"""Trains the model of MMN alone on recorded transitions, and prints how much the map matters to its weights.

Call it as `python benchmarks/transition_model.py [UPDATES [KEY=VALUE ...]]`; keys are those of `MMNConfig`.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np
import torch
from mazebench_agents.common import symmetry
from mazebench_agents.common.layers import marked_position, state_features
from mazebench_agents.common.overrides import override
from mazebench_agents.mmn.config import MMNConfig
from mazebench_agents.mmn.learner import parameter_groups
from mazebench_agents.mmn.network import Code, MMNNetwork

from mazebench.maps.benchmark import load_mazes
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.tasks.build import make_spec
from mazebench.tasks.context import START, build_context
from mazebench.training.experience import Collector

_SIZE = 13
_NUM_ENVS = 128
_NUM_STEPS = {"train": 1200, "held out": 250}  # recorded in each environment
_REPEAT = 0.6  # probability that driving repeats the last action, so that the body gets somewhere
_ACTIONS = (0.4, 0.12, 0.12, 0.12, 0.12, 0.12)  # probabilities of the others; the first is forward
_CONTEXTS, _TRANSITIONS = 32, 16  # of a batch
_TRUE_SCALE = ((0.0, 0.2), (-0.2, 0.0))  # of the map, over the rate of the scale's parameters


class Transitions(NamedTuple):
    """Recorded transitions of one maze."""

    state: np.ndarray  # [n, 12]
    action: np.ndarray  # [n]
    after: np.ndarray  # [n, 12]
    start: np.ndarray  # [n, 2] cell in which the episode began
    origin: np.ndarray  # [n, 2] x and y observed there


class Batch(NamedTuple):
    """Transitions `[G, K]` in contexts `[G]`."""

    context: torch.Tensor  # [G, 4, M, M]
    features: torch.Tensor  # [G, K, 9]
    action: torch.Tensor  # [G, K]
    after: torch.Tensor  # [G, K, 9]
    maze: torch.Tensor  # [G]


def record(mazes: tuple[Maze, ...], num_steps: int, rng: np.random.Generator) -> list[Transitions]:
    """Returns transitions of random driving, by maze."""
    collector = Collector(make_spec(maps=mazes, distances=(1, 2, 3, 4, 5)), _NUM_ENVS, seed=5)
    action = rng.integers(6, size=_NUM_ENVS)
    origin, start = np.zeros((_NUM_ENVS, 2), np.float32), np.zeros(_NUM_ENVS, np.int64)
    rows, before = [], None
    for _ in range(num_steps):
        action = np.where(rng.random(_NUM_ENVS) < _REPEAT, action, rng.choice(6, size=_NUM_ENVS, p=_ACTIONS))
        step = collector.step(action)
        if before is not None:
            same = ~step.new_episode
            parts = (before.state, before.action, step.state, start, origin, before.maze)
            rows.append([part[same].copy() for part in parts])
        origin = np.where(step.new_episode[:, None], step.state[:, :2], origin)
        start = np.where(step.new_episode, step.start, start)
        before = step
    state, acted, after, starts, origins, maze = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    cells = np.stack(np.divmod(starts, _SIZE), axis=-1)
    everything = (state, acted, after, cells, origins)
    return [Transitions(*(part[maze == index] for part in everything)) for index in range(len(mazes))]


def draw(mazes: tuple[Maze, ...], recorded: list[Transitions], turned: int, rng: np.random.Generator) -> Batch:
    """Draws contexts with a start and a goal, and transitions in their mazes, measured from that start."""
    chosen = rng.integers(len(mazes), size=_CONTEXTS)
    contexts, features, actions, after = [], [], [], []
    for index in chosen:
        free = np.argwhere(~mazes[index].walls)
        start, goal = free[rng.integers(len(free), size=2)]
        part = recorded[index]
        k = rng.integers(len(part.action), size=_TRANSITIONS)
        row, column = (start - part.start[k]).T
        origin = torch.from_numpy((part.origin[k] + np.stack([column, -row], axis=-1)).astype(np.float32))
        contexts.append(build_context(mazes[index].walls, tuple(start.tolist()), tuple(goal.tolist()), _SIZE))
        features.append(state_features(torch.from_numpy(part.state[k]), origin))
        after.append(state_features(torch.from_numpy(part.after[k]), origin))
        actions.append(part.action[k])
    return Batch(
        symmetry.turn_planes(torch.from_numpy(np.stack(contexts)), turned),
        symmetry.turn_features(torch.stack(features), turned),
        torch.from_numpy(symmetry.turn_actions(np.stack(actions), turned)),
        symmetry.turn_features(torch.stack(after), turned),
        torch.from_numpy(chosen),
    )


def encoded(network: MMNNetwork, batch: Batch) -> Code:
    """Returns the codes of a batch's contexts; displacements are measured from the marked starts."""
    return network.hypermodel(batch.context, marked_position(batch.context[:, START]))


def errors(network: MMNNetwork, batch: Batch, code: Code) -> tuple[torch.Tensor, torch.Tensor]:
    """Returns the errors `[G, K]` of the displacement (m) and of the rest of the body after one step."""
    latent = network.encode(batch.features)
    first = network.first_layer(latent, network.look(latent, code), code)
    error = (network.decode(network.step(latent, first, batch.action, code)) - batch.after[..., :7]).abs()
    return error[..., :2].sum(dim=-1), error[..., 2:].sum(dim=-1)


@torch.no_grad()
def compare(network: MMNNetwork, batches: list[Batch]) -> tuple[float, float]:
    """Returns the mean errors (m) with the right weights, and with those of another maze."""
    own, other = [], []
    for batch in batches:
        code = encoded(network, batch)
        rolled = Code(code.positions, *(part.roll(1, 0) for part in code[1:]))
        own.append(errors(network, batch, code)[0])
        other.append(errors(network, batch, rolled)[0][batch.maze != batch.maze.roll(1, 0)])
    return float(torch.cat(own).mean()), float(torch.cat(other).mean())


def main(num_updates: int, overrides: dict[str, str]) -> None:
    """Trains for so many updates and prints the errors."""
    torch.set_num_threads(1)
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    config = override(MMNConfig(), overrides)
    held_out = tuple(generate("dfs", _SIZE, rng, f"held-out-{index}") for index in range(20))
    splits = {"train": load_mazes(_SIZE, "train"), "held out": held_out}
    recorded = {name: record(mazes, _NUM_STEPS[name], rng) for name, mazes in splits.items()}
    tests = {name: [draw(mazes, recorded[name], 0, rng) for _ in range(6)] for name, mazes in splits.items()}
    network = MMNNetwork(config, _SIZE)
    with torch.no_grad():
        network.scale.copy_(torch.tensor(_TRUE_SCALE))
    network.scale.requires_grad_(False)
    optimizer = torch.optim.AdamW(parameter_groups(network, config), lr=config.learning_rate)
    for update in range(1, num_updates + 1):
        for group in optimizer.param_groups:
            group["lr"] = group["rate"] * config.learning_rate * min(1.0, 0.6 * num_updates / update)
        batch = draw(splits["train"], recorded["train"], int(rng.integers(symmetry.NUM_SYMMETRIES)), rng)
        moved, body = errors(network, batch, encoded(network, batch))
        optimizer.zero_grad()
        (2 * moved + body).mean().backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), config.max_gradient_norm)
        optimizer.step()
        if update % max(1, num_updates // 4) == 0:
            for name, batches in tests.items():
                own, other = compare(network, batches)
                print(f"{update} updates, {name} mazes: {own:.4f} m, another maze's weights {other:.4f} m", flush=True)


if __name__ == "__main__":
    main(int((sys.argv[1:] or ["800"])[0]), dict(value.split("=", 1) for value in sys.argv[2:]))
