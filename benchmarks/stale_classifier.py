"""Trains a network to recognise moved doors on maps of the track `stale` alone; prints Markdown tables.

`B` is the number of maps in a batch, `R` of rooms (cells with odd row and column), `D` of doors between two rooms. A
"naive" map makes random swaps of an open and a closed door that leave the maze connected; a "searched" one is made by
`mazebench.tasks.tracks.stale.move_doors`. Both are drawn from mazes of our own, never from those of an evaluation. The
second table says how often the shortest path on a searched map leads through a wall of the world.
docs/tracks_v2.md shows what this prints.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from scipy import ndimage, stats
from torch import nn
from torch.nn import functional

from mazebench.maps.kinds.dfs import dfs_walls
from mazebench.maps.maze import Maze, corner_cells
from mazebench.tasks.perturbations.base import ShownMap
from mazebench.tasks.tracks.stale import SWAPS, Stale, move_doors

SIZE = 13  # cells a side
ACROSS = SIZE // 2  # rooms a side
NUM_TRAINING = 60_000  # pairs of a map and its world, each seen once
NUM_HELD_OUT = 5_000  # pairs of other mazes, on which the AUC is measured
BATCH_SIZE = 128
LEARNING_RATE = 2e-3
WIDTH, DEPTH = 48, 5
NUM_PLANES = 15
MAZE_LOSS = 0.3  # weight of telling maps from mazes; the doors matter more
MAX_TRIES = 500  # of one random swap, before all are drawn anew
NUM_PATHS = 2_000  # for each share of blocked paths
FAR = 99  # more than any distance between two rooms

CELLS = np.array([(r, c) for r in range(1, SIZE - 1) for c in range(1, SIZE - 1) if (r + c) % 2])  # [D, 2]
DOWN = CELLS[:, 0] % 2 == 0  # [D] bool: the door leads from a room to the one below, not to the one on its right
FIRST = (CELLS[:, 0] - DOWN) // 2 * ACROSS + (CELLS[:, 1] - ~DOWN) // 2  # [D]: the room above, or on the left
SECOND = FIRST + np.where(DOWN, ACROSS, 1)
ROOM_ROW, ROOM_COLUMN = np.divmod(FIRST, ACROSS)


def main() -> None:
    """Prints how well moved doors are recognised, and how many shown paths are blocked."""
    torch.set_num_threads(1)
    print(f"AUC on {NUM_HELD_OUT:,} held-out maps after training on {NUM_TRAINING:,}:\n")
    print("| swaps | maps | shown open | at equal position | position only", end="")
    print(" | shown closed | at equal position | position only | map or maze |")
    print("|" + " --- |" * 9)
    for num_swaps in SWAPS:
        for name, draw in (("naive", naive_doors), ("searched", searched_doors)):
            print(
                f"| {num_swaps} | {name} |",
                " | ".join(f"{auc:.2f}" for auc in measure(draw, num_swaps)),
                "|",
                flush=True,
            )
    print("\nShare of shortest paths on the map that are blocked in the world:\n")
    print("| swaps | corner to corner | random pairs, 3 to 20 cells |\n| --- | --- | --- |")
    for num_swaps in SWAPS:
        shares = (blocked_share(num_swaps, pair) for pair in (corner_cells, random_pair))
        print(f"| {num_swaps} |", " | ".join(f"{share:.2f}" for share in shares), "|", flush=True)


def random_world(rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of a maze in which enough doors can move for every level."""
    while True:
        walls = dfs_walls(SIZE, rng)
        if walls[tuple(CELLS.T)].sum() > max(SWAPS):
            return walls


def naive_doors(walls: np.ndarray, num_swaps: int, rng: np.random.Generator) -> np.ndarray:
    """Returns `walls` after random swaps, none of a door that has moved, each of which leaves them connected."""
    while True:
        moved, is_closed = walls.copy(), walls[tuple(CELLS.T)]
        open_doors, closed_doors = CELLS[~is_closed].tolist(), CELLS[is_closed].tolist()
        if all(_swap(moved, open_doors, closed_doors, rng) for _ in range(num_swaps)):
            return moved


def _swap(moved: np.ndarray, open_doors: list, closed_doors: list, rng: np.random.Generator) -> bool:
    """Closes one of the open doors and opens one of the closed ones, in place; returns whether it found two."""
    for _ in range(MAX_TRIES):
        closing, opening = int(rng.integers(len(open_doors))), int(rng.integers(len(closed_doors)))
        moved[tuple(open_doors[closing])], moved[tuple(closed_doors[opening])] = True, False
        if ndimage.label(~moved)[1] == 1:
            del open_doors[closing], closed_doors[opening]
            return True
        moved[tuple(open_doors[closing])], moved[tuple(closed_doors[opening])] = False, True
    return False


