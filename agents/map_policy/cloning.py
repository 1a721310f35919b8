"""Trains the map policy to choose what the oracle would choose, in states of drives in fresh train mazes.

python -m mazebench_agents.map_policy.cloning --out map-policy.safetensors
"""

from __future__ import annotations

import argparse
import pathlib
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import torch
from torch.nn import functional

from mazebench.constants import NUM_ACTIONS
from mazebench.maps.maze import cell_to_point
from mazebench.tasks.task import Task
from mazebench.world.bodies import SLIDER
from mazebench.world.looks import LOOKS, PLAIN, VARIED, Camera, exposures_of
from mazebench.world.ray_camera import RayCamera

from ..common.actor import one_torch_thread
from ..common.checkpoint import save_checkpoint
from ..common.descent import Descent, cosine
from ..common.symmetry import NUM_SYMMETRIES, turn_actions, turn_planes
from ..robot.cells import marked_cell
from ..robot.motion import moved
from ..robot.moving_body import LOOK_LEFT, LOOK_RIGHT
from ..robot.quickest import costs_of_actions, make_course
from .map_policy import NAME
from .network import MapNetwork

_MAPS = 16  # of a batch
_POOL = 1536  # goals, from which batches are drawn; each update replaces some
_GOALS = 3  # of a maze
_DRIVES, _STEPS = 3, 8  # to a goal, and of a drive
_RANDOM = 0.25  # share of random actions
_FARTHEST = 40.0  # m from a goal
_SOFTNESS = 0.08  # m of costs, of the labels
_RATE, _FIRST_UPDATES = 1.5e-3, 30
_MAX_GRADIENT = 1.0


class Example(NamedTuple):
    """A goal in a maze, and `K` states of drives to it."""

    maze: int
    map: np.ndarray  # [2, L, L] float32, walls and goal
    pose: np.ndarray  # [K, 3] float64, m and rad
    velocity: np.ndarray  # [K, 2] float64, m/s on the map
    costs: np.ndarray  # [K, 6] float64, m, of the actions


