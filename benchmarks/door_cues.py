"""How well a network tells moved doors of v3 from the map alone: the check `cue` of `benchmarks.v3_checks`.

`B` is the number of maps in a batch, `N` of cells on a side, `D` of door slots. Mazes are drawn from a seed of the
check, and doors are moved as on the track `rebuilt`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from mazebench_agents.common.kernels import compiled
from scipy import special, stats
from torch import nn
from torch.nn import functional

from benchmarks.ideal_agents import Cue
from mazebench.maps.benchmark import KINDS_SIZE
from mazebench.maps.doors import door_slots, swap_doors
from mazebench.maps.kinds import generate
from mazebench.maps.kinds.base import rooms_beside
from mazebench.maps.maze import Maze
from mazebench.tasks.tracks.rebuilt import num_swaps

NUM_TRAINING, NUM_HELD_OUT = 5_000, 1_000  # maps, each of another maze
EPOCHS = 4
BATCH_SIZE = 64
LEARNING_RATE = 2e-3
WIDTH, DEPTH = 48, 5
NUM_PLANES = 10
_SEED = 7_901


class Maps(NamedTuple):
    """Maps on which doors have moved; `K` is their number."""

    planes: np.ndarray  # [K, NUM_PLANES, N, N] float16, what the network sees
    is_slot: np.ndarray  # [K, N, N] bool
    moved: np.ndarray  # [K, N, N] bool, which of the slots have moved


class Measured(NamedTuple):
    """A cue, and how good it is."""

    aucs: list[float]  # of doors shown open, then closed: the cue's, its own at equal position, that of position alone
    cue: Cue


def measure_cue(kind: str, share: float) -> Measured:
    """Trains a network on maps of a kind, on which a share of the paths is blocked, and measures it on others."""
    torch.set_num_threads(1)
    rng = np.random.default_rng(_SEED)
    network = train(draw_maps(kind, share, NUM_TRAINING, rng))
    held_out = draw_maps(kind, share, NUM_HELD_OUT, rng)
    scores = np.concatenate([_scores(network, part) for part in np.array_split(held_out.planes, NUM_HELD_OUT // 50)])
    is_closed = held_out.planes[:, 0] > 0

    aucs = []
    for shown in (held_out.is_slot & ~is_closed, held_out.is_slot & is_closed):
        position = np.broadcast_to(_positions(), shown.shape)[shown]
        score, label = scores[shown], held_out.moved[shown]
        rate = np.bincount(position, label) / np.maximum(np.bincount(position), 1)
        aucs += [area(score, label), area_within(score, label, position), area(rate[position], label)]
    return Measured(
        aucs, lambda shown: special.expit(_scores(network, _planes(shown.walls, door_slots(shown))[None])[0])
    )


def area(score: np.ndarray, label: np.ndarray) -> float:
    """Returns the area under the ROC curve: how often a true label scores higher than a false one; ties are halves."""
    num_true = int(label.sum())
    above = stats.rankdata(score)[label].sum() - num_true * (num_true + 1) / 2
    return float(above / (num_true * (len(label) - num_true)))


def area_within(score: np.ndarray, label: np.ndarray, group: np.ndarray) -> float:
    """Returns the area under the ROC curve over pairs of one group."""
    areas, num_pairs = [], []
    for index in np.unique(group):
        inside = label[group == index]
        if 0 < inside.sum() < len(inside):
            areas.append(area(score[group == index], inside))
            num_pairs.append(inside.sum() * (~inside).sum())
    return float(np.average(areas, weights=num_pairs))


def draw_maps(kind: str, share: float, count: int, rng: np.random.Generator) -> Maps:
    """Returns maps of new mazes of a kind, on which as many doors have moved as block a share of the paths."""
    maps = []
    for _ in range(count):
        maze = generate(kind, KINDS_SIZE, rng)
        shown = swap_doors(maze.walls, door_slots(maze), num_swaps(maze, share), (), rng)
        slots = door_slots(Maze(shown, kind=kind))
        is_slot = np.zeros_like(shown)
        is_slot[tuple(slots.T)] = True
        maps.append((_planes(shown, slots), is_slot, is_slot & (shown != maze.walls)))
    return Maps(*map(np.array, zip(*maps, strict=True)))


def _planes(walls: np.ndarray, slots: np.ndarray) -> np.ndarray:
    """Returns `[NUM_PLANES, N, N]` float16 of a map.

    They hold its walls and its slots; how far a cell is from the centre; and of each slot the length of the shortest
    way around it, whether there is none, the share of cells that are about as far from one of its sides as from the
    other, and how many doors its two rooms have beside it.
    """
    row, column = slots.T
    is_open = ~walls[row, column]
    rooms = rooms_beside(walls, slots)
    num_doors = np.bincount(np.concatenate(rooms)[np.tile(is_open, 2)], minlength=max(map(np.max, rooms)) + 1)
    others = np.sort([num_doors[room] - is_open for room in rooms], axis=0)
    way, share = _ways_around(walls, slots)
    planes = np.zeros((NUM_PLANES, *walls.shape), np.float16)
    planes[0] = walls
    planes[1, row, column] = is_open
    planes[2, row, column] = ~is_open
    planes[3:5] = np.sort(np.abs(np.indices(walls.shape) - len(walls) // 2), axis=0) / len(walls)
    planes[5, row, column] = np.log1p(np.maximum(way, 0)) / 4
    planes[6, row, column] = way < 0
    planes[7, row, column] = share
    planes[8:10, row, column] = others / 4
    return planes


@compiled
def _ways_around(walls: np.ndarray, slots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns `[D]` the cells of the shortest way from one side of each slot to the other if the slot is closed, -1 if
    there is none; and `[D]` the share of cells whose distances from both sides differ by less than that."""
    size = len(walls)
    ways, shares = np.full(len(slots), -1.0), np.zeros(len(slots))
    distance = np.empty((2, size, size), np.int64)
    queue = np.empty((size * size, 2), np.int64)
    for index in range(len(slots)):
        row, column = slots[index]
        upright = not (walls[row - 1, column] or walls[row + 1, column]) and walls[row, column - 1]
        down, right = (1, 0) if upright else (0, 1)
        for side in range(2):
            sign = 2 * side - 1
            distance[side] = -1
            queue[0] = row + sign * down, column + sign * right
            distance[side, queue[0, 0], queue[0, 1]] = 0
            first, end = 0, 1
            while first < end:
                r, c = queue[first]
                first += 1
                for d, e in ((-1, 0), (0, -1), (1, 0), (0, 1)):
                    y, x = r + d, c + e
                    if not walls[y, x] and distance[side, y, x] < 0 and (y != row or x != column):
                        distance[side, y, x] = distance[side, r, c] + 1
                        queue[end] = y, x
                        end += 1
        way = distance[0, row + down, column + right]
        if way >= 0:
            reached = distance[0] >= 0
            ways[index] = way
            shares[index] = np.sum(reached & (np.abs(distance[0] - distance[1]) < way)) / np.sum(reached)
    return ways, shares