def searched_doors(walls: np.ndarray, num_swaps: int, rng: np.random.Generator) -> np.ndarray:
    """Returns the map that the track shows."""
    return move_doors(walls, num_swaps, (), rng)


def blocked_share(num_swaps: int, pair: Callable) -> float:
    """Returns the share of shortest paths on a map, between a pair of cells of the world, that lead through a wall."""
    rng = np.random.default_rng(1)
    blocked = 0
    for _ in range(NUM_PATHS):
        maze = Maze(random_world(rng))
        ends = pair(maze) if pair is corner_cells else pair(maze, rng)
        shown = ShownMap(move_doors(maze.walls, num_swaps, ends, rng))
        blocked += Stale().facts(maze.walls, shown, ends)["blocked"]
    return blocked / NUM_PATHS


def random_pair(maze: Maze, rng: np.random.Generator) -> tuple[tuple[int, int], tuple[int, int]]:
    """Returns two cells whose distance is drawn from 3 to 20 cells, or the longest that the first one has."""
    start = tuple(rng.choice(maze.free_cells).tolist())
    distances = maze.distances(start)
    goals = np.argwhere(distances == min(int(rng.integers(3, 21)), distances.max()))
    return start, tuple(rng.choice(goals).tolist())


def measure(draw: Callable, num_swaps: int) -> list[float]:
    """Returns seven AUCs: for doors shown open and doors shown closed, the network's, the network's among doors of
    equal position, and that of the position alone; then the network's for telling maps from mazes."""
    rng = np.random.default_rng(0)
    worlds = [random_world(rng) for _ in range(NUM_TRAINING + NUM_HELD_OUT)]
    maps = np.array([draw(walls, num_swaps, rng)[tuple(CELLS.T)] for walls in worlds])
    mazes = np.array([walls[tuple(CELLS.T)] for walls in worlds])
    network = train(~maps[:NUM_TRAINING], ~mazes[:NUM_TRAINING])
    is_open, moved = ~maps[NUM_TRAINING:], (maps != mazes)[NUM_TRAINING:]
    door_scores, map_scores = scores(network, is_open)
    _, maze_scores = scores(network, ~mazes[NUM_TRAINING:])
    aucs = []
    for shown in (is_open, ~is_open):
        position = np.broadcast_to(_positions(), shown.shape)[shown]
        rate = np.bincount(position, moved[shown]) / np.maximum(np.bincount(position), 1)
        aucs += [
            area(door_scores[shown], moved[shown]),
            area_within(door_scores[shown], moved[shown], position),
            area(rate[position], moved[shown]),
        ]
    is_map = np.arange(2 * NUM_HELD_OUT) < NUM_HELD_OUT
    return [*aucs, area(np.concatenate([map_scores, maze_scores]), is_map)]


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