class Examples:
    """A stream of examples in fresh train mazes, each with pictures when it is drawn."""

    def __init__(self, seed: int, pool: int = _POOL):
        """Makes `pool` examples, 20 a second."""
        self._rng = np.random.default_rng(seed)
        self._mazes = Task.of("building", split="train", fresh=True, kinds=("dfs", "house", "rooms")).mazes
        self._cameras = {look: RayCamera(self._mazes, Camera(), look) for look in LOOKS}
        self._pool: list[Example] = []
        while len(self._pool) < pool:
            self._pool += self._in_new_maze()
        self._oldest = 0

    def batch(self) -> tuple[torch.Tensor, ...]:
        """Returns maps, poses, velocities and pictures, as `MapNetwork` takes them, and labels `[G, K, 6]`."""
        # One more maze, whose goals replace the oldest ones.
        for example in self._in_new_maze():
            self._pool[self._oldest] = example
            self._oldest = (self._oldest + 1) % len(self._pool)
        chosen = [self._pool[index] for index in self._rng.integers(len(self._pool), size=_MAPS)]
        pictures = self._pictures(chosen, VARIED if self._rng.random() < 0.5 else PLAIN)

        # Each map is turned or mirrored, as if the drives had been in another maze.
        rows = [
            _turned(example, seen, int(symmetry))
            for example, seen, symmetry in zip(
                chosen, pictures, self._rng.integers(NUM_SYMMETRIES, size=_MAPS), strict=True
            )
        ]
        return tuple(torch.stack(parts) for parts in zip(*rows, strict=True))

    def _in_new_maze(self) -> list[Example]:
        """Returns examples of goals in a new maze."""
        rng, number = self._rng, int(self._rng.integers(len(self._mazes)))
        walls = self._mazes[number].walls
        cells = np.argwhere(~walls)
        return [self._example(number, walls, cells, cells[rng.integers(len(cells))]) for _ in range(_GOALS)]

    def _example(self, number: int, walls: np.ndarray, cells: np.ndarray, goal: np.ndarray) -> Example:
        """Returns states of drives that begin near and far, with random actions among the oracle's."""
        rng, course = self._rng, make_course(SLIDER, walls, 1.0, (int(goal[0]), int(goal[1])))
        side = len(course.way_left) // len(walls)
        distance = course.way_left[side // 2 :: side, side // 2 :: side][cells[:, 1], len(walls) - 1 - cells[:, 0]]
        farthest = min(_FARTHEST, distance[np.isfinite(distance)].max())
        wanted = rng.uniform(0.5, farthest, _DRIVES)
        starts = cells[np.abs(distance - wanted[:, None]).argmin(axis=1)]

        # Where the bodies are, how fast, and the costs of what they can do.
        pose = np.column_stack([cell_to_point(starts, len(walls)), rng.uniform(-np.pi, np.pi, _DRIVES)])
        velocity = np.zeros((_DRIVES, 2))
        same = [np.repeat(values[None], _DRIVES, axis=0) for values in (course.walls, course.way_left)]
        goals = np.full((_DRIVES, 2), (course.goal_x, course.goal_y))
        states = []
        for _ in range(_STEPS):
            costs = costs_of_actions(course.motion, *same, goals, 1.0, pose, velocity)
            states.append((pose.copy(), velocity.copy(), costs))
            is_random = rng.random(_DRIVES) < _RANDOM
            actions = np.where(is_random, rng.integers(NUM_ACTIONS, size=_DRIVES), costs.argmin(axis=1))
            pose[:, 2] += SLIDER.turn_step * ((actions == LOOK_LEFT) * 1.0 - (actions == LOOK_RIGHT))
            for drive, action in enumerate(actions.tolist()):
                x, y, yaw = pose[drive].tolist()
                x, y, *after = moved(course.motion, course.walls, 1.0, x, y, *velocity[drive].tolist(), yaw, action)
                pose[drive, :2], velocity[drive] = (x, y), after
        map_planes = np.zeros((2, *walls.shape), np.float32)
        map_planes[0], map_planes[1, goal[0], goal[1]] = walls, 1
        return Example(number, map_planes, *(np.concatenate(parts) for parts in zip(*states, strict=True)))

    def _pictures(self, chosen: list[Example], look: str) -> np.ndarray:
        """Returns `[G, K, 64, 64, 3]` uint8 of examples, in a look."""
        rng, num_states = self._rng, _DRIVES * _STEPS
        count = len(chosen) * num_states
        goals = [marked_cell(example.map[1]) for example in chosen]
        marker = np.pad(cell_to_point(np.array(goals), chosen[0].map.shape[-1]), ((0, 0), (0, 1)))  # on the floor
        gain, noise_at = np.ones(count, np.float32), np.full(count, -1)
        if look == VARIED:
            gain, noise_at = exposures_of(rng, count)
        maze = np.repeat([example.maze for example in chosen], num_states)
        pose = np.concatenate([example.pose for example in chosen])
        marker = np.repeat(marker, num_states, axis=0)
        taken = self._cameras[look].take(("egocentric",), maze, pose, marker, gain, noise_at)["egocentric"]
        return taken.reshape(len(chosen), num_states, *taken.shape[1:])


def _turned(example: Example, pictures: np.ndarray, symmetry: int) -> tuple[torch.Tensor, ...]:
    """Returns what a batch has of an example, in the world turned by a symmetry (see `common.symmetry`)."""
    size, (x, y, yaw), (vx, vy) = example.map.shape[-1], example.pose.T, example.velocity.T
    cosine, sine = np.cos(yaw), np.sin(yaw)
    forward, left = cosine * vx + sine * vy, cosine * vy - sine * vx
    maps, seen = turn_planes(torch.from_numpy(example.map), symmetry), torch.from_numpy(pictures)
    if symmetry >= 4:
        x, yaw, left, seen = size - x, np.pi - yaw, -left, seen.flip(2)
    for _ in range(symmetry % 4):
        x, y, yaw = size - y, x, yaw + np.pi / 2
    costs = example.costs[:, turn_actions(np.arange(NUM_ACTIONS), symmetry)]
    labels = torch.softmax(torch.from_numpy(-costs / _SOFTNESS).float(), dim=1)
    pose, velocity = np.stack([x, y, yaw], axis=1), np.stack([forward, left], axis=1)
    return maps, torch.from_numpy(pose).float(), torch.from_numpy(velocity).float(), seen, labels


@one_torch_thread()
def train(minutes: float, seed: int) -> Iterator[tuple[MapNetwork, str]]:
    """Yields the network and a line on its progress, some times a minute, for some minutes of CPU."""
    torch.manual_seed(seed)
    examples, network = Examples(seed), MapNetwork()
    begin, update, share, losses, right = time.process_time(), 0, 0.0, [], []
    descent = Descent(
        network,
        torch.optim.Adam(network.parameters(), _RATE),
        max_gradient_norm=_MAX_GRADIENT,
        rate=lambda update: min(1.0, update / _FIRST_UPDATES) * cosine(share),
    )
    while share < 1:
        maps, pose, velocity, pictures, labels = examples.batch()
        logits = network(network.read(maps), pose, velocity, pictures)
        loss = functional.cross_entropy(logits.flatten(0, 1), labels.flatten(0, 1))
        descent.step(loss)
        update += 1
        losses.append(loss.item())
        right.append((logits.argmax(-1) == labels.argmax(-1)).float().mean().item())
        share = (time.process_time() - begin) / (60 * minutes)
        if update % 50 == 0 or share >= 1:
            line = f"{update:,} updates, {share * minutes:.1f} min of CPU, loss {np.mean(losses[-50:]):.3f}"
            yield network, f"{line}, the oracle's action in {np.mean(right[-50:]):.3f}"


def main() -> None:
    """Trains, and writes the network every some minutes."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=60, help="of CPU")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="the file to write")
    options = parser.parse_args()
    for network, line in train(options.minutes, options.seed):
        print(line, flush=True)
        provenance = {"agent": NAME, "minutes": options.minutes, "seed": options.seed}
        save_checkpoint(options.out, network.state_dict(), provenance)


if __name__ == "__main__":
    main()