def _positions() -> np.ndarray:
    """Returns `[N, N]` int: the same number for cells that a rotation or reflection of the maze brings together."""
    offsets = np.sort(np.abs(np.indices((KINDS_SIZE, KINDS_SIZE)) - KINDS_SIZE // 2), axis=0)
    return offsets[0] * KINDS_SIZE + offsets[1]


class Network(nn.Module):
    """A residual network on blocks of 2 x 2 cells that scores each cell as a moved door."""

    def __init__(self) -> None:
        super().__init__()
        self.first = nn.Conv2d(NUM_PLANES, WIDTH, 4, stride=2, padding=1)
        self.blocks = nn.ModuleList(
            nn.Sequential(nn.BatchNorm2d(WIDTH), nn.ReLU(), nn.Conv2d(WIDTH, WIDTH, 3, padding=1)) for _ in range(DEPTH)
        )
        self.overall = nn.Linear(WIDTH, WIDTH)
        self.up = nn.PixelShuffle(2)
        self.doors = nn.Sequential(nn.Conv2d(WIDTH // 4 + NUM_PLANES, 32, 1), nn.ReLU(), nn.Conv2d(32, 1, 1))

    def forward(self, planes: torch.Tensor) -> torch.Tensor:
        """Returns logits `[B, N, N]`, given `planes` `[B, NUM_PLANES, N, N]`; N is odd."""
        padded = functional.pad(planes, (0, 1, 0, 1))
        x = self.first(padded)
        for index, block in enumerate(self.blocks):
            x = x + block(x)
            if index == DEPTH // 2:
                x = x + self.overall(x.mean((2, 3)))[:, :, None, None]
        return self.doors(torch.cat([self.up(x), padded], dim=1))[:, 0, :-1, :-1]


def train(maps: Maps) -> Network:
    """Returns a network trained on maps, each turned and mirrored at random whenever it comes up."""
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    network = Network()
    optimizer = torch.optim.AdamW(network.parameters(), LEARNING_RATE, weight_decay=1e-3)
    num_batches = len(maps.planes) // BATCH_SIZE  # of an epoch
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, LEARNING_RATE, total_steps=EPOCHS * num_batches)
    order = [rng.permutation(len(maps.planes))[: num_batches * BATCH_SIZE] for _ in range(EPOCHS)]
    for batch in np.reshape(order, (-1, BATCH_SIZE)):
        turns, step = int(rng.integers(4)), int(rng.choice((1, -1)))
        turned = (np.rot90(part[batch], turns, axes=(-2, -1))[..., ::step].astype(np.float32) for part in maps)
        planes, is_slot, moved = map(torch.from_numpy, turned)
        logits = network(planes)
        loss = functional.binary_cross_entropy_with_logits(logits, moved, weight=is_slot)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
    return network.eval()


@torch.no_grad()
def _scores(network: Network, planes: np.ndarray) -> np.ndarray:
    return network(torch.from_numpy(planes.astype(np.float32))).numpy()