def _positions() -> np.ndarray:
    """Returns `[D]` int: the same number for doors that a rotation or reflection of the maze brings together."""
    offsets = np.sort(np.abs(CELLS - SIZE // 2), axis=1)
    return np.unique(offsets, axis=0, return_inverse=True)[1].ravel()


class Network(nn.Module):
    """A residual network on the rooms that scores each room's doors to the right and below, and the whole map."""

    def __init__(self) -> None:
        super().__init__()
        self.first = nn.Conv2d(NUM_PLANES, WIDTH, 3, padding=1)
        self.blocks = nn.ModuleList(
            nn.Sequential(nn.BatchNorm2d(WIDTH), nn.ReLU(), nn.Conv2d(WIDTH, WIDTH, 3, padding=1)) for _ in range(DEPTH)
        )
        self.overall = nn.Linear(WIDTH, WIDTH)
        self.doors = nn.Sequential(nn.BatchNorm2d(WIDTH), nn.ReLU(), nn.Conv2d(WIDTH, 2, 1))
        self.map = nn.Sequential(nn.Linear(2 * WIDTH, 64), nn.ReLU(), nn.Linear(64, 1))

    def forward(self, planes: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Returns logits `[B, D]` of moved doors and `[B]` of maps, given `planes` `[B, C, rooms, rooms]`."""
        x = self.first(planes)
        for index, block in enumerate(self.blocks):
            x = x + block(x)
            if index == DEPTH // 2:
                x = x + self.overall(x.mean((2, 3)))[:, :, None, None]
        doors = self.doors(x)[:, DOWN.astype(int), ROOM_ROW, ROOM_COLUMN]
        return doors, self.map(torch.cat([x.mean((2, 3)), x.amax((2, 3))], dim=1))[:, 0]


def train(maps: np.ndarray, mazes: np.ndarray) -> Network:
    """Returns a network trained on the open doors of maps and of their mazes: `[NUM_TRAINING, D]` bool each."""
    torch.manual_seed(0)
    network = Network()
    optimizer = torch.optim.AdamW(network.parameters(), LEARNING_RATE, weight_decay=1e-3)
    num_steps = len(maps) // BATCH_SIZE
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, LEARNING_RATE, total_steps=num_steps)
    bce = functional.binary_cross_entropy_with_logits
    for step in range(num_steps):
        batch = slice(step * BATCH_SIZE, (step + 1) * BATCH_SIZE)
        # The mazes of other maps, so that no maze stands beside a map that was drawn from it.
        others = mazes[np.arange(batch.start, batch.stop) - BATCH_SIZE]
        doors, is_map = network(planes(np.concatenate([maps[batch], others])))
        moved = torch.from_numpy((maps[batch] != mazes[batch]).astype(np.float32))
        label = (torch.arange(2 * BATCH_SIZE) < BATCH_SIZE).float()
        loss = bce(doors[:BATCH_SIZE], moved) + MAZE_LOSS * bce(is_map, label)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
    return network.eval()


@torch.no_grad()
def scores(network: Network, is_open: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns logits `[K, D]` of moved doors and `[K]` of maps, given the open doors `[K, D]` bool."""
    parts = [network(planes(part)) for part in np.array_split(is_open, max(1, len(is_open) // 500))]
    doors, maps = zip(*parts, strict=True)
    return torch.cat(doors).numpy(), torch.cat(maps).numpy()


def planes(is_open: np.ndarray) -> torch.Tensor:
    """Returns what the network sees of open doors `[B, D]` bool: `[B, NUM_PLANES, rooms, rooms]` float32.

    The planes hold which of a room's four doors are open, which exist, and the room's row and column. For a closed door
    to the right or below they hold the length of the way around it, and the share of rooms that are not farther from
    one of its sides by that length: in a tree that a depth-first search makes, its first room is none of them. The last
    plane holds the least number of such doors for any room.
    """
    distance = room_distances(is_open)
    around = np.where(is_open, 0, distance[:, FIRST, SECOND])  # [B, D]
    beside = (abs(distance[:, :, FIRST] - distance[:, :, SECOND]) < around[:, None]) & ~is_open[:, None]  # [B, R, D]
    result = np.zeros((len(is_open), NUM_PLANES, ACROSS, ACROSS), dtype=np.float32)
    second_row, second_column = np.divmod(SECOND, ACROSS)
    result[:, 2 * DOWN, ROOM_ROW, ROOM_COLUMN] = is_open
    result[:, 2 * DOWN + 1, second_row, second_column] = is_open
    result[:, 4 + 2 * DOWN, ROOM_ROW, ROOM_COLUMN] = 1
    result[:, 5 + 2 * DOWN, second_row, second_column] = 1
    result[:, 8] = np.arange(ACROSS)[:, None] / ACROSS
    result[:, 9] = np.arange(ACROSS) / ACROSS
    result[:, 10 + DOWN, ROOM_ROW, ROOM_COLUMN] = around / 20
    result[:, 12 + DOWN, ROOM_ROW, ROOM_COLUMN] = beside.mean(axis=1)
    result[:, 14] = beside.sum(axis=2).min(axis=1)[:, None, None] / 5
    return torch.from_numpy(result)


def room_distances(is_open: np.ndarray) -> np.ndarray:
    """Returns `[B, R, R]` int16: the distances between rooms, in doors, by the Floyd-Warshall algorithm."""
    distance = np.full((len(is_open), ACROSS**2, ACROSS**2), FAR, dtype=np.int16)
    distance[:, range(ACROSS**2), range(ACROSS**2)] = 0
    distance[:, FIRST, SECOND] = distance[:, SECOND, FIRST] = np.where(is_open, 1, FAR)
    for room in range(ACROSS**2):
        np.minimum(distance, distance[:, :, room, None] + distance[:, None, room], out=distance)
    return distance


if __name__ == "__main__":
    main()
