"""An ideal agent that drives from cell to cell: what can be reached on the tracks of v3, with a map and without one.

It sees every cell within 3.5 m that no wall hides, and its odometry is exact. It knows the door slots, how many doors
have moved, and how the map is drawn: it reads the cells of the map. What it is not told on a track, it filters: how
the sheet lies, and where on it the start is. Given both, doors are independent of each other but for those that it has
seen, so that this filter of pose and doors is exact.

`N` is the number of cells on a side, `G` the number of ways in which the sheet may lie in the frame in which the agent
counts its cells.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from mazebench_agents.common.kernels import compiled
from mazebench_agents.robot.shortest_paths import cheapest_ways

from mazebench.maps.doors import door_slots
from mazebench.maps.maze import Cell, Maze, symmetries
from mazebench.tasks.context import START
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.spec import TaskSpec
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.tracks.building import TurnedSheet
from mazebench.tasks.tracks.rebuilt import MovedDoors, num_swaps
from mazebench.tasks.trials import Trial

SEEN_WITHIN = 3.5  # m, the reach of the lidar
UNSEEN, FREE, WALL = 0, 1, 2  # what the agent has seen of a cell
RISK = 6.0  # cells that a way may be longer whose probability of being open is e times as high
UNKNOWN = 0.1  # chance that an unseen cell is a wall, to an agent without a map, when it plans
SURE = 0.5  # probability of a pose from which on the agent drives by it
_ERROR = 1e-3  # probability that a cell that is no door is drawn wrong
_NEVER = -1e4  # log-likelihood of what cannot be
_RAYS, _STEP = 360, 0.05  # of sight, m


Cue = Callable[[Maze], np.ndarray]  # of a map: [N, N] float, how likely the door in each cell has moved


class Told(NamedTuple):
    """What the agent is told in an episode."""

    start: Cell  # in the agent's own frame
    wall: np.ndarray  # [G, N, N] float: probability of a wall in each cell of the sheet
    goals: np.ndarray | None  # [G, 2] int, on the sheet; None if the goal is hidden
    prior: np.ndarray  # [G, N, N] float: log-probability that the start is in a cell of the sheet


def tell(task: TaskSpec, trial: Trial, with_map: bool, cue: Cue | None = None) -> Told:
    """Returns what the agent is told in an episode of a track; with a cue, also how likely each door has moved.

    Without the map, it still knows start and goal; but on a track that hides the pose, nothing.
    """
    episode, track, level = trial.episode, TRACKS[task.track or ""], task.level[0]
    maze, shown = task.mazes[episode.maze], show_map(task, episode)
    parts = dict(track.parts(level))
    lost = track.hides_pose

    # The sheet in all the ways in which it may lie, as indices of cells.
    sheet = next((part for part in parts if isinstance(part, TurnedSheet)), TurnedSheet(turns=False, mirrors=False))
    num_ways = 8 if sheet.mirrors and not lost else 4 if sheet.turns or lost else 1
    ways = np.array(symmetries(np.arange(maze.size**2).reshape(maze.walls.shape))[:num_ways])
    if not with_map:
        wall = np.pad(np.full([maze.size - 2] * 2, UNKNOWN), 1, constant_values=1.0)
        prior = np.where(ways[:1] == _index(maze, episode.start), 0.0, _NEVER)
        return Told(episode.start, wall[None], None if lost else np.array([episode.goal]), prior)

    num_moved = sum(num_swaps(maze, share) for part, share in parts.items() if isinstance(part, MovedDoors))
    wall = _wall_probability(Maze(shown.walls, kind=maze.kind), num_moved, cue)
    is_start = ~shown.walls.ravel()[ways] if lost and START in shown.hidden else ways == _index(maze, episode.start)
    goals = np.argwhere(ways == _index(maze, episode.goal))[:, 1:]
    return Told(episode.start, wall.ravel()[ways], goals, np.where(is_start, 0.0, _NEVER))


def _index(maze: Maze, cell: Cell) -> int:
    return cell[0] * maze.size + cell[1]


def _wall_probability(shown: Maze, num_moved: int, cue: Cue | None) -> np.ndarray:
    """Returns `[N, N]` float: how likely each cell is a wall, given that so many doors of the map have moved."""
    slots = door_slots(shown)
    is_closed = shown.walls[tuple(slots.T)]
    moved = num_moved / np.maximum(1, np.where(is_closed, is_closed.sum(), (~is_closed).sum()))
    if cue is not None:
        moved = cue(shown)[tuple(slots.T)]
    wall = np.where(shown.walls, 1 - _ERROR, _ERROR)
    wall[tuple(slots.T)] = np.clip(np.where(is_closed, 1 - moved, moved), _ERROR, 1 - _ERROR)
    wall[[0, -1]] = wall[:, [0, -1]] = 1.0
    return wall


def cells_entered(walls: np.ndarray, goal: Cell, told: Told, most: int) -> int | None:
    """Returns how many cells the agent enters until it is at the goal; None if it is not there after `most`."""
    size = len(walls)
    log_wall, log_free = (np.log(np.maximum(share, math.exp(_NEVER / 1e3))) for share in (told.wall, 1 - told.wall))
    belief = told.prior.copy()
    seen = np.zeros((3 * size, 3 * size), dtype=np.int8)  # with room for all shifts of the sheet
    seen_here = seen[size : 2 * size, size : 2 * size]
    visited = np.zeros(walls.shape, dtype=bool)
    cell = told.start
    for entered in range(most + 1):
        if cell == goal:
            return entered

        # What it sees, and that the goal is not here.
        visited[cell] = True
        visible = _visible(walls, *cell)
        new = np.argwhere((visible != UNSEEN) & (seen_here == UNSEEN))
        seen_here[tuple(new.T)] = visible[tuple(new.T)]
        _update(belief, log_wall, log_free, new - told.start, visible[tuple(new.T)])
        for way, (row, column) in enumerate(told.goals if told.goals is not None else ()):
            start = row - cell[0] + told.start[0], column - cell[1] + told.start[1]
            if 0 <= start[0] < size and 0 <= start[1] < size:
                belief[way, *start] = _NEVER

        # Where it goes: to the goal by the likeliest pose, or to see more.
        following = None
        if told.goals is not None:
            way, *start = np.unravel_index(np.argmax(belief), belief.shape)
            if 1 / np.sum(np.exp(belief - belief[way, *start])) >= SURE:
                shift = start[0] - told.start[0], start[1] - told.start[1]
                window = seen[size - shift[0] : 2 * size - shift[0], size - shift[1] : 2 * size - shift[1]]
                ends = np.zeros_like(walls)
                ends[tuple(told.goals[way])] = True
                following = _next_cell(_cost(window, told.wall[way]), ends, (cell[0] + shift[0], cell[1] + shift[1]))
                following = following[0] - shift[0], following[1] - shift[1]
        if following is None or walls[following]:
            unseen = visited if told.goals is None else seen_here != UNSEEN
            following = _next_cell(np.where(seen_here == WALL, np.inf, 1.0), ~unseen, cell)
        cell = following
    return None


def _cost(seen: np.ndarray, wall: np.ndarray) -> np.ndarray:
    """Returns `[N, N]` float: the costs of entering cells with which a short way that is likely open is cheapest."""
    unseen = 1 - RISK * np.log1p(-np.minimum(wall, 1 - 1e-9))
    return np.where(seen == FREE, 1.0, np.where(seen == WALL, 1e6, unseen))


def _next_cell(cost: np.ndarray, ends: np.ndarray, cell: Cell) -> Cell:
    """Returns the next cell on a cheapest way from `cell` to one of `ends` (`[N, N]` bool)."""
    ways = cheapest_ways(cost, np.where(ends, 0.0, np.inf))
    row, column = divmod(int(ways.following[cell[0] * len(cost) + cell[1]]), len(cost))
    return row, column


@compiled
def _visible(walls: np.ndarray, row: int, column: int) -> np.ndarray:
    """Returns `[N, N]` int8: what can be seen from the centre of a cell."""
    visible = np.zeros(walls.shape, np.int8)
    for ray in range(_RAYS):
        angle = 2 * math.pi * (ray + 0.5) / _RAYS
        for step in range(int(SEEN_WITHIN / _STEP) + 1):
            r = math.floor(row + 0.5 - math.sin(angle) * step * _STEP)
            c = math.floor(column + 0.5 + math.cos(angle) * step * _STEP)
            if walls[r, c]:
                visible[r, c] = WALL
                break
            visible[r, c] = FREE
    return visible


@compiled
def _update(
    belief: np.ndarray, log_wall: np.ndarray, log_free: np.ndarray, cells: np.ndarray, kinds: np.ndarray
) -> None:
    """Multiplies the belief `[G, N, N]`, in place, by the likelihood of `cells` (`[K, 2]` int, from the start)."""
    ways, size, _ = belief.shape
    for way in range(ways):
        for row in range(size):
            for column in range(size):
                if belief[way, row, column] <= _NEVER:
                    continue
                for k in range(len(cells)):
                    r, c = row + cells[k, 0], column + cells[k, 1]
                    if not (0 <= r < size and 0 <= c < size):
                        belief[way, row, column] = _NEVER
                        break
                    likelihood = log_wall if kinds[k] == WALL else log_free
                    belief[way, row, column] += likelihood[way, r, c]
