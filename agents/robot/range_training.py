"""Trains the network that reads ranges from pictures, on pictures of fresh train mazes, each of them new.

python -m mazebench_agents.robot.range_training --fov 75 --out ranges-75.safetensors
"""

from __future__ import annotations

import argparse
import math
import pathlib
import time
from collections.abc import Iterator

import numpy as np
import torch

from mazebench.maps.drawn import Mazes
from mazebench.tasks.task import Task
from mazebench.world.looks import (
    FLOORS,
    LOOKS,
    PLAIN,
    TEXELS,
    VARIED,
    WALLS,
    Camera,
    exposures_of,
    flattened,
    patterns,
)  # fmt: skip
from mazebench.world.ray_camera import RayCamera
from mazebench.world.ray_casting import NUM_RAYS as LIDAR_RAYS
from mazebench.world.ray_casting import Lidar

from ..common.actor import one_torch_thread
from ..common.checkpoint import save_checkpoint
from ..common.descent import Descent, cosine
from .camera_ranges import MAX_RANGE, NAME, NUM_RAYS, SURE, RangeNetwork, rays_in_view

_BATCH = 64
_NUM_MAZES = 256  # that pictures are drawn from at a time; each update replaces one
_CLEAR = 0.16  # m from the body's centre to the nearest wall, at least
_MARKED = 0.3  # share of pictures with the goal's disc in view
_VARIED_SHARE = 0.75  # of batches
_SAME_MASKS = 8  # batches with the same patterns


class Pictures:
    """A stream of pictures and true ranges at random poses."""

    def __init__(self, mazes: Mazes, fov: float, seed: int, split: str = "train"):
        """Draws with the patterns of a split."""
        self._mazes, self._rng, self._rays = mazes, np.random.default_rng(seed), rays_in_view(fov)
        self._cameras = {look: RayCamera(mazes, Camera(fov=fov), look, split) for look in LOOKS}
        self._lidar, self._num_drawn, self._split = Lidar(mazes), 0, split
        self._pool = self._rng.integers(len(mazes), size=min(_NUM_MAZES, len(mazes)))

    def draw(self, look: str, count: int = _BATCH) -> tuple[np.ndarray, np.ndarray]:
        """Returns pictures `[count, 64, 64, 3]` uint8 and ranges `[count, R]` float32 in m."""
        rng = self._rng
        if look == VARIED and self._split == "train" and self._num_drawn % _SAME_MASKS == 0:
            self._cameras[look].masks = other_patterns(rng)
        self._num_drawn += 1
        self._pool[rng.integers(len(self._pool))] = rng.integers(len(self._mazes))
        maze = rng.choice(self._pool, count)
        pose = np.array([self._pose(self._mazes[number].walls) for number in maze])

        # The goal's disc is in the middle of a cell ahead, or nowhere.
        far, aside = rng.uniform(0.5, 4, count), pose[:, 2] + rng.uniform(-0.7, 0.7, count)
        marker = np.floor(pose[:, :2] + far[:, None] * np.stack([np.cos(aside), np.sin(aside)], axis=1)) + 0.5
        marker = np.where(rng.random((count, 1)) < _MARKED, marker, -10.0)
        gain, noise_at = np.ones(count, np.float32), np.full(count, -1)
        if look == VARIED:
            gain, noise_at = exposures_of(rng, count, self._split)
        marker = np.column_stack([marker, np.zeros(count)])
        pictures = self._cameras[look].take(("egocentric",), maze, pose, marker, gain, noise_at)["egocentric"]

        # The lidar's rays at several headings are those between them, too.
        ranges = np.empty((count, NUM_RAYS), np.float32)
        parts = NUM_RAYS // LIDAR_RAYS
        for part in range(parts):
            turned = pose + np.array([0, 0, part * 2 * math.pi / NUM_RAYS])
            ranges[:, part::parts] = self._lidar.ranges(maze, turned)
        return pictures, ranges[:, self._rays]

    def _pose(self, walls: np.ndarray) -> tuple[float, float, float]:
        """Returns a pose at which no wall is near."""
        size = len(walls)
        while True:
            x, y = self._rng.uniform(0, size, 2)
            columns = [int(x - _CLEAR), int(x + _CLEAR)]
            rows = [size - 1 - int(y - _CLEAR), size - 1 - int(y + _CLEAR)]
            if min(columns + rows) >= 0 and max(columns + rows) < size and not walls[np.ix_(rows, columns)].any():
                return x, y, self._rng.uniform(-math.pi, math.pi)


