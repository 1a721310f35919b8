"""What can be reached on the tracks of v2 at most: `python benchmarks/track_ceilings.py [--split eval]`.

An ideal agent drives on the grid. It knows its cell, sees every cell within 5 m that no wall hides, and knows where
each cell is drawn on the shown map. It believes the map where it has seen nothing, and follows a shortest path on what
it believes; a shown wall that it has not seen costs as much as some cells. An episode succeeds if the cells that it
enters take it no more steps than the time limit has.
"""

from __future__ import annotations

import argparse
import functools
from collections.abc import Iterator

import numpy as np
from scipy.sparse import csgraph, csr_array

from mazebench.constants import TRACKS_VERSION
from mazebench.evaluation.options import EvalOptions
from mazebench.evaluation.plan import make_plan
from mazebench.maps.maze import Cell, Maze, cell_to_point
from mazebench.results.intervals import mean_interval
from mazebench.tasks.context import resized_map
from mazebench.tasks.imperfections import time_limit
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.spec import TaskSpec
from mazebench.tasks.tracks import tracks_of
from mazebench.tasks.tracks.base import LEVELS
from mazebench.tasks.trials import Trial

SEEN_WITHIN = 5.0  # m
SHOWN_WALL = 30.0  # cells; the cost of a wall that is shown but was not seen
STEPS_PER_CELL = 2.6  # the oracle takes 2.2 to 2.3; the rest is for turning round
FIRST_STEPS = 3.0  # for the first turn
RAYS = 720


def main() -> None:
    """Prints success rate with its interval, and the share of episodes whose shown path is blocked."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--split", default="train", choices=("train", "eval"))
    split = parser.parse_args().split
    print("| track | level | episodes | success rate | cells entered / shortest path |\n|---|---|---|---|---|")
    for track in tracks_of(f"v{TRACKS_VERSION}"):
        for level in LEVELS:
            print(f"| `{track}` | {level} | {_row(track, level, split)} |", flush=True)


def _row(track: str, level: int, split: str) -> str:
    options = EvalOptions.of("oracle", track=track, level=level, split=split, episodes_per_distance=1)
    plan = make_plan(options)
    trials = plan.trials if split == "eval" else _thinned(plan.trials, 400)
    outcomes = [_drive(plan.task, trial) for trial in trials]
    reached = np.array([success for success, _ in outcomes])
    detour = np.mean([entered / trial.distance for (_, entered), trial in zip(outcomes, trials, strict=True)])
    estimate = mean_interval(reached.astype(float), np.array([trial.episode.maze for trial in trials]))
    return f"{len(trials)} | {estimate.value:.3f} [{estimate.low:.3f}, {estimate.high:.3f}] | {detour:.2f}"


def _thinned(trials: tuple[Trial, ...], count: int) -> list[Trial]:
    return [trials[index] for index in np.linspace(0, len(trials) - 1, min(count, len(trials))).astype(int)]


def _drive(task: TaskSpec, trial: Trial) -> tuple[bool, int]:
    """Returns whether the ideal agent arrives in time, and how many cells it enters (at most as many as it may)."""
    episode, maze = trial.episode, task.mazes[trial.episode.maze]
    most_cells = int((time_limit(task, episode) - FIRST_STEPS) / STEPS_PER_CELL)
    cost = _believed_cost(task, trial)
    cell = episode.start
    for entered in range(most_cells + 1):
        if cell == episode.goal:
            return True, entered
        free, walls = _seen(maze, cell)
        cost[free], cost[walls] = 1.0, np.inf
        cell = _next_cell(cost, cell, episode.goal)
    return False, most_cells


def _believed_cost(task: TaskSpec, trial: Trial) -> np.ndarray:
    """Returns `[N, N]` float: what entering each cell costs by the shown map alone."""
    size, shown = task.size, show_map(task, trial.episode)
    picture = shown.seen_walls().astype(np.float64)
    cells = np.stack(np.meshgrid(np.arange(size), np.arange(size), indexing="ij"), axis=-1).reshape(-1, 2)
    if shown.drawing is None:
        pixels = cells * task.context_size // size
        context = resized_map(shown.walls, task.context_size)
        share = context[tuple(pixels.T)]
    else:
        points = shown.seen_points(cell_to_point(cells, size))
        rows, columns = len(picture) - 1 - np.floor(points[:, 1]).astype(int), np.floor(points[:, 0]).astype(int)
        share = picture[np.clip(rows, 0, len(picture) - 1), np.clip(columns, 0, len(picture) - 1)]
    cost = np.where(share > 0.5, SHOWN_WALL, 1.0 + share).reshape(size, size)
    cost[[0, -1]] = cost[:, [0, -1]] = np.inf
    cost[trial.episode.goal] = 1.0
    return cost


@functools.lru_cache(maxsize=100_000)
def _seen(maze: Maze, cell: Cell) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Returns the indices of the free cells and of the walls that can be seen from the centre of `cell`."""
    angles = np.arange(RAYS) * 2 * np.pi / RAYS + 1e-3
    reach = np.arange(0.05, SEEN_WITHIN, 0.05)
    rows = np.floor(cell[0] + 0.5 - np.sin(angles)[:, None] * reach).astype(int).clip(0, maze.size - 1)
    columns = np.floor(cell[1] + 0.5 + np.cos(angles)[:, None] * reach).astype(int).clip(0, maze.size - 1)
    wall = maze.walls[rows, columns]
    before = np.cumsum(wall, axis=1) - wall
    free, hit = (before == 0) & ~wall, (before == 0) & wall
    seen_free, seen_wall = np.zeros_like(maze.walls), np.zeros_like(maze.walls)
    seen_free[rows[free], columns[free]] = True
    seen_wall[rows[hit], columns[hit]] = True
    return np.nonzero(seen_free), np.nonzero(seen_wall)


def _next_cell(cost: np.ndarray, cell: Cell, goal: Cell) -> Cell:
    """Returns the neighbour of `cell` on a cheapest path to `goal`."""
    size = len(cost)
    distance = csgraph.dijkstra(_graph(cost), indices=goal[0] * size + goal[1]).reshape(size, size)
    return min(_neighbours(cell), key=lambda other: cost[other] + distance[other])


def _graph(cost: np.ndarray) -> csr_array:
    """Returns the graph whose edge u -> v costs entering u: it is searched backwards from the goal."""
    size = len(cost)
    index = np.arange(size * size).reshape(size, size)
    pairs = [(index[:, :-1], index[:, 1:]), (index[:-1], index[1:])]
    a = np.concatenate([each.ravel() for pair in pairs for each in pair])
    b = np.concatenate([each.ravel() for pair in pairs for each in pair[::-1]])
    enter = cost.ravel()[a]
    finite = np.isfinite(enter) & np.isfinite(cost.ravel()[b])
    return csr_array((enter[finite], (a[finite], b[finite])), shape=(size * size, size * size))


def _neighbours(cell: Cell) -> Iterator[Cell]:
    row, column = cell
    yield from ((row - 1, column), (row, column - 1), (row + 1, column), (row, column + 1))


if __name__ == "__main__":
    main()
