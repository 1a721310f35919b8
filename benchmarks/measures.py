"""Measures numbers of the docs that are of no agent's episodes: `python -m benchmarks.measures WHAT`.

  layouts   of 100 mazes of each kind: the longest of the shortest paths, and doors (docs/layouts.md)
  doors     how often moved doors block the shortest path on the map, and make a robot late (docs/tracks.md)
  ranges    the errors of ranges that are read from pictures of the camera of 75 degrees (docs/sensors.md)
  bends     cells of drawn maps that are misread, with and without the network that reads bends (docs/baselines.md)

Mazes of `layouts`, `doors` and `bends` are drawn from a seed of this script: none is a maze of a split.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator

import numpy as np
from mazebench_agents.robot.bend_network import load
from mazebench_agents.robot.bend_training import Drawings, true_bends
from mazebench_agents.robot.camera_ranges import CameraRanges
from mazebench_agents.robot.drawn_map import register
from mazebench_agents.robot.map_reading import BENDS
from mazebench_agents.robot.range_training import errors

from benchmarks.results.results_tables import format_table
from mazebench.constants import ON_TIME
from mazebench.maps.benchmark import KINDS_SIZE
from mazebench.maps.changes import SIGHT
from mazebench.maps.doors import door_slots, swap_doors
from mazebench.maps.follower import follow
from mazebench.maps.kinds import KNOWN, NOVEL, generate
from mazebench.maps.maze import Maze
from mazebench.tasks.episode import sample_pair
from mazebench.tasks.perturbations.moved_doors import SWAPS_BY_PERCENT
from mazebench.tasks.shown_map import is_blocked
from mazebench.tasks.tracks import DISTANCES
from mazebench.world.looks import VARIED, Camera

_SEED = 7_900
_KINDS = (*KNOWN, *NOVEL)


def mazes_of(kind: str, count: int) -> Iterator[Maze]:
    """Yields mazes of a kind that have goals at all distances of the tracks."""
    rng = np.random.default_rng([_SEED, *kind.encode()])
    while count:
        maze = generate(kind, KINDS_SIZE, rng)
        if maze.diameter >= max(DISTANCES):
            count -= 1
            yield maze


def layouts() -> str:
    """Returns the table of docs/layouts.md, a column for each kind."""
    columns = []
    for kind in _KINDS:
        mazes = list(mazes_of(kind, 100))
        longest = [maze.diameter for maze in mazes]
        is_open = [~maze.walls[tuple(door_slots(maze).T)] for maze in mazes]
        columns.append([np.median(longest), min(longest), np.mean([*map(len, is_open)]), np.mean([*map(sum, is_open)])])
    names = (
        "longest shortest path, cells: median", "the same, the smallest of all mazes", "door slots, mean",
        "of these open, mean",
    )  # fmt: skip
    return format_table(
        ["", *_KINDS], ([name, *(f"{each:.0f}" for each in row)] for name, *row in zip(names, *columns, strict=True))
    )


def doors(count: int = 100) -> str:
    """Returns shares of blocked and late episodes in `count` mazes of each kind, by the share that is aimed at.

    The robot follows a shortest path on the grid, sees 3.5 m and plans again. It is late beyond 1.25 shortest paths.
    """
    percents = list(SWAPS_BY_PERCENT[_KINDS[0]])
    found = np.zeros((len(_KINDS), len(percents), 2))
    for row, kind in enumerate(_KINDS):
        for number, maze in enumerate(mazes_of(kind, count)):
            ends = sample_pair(maze, DISTANCES[number % len(DISTANCES)], np.random.default_rng([_SEED, number]))
            pair = np.array([[at_row * len(maze.walls) + at_column for at_row, at_column in ends]])
            for column, percent in enumerate(percents):
                rng = np.random.default_rng([_SEED, number, 1])
                shown = swap_doors(maze.walls, kind, SWAPS_BY_PERCENT[kind][percent], ends, rng)
                _, [driven], [shortest], _ = follow(maze.walls, shown, pair, SIGHT, ON_TIME[0])
                found[row, column] += is_blocked(maze.walls, shown, ends), driven > ON_TIME[0] * shortest
    shares = np.concatenate([found, found.mean(axis=0, keepdims=True)]) / count
    rows = [
        [name, *(f"{value:.2f}" for part in of_kind.T for value in part)]
        for name, of_kind in zip((*_KINDS, "all"), shares, strict=True)
    ]
    return format_table(["kind", *(f"{name}, {each} %" for name in ("blocked", "late") for each in percents)], rows)


def ranges() -> str:
    """Returns rows of errors in pictures with patterns that were not trained on."""
    network = CameraRanges(Camera(fov=75), "measures").network
    return "".join(f"{row}\n" for row in errors(network, 75, VARIED))


def bends(count: int = 60) -> str:
    """Returns errors in `count` drawings of known and of held-out layouts at each bend."""
    network, rows = load(BENDS), []
    for (text, kinds), bend in itertools.product({"known": KNOWN, "held-out": NOVEL}.items(), (0.5, 1.0, 1.5)):
        drawings, found = Drawings(_SEED, kinds=kinds), []
        for drawn in (drawings.draw(bend) for _ in range(count)):
            true, guess = true_bends(drawn), network.read(drawn.picture)
            registered = [register(drawn.picture, KINDS_SIZE, given) for given in (None, guess)]
            misread = [((each.walls > 0.5) != drawn.walls)[1:-1, 1:-1].mean() for each in registered]
            found.append([np.abs(true).mean(), np.abs(guess.bends - true).mean(), *misread])
        off, left, before, now = np.mean(found, axis=0)
        rows.append([text, f"{bend:g} m", f"{off:.2f}", f"{left:.2f}", f"{before:.1%}", f"{now:.1%}"])
    header = ["layouts", "bend", "mean displacement, cells", "error of the network", "misread without it", "with it"]
    return format_table(header, rows)


if __name__ == "__main__":
    measures = {make.__name__: make for make in (layouts, doors, ranges, bends)}
    if len(sys.argv) != 2 or sys.argv[1] not in measures:
        sys.exit(__doc__)
    print(measures[sys.argv[1]](), end="")
