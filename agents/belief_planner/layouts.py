"""True layouts to learn from: parts of a task's mazes, and layouts of our own that vary much more than any kind does.

The learned belief is to serve buildings of kinds that nobody trained on. So half of the layouts, or as many as the
config says, are random mixtures of what walls can look like: rock, walls with gaps, open areas, tunnels and pillars.
`N` is the number of cells on a side.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from mazebench.maps.drawn import Mazes

_CHANGED = 0.2  # share of the layouts from the task's mazes in which something is built or torn down, too
_MOST_CHANGES = 15  # of a layout of our own
_LEAST_FREE = 0.2  # share of inner cells; with fewer, there is hardly a way to choose
_MAX_DRAWS = 100


def draw_layout(mazes: Mazes, task_share: float, size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns `[N, N]` bool: walls of a maze of `size` N cells a side, which is at most the size of `mazes`.

    It is a part of one of `mazes` with probability `task_share`, else of our own.
    """
    for _ in range(_MAX_DRAWS):
        if rng.random() < task_share:
            walls = _part(mazes[int(rng.integers(len(mazes)))].walls, size, rng)
            num_changes = rng.integers(1, 4) if rng.random() < _CHANGED else 0
        else:
            walls = _ground(size, rng)
            num_changes = rng.integers(1, _MOST_CHANGES + 1)
        for _ in range(num_changes):
            change(walls, rng)
        walls = legal(walls)
        if (~walls).sum() >= max(2, _LEAST_FREE * (size - 2) ** 2):
            return walls
    raise RuntimeError(f"found no layout of {size} cells a side in {_MAX_DRAWS} draws")


def legal(walls: np.ndarray) -> np.ndarray:
    """Returns `[N, N]` bool: walls with a border, within which the largest connected area is free."""
    free = ~walls
    free[[0, -1]] = free[:, [0, -1]] = False
    areas, _ = ndimage.label(free)
    counts = np.bincount(areas.ravel())
    counts[0] = 0
    return areas != counts.argmax() if counts.any() else np.ones_like(walls)


def change(walls: np.ndarray, rng: np.random.Generator) -> None:
    """Builds something in `walls` `[N, N]` bool, or tears it down, in place."""
    _CHANGES[rng.choice(len(_CHANGES), p=_ODDS)](walls, rng)


def _part(walls: np.ndarray, size: int, rng: np.random.Generator) -> np.ndarray:
    top, left = rng.integers(len(walls) - size + 1, size=2)
    return walls[top : top + size, left : left + size].copy()


def _ground(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns `[N, N]` bool: an open field, solid rock or blobs of rock, with which a layout begins."""
    kind = rng.integers(3)
    return _rock(size, rng) if kind == 2 else np.full((size, size), kind == 1)


def _rock(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns `[N, N]` bool: smoothed noise above a threshold, of any scale, direction and density."""
    noise = ndimage.gaussian_filter(rng.standard_normal((size, size)), rng.uniform(0.3, 3.0, size=2), mode="wrap")
    return noise > np.quantile(noise, rng.uniform(0.3, 0.9))


def _area(size: int, rng: np.random.Generator) -> tuple[slice, slice]:
    """Returns a random rectangle, most often a small one."""
    height, width = (2 + (size - 2) * rng.random(2) ** 2).astype(int)
    top, left = rng.integers(0, size - height + 1), rng.integers(0, size - width + 1)
    return slice(top, top + height), slice(left, left + width)


def _fill_area(walls: np.ndarray, rng: np.random.Generator) -> None:
    walls[_area(len(walls), rng)] = rng.random() < 0.4


def _fill_rock(walls: np.ndarray, rng: np.random.Generator) -> None:
    area = _area(len(walls), rng)
    walls[area] = _rock(len(walls), rng)[area]


def _build_room(walls: np.ndarray, rng: np.random.Generator) -> None:
    """Builds walls around an area that is free or stays as it is, with one to four gaps."""
    area = _area(len(walls), rng)
    room = walls[area]
    if rng.random() < 0.7:
        room[...] = False
    outline = np.zeros(room.shape, dtype=bool)
    outline[[0, -1]] = outline[:, [0, -1]] = True
    room |= outline
    cells = np.argwhere(outline)
    room[tuple(cells[rng.integers(len(cells), size=rng.integers(1, 5))].T)] = False


def _build_wall(walls: np.ndarray, rng: np.random.Generator) -> None:
    """Builds a wall across all or a part of the layout, of one to three cells, with gaps of one to three cells."""
    size = len(walls)
    walls = walls.T if rng.random() < 0.5 else walls
    row, thickness = rng.integers(1, size - 1), rng.choice([1, 1, 1, 2, 3])
    left, right = (0, size) if rng.random() < 0.5 else np.sort(rng.integers(0, size, size=2))
    across = np.ones(right - left, dtype=bool)
    for _ in range(rng.integers(0, 4)):
        gap = rng.integers(0, size)
        across[gap : gap + rng.choice([1, 1, 2, 3])] = False
    walls[row : row + thickness, left:right] = across


def _build_walls(walls: np.ndarray, rng: np.random.Generator) -> None:
    """Builds several walls, so that rooms are between them."""
    for _ in range(rng.integers(2, 8)):
        _build_wall(walls, rng)


def _dig_tunnels(walls: np.ndarray, rng: np.random.Generator) -> None:
    """Frees straight tunnels of one to three cells, each of which begins where the one before has ended."""
    size, width = len(walls), rng.choice([1, 1, 2, 3])
    row, column = rng.integers(1, size - 1, size=2)
    for _ in range(rng.integers(1, 25)):
        to = rng.integers(1, size - 1)
        if rng.random() < 0.5:
            walls[min(row, to) : max(row, to) + width, column : column + width] = False
            row = to
        else:
            walls[row : row + width, min(column, to) : max(column, to) + width] = False
            column = to


def _set_pillars(walls: np.ndarray, rng: np.random.Generator) -> None:
    area = _area(len(walls), rng)
    walls[area] |= rng.random(walls[area].shape) < rng.uniform(0, 0.4)


def _tear_holes(walls: np.ndarray, rng: np.random.Generator) -> None:
    area = _area(len(walls), rng)
    walls[area] &= rng.random(walls[area].shape) > rng.uniform(0, 0.3)


_CHANGES = (_fill_area, _fill_rock, _build_room, _build_wall, _build_walls, _dig_tunnels, _set_pillars, _tear_holes)
_ODDS = np.array([2, 1, 4, 3, 3, 3, 1, 1]) / 18