def other_patterns(rng: np.random.Generator) -> np.ndarray:
    """Returns patterns as `looks.patterns` does, with mixtures of turned and inverted ones for training mazes."""
    masks = patterns()
    whole = masks[:, : TEXELS**2].reshape(-1, TEXELS, TEXELS).astype(np.float64)
    for chosen in (WALLS["train"], FLOORS["train"]):
        drawn = []
        for number in chosen:
            parts = [whole[number], whole[rng.choice(chosen)]]
            turned = [
                np.roll(np.rot90(part, int(rng.integers(4))), rng.integers(TEXELS, size=2), (0, 1)) for part in parts
            ]
            share = rng.choice([0.0, rng.uniform(0, 0.5)])
            mixed = (1 - share) * turned[0] + share * turned[1]
            drawn.append((mixed if rng.random() < 0.5 else 255 - mixed) * rng.uniform(0.5, 1))
        whole[chosen] = drawn
    return flattened(whole)


@one_torch_thread()
def train(fov: float, updates: int, seed: int) -> Iterator[tuple[int, float, RangeNetwork]]:
    """Yields the number of updates, the mean loss and the network, every few hundred updates."""
    torch.manual_seed(seed)
    task = Task.of("building", split="train", fresh=True, kinds=("dfs", "house", "rooms"))
    pictures, rng = Pictures(task.mazes, fov, seed), np.random.default_rng([seed, 1])
    network = RangeNetwork(len(rays_in_view(fov)))
    descent = Descent(
        network,
        torch.optim.Adam(network.parameters(), 2e-3),
        max_gradient_norm=1.0,
        rate=lambda update: cosine((update - 1) / updates),
    )
    losses = []
    for update in range(1, updates + 1):
        seen, ranges = pictures.draw(VARIED if rng.random() < _VARIED_SHARE else PLAIN)
        loss = network.loss(torch.from_numpy(seen), torch.from_numpy(ranges))
        descent.step(loss)
        losses.append(loss.item())
        if update % 500 == 0 or update == updates:
            yield update, float(np.mean(losses[-500:])), network


def errors(network: RangeNetwork, fov: float, look: str, count: int = 1536) -> list[str]:
    """Returns rows of a table: errors on dev mazes, with patterns that were not trained on."""
    mazes = Task.of("building", split="dev").mazes
    drawn = [Pictures(mazes, fov, 10 + part, "dev").draw(look, 256) for part in range(count // 256)]
    pictures, true = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
    ranges, scales = network.read(pictures)
    off = np.abs(np.minimum(ranges, MAX_RANGE) - np.minimum(true, MAX_RANGE))
    rows = []
    for low, high in ((0, 1), (1, 2), (2, 3), (3, 3.5)):
        chosen = (true >= low) & (true < high)
        part, sure = off[chosen], (scales < SURE)[chosen]
        rows.append(
            f"{look}, {low} to {high} m: median {np.median(part):.3f} m, 90 % {np.quantile(part, 0.9):.2f} m, "
            f"{np.mean(part > 0.5):.1%} over .5 m; sure of {sure.mean():.0%}, {np.mean(part[sure] > 0.2):.1%} of these "
            "off by over .2 m"
        )
    return rows


def main() -> None:
    """Trains, writes the network and says its errors."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--fov", type=float, default=75, help="degrees of the camera's view")
    parser.add_argument("--updates", type=int, default=28_000, help="of 64 pictures each")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="the file to write")
    options = parser.parse_args()
    for update, loss, network in train(options.fov, options.updates, options.seed):  # noqa: B007
        print(f"{update:,} updates, {time.process_time():.0f} s of CPU, loss {loss:.3f}", flush=True)
    provenance = {"agent": NAME, "fov": options.fov, "updates": options.updates, "seed": options.seed}
    save_checkpoint(options.out, network.state_dict(), provenance)
    for look in LOOKS:
        print(*errors(network, options.fov, look), sep="\n", flush=True)


if __name__ == "__main__":
    main()
