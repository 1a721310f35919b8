"""Ceilings of the tracks: robots that know part of the truth, whose tables are in docs/tracks.md.

    python -m benchmarks.ceilings play FOLDER [SPLIT]   evaluates the navigator told the truth, or goes on with that
    python -m benchmarks.ceilings ideal [SPLIT]         drives an ideal agent over the grid of `rebuilt`

SPLIT is dev or eval, dev by default.
"""

from __future__ import annotations

import itertools
import math
import pathlib
import sys

import numpy as np
from mazebench_agents.navigator.navigator import Navigator
from mazebench_agents.robot.cells import marked_cell
from mazebench_agents.robot.occupancy import SURE
from mazebench_agents.robot.planning import cheapest_ways, plan
from mazebench_agents.robot.senses import Memory

from benchmarks.results.kept import TOLD, ceilings
from benchmarks.results.results_tables import format_interval, format_table
from mazebench.agent import Inputs
from mazebench.constants import ON_TIME
from mazebench.evaluation.evaluate import evaluate
from mazebench.kernels import compiled
from mazebench.maps.doors import door_slots
from mazebench.maps.maze import Cell, Maze
from mazebench.results.intervals import mean_interval
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START
from mazebench.tasks.perturbations.moved_doors import MovedDoors
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.task import Task
from mazebench.tasks.tracks import LEVELS, TRACKS
from mazebench.tasks.trials import Trial, select_trials

_HIDDEN_POSE = [name for name, track in TRACKS.items() if track.hides_pose]
# The ideal agent on the grid.
_EVERY = 4  # of the frozen episodes is driven
_SIGHT = 3.5  # cells
_PRICES = tuple(itertools.product((0.0, 3.0), (2.0, 6.0, 15.0, 1e6)))  # of unseen doors: open, closed on the map
_SAMPLES = 10  # buildings that agree with all that was seen, in which prices are tried
_MOVES = 8  # cells from one choice of prices to the next
_MOST = 10**6  # cells of way
_WALL = 1e6  # the cost of a cell that is known to be a wall


class ToldNavigator(Navigator):
    """Follows the map until a wall is seen on the path that it planned at the start; then it knows all walls.

    It is for maps that lie as the maze does, with an exact pose.
    """

    needs_truth = True

    def estimate(self, memory: Memory, inputs: Inputs, slot: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns the shown walls, or from that moment on the true ones, and the goal."""
        context = inputs.observation["context"][slot].astype(float)
        walls, goal = context[GLOBAL_MAP], context[GOAL]
        path = plan(walls, goal, marked_cell(context[START]), self._cell_size)
        if (memory.evidence[tuple(np.transpose(path))] >= SURE).any():
            walls = inputs.truth.walls[slot].astype(float)
        return walls, goal


def play(folder: pathlib.Path, split: str = "dev") -> None:
    """Evaluates the robots, and prints their on-time rates by track and level; FOLDER/ceilings is to be kept."""
    rates = {}
    for name, agent, tracks in (
        ("navigator", "navigator", TRACKS),
        ("navigator-true-pose", "navigator", _HIDDEN_POSE),
        ("ceilings", TOLD, ["rebuilt"]),
    ):
        for track, level in itertools.product(tracks, LEVELS):
            summary = evaluate(
                agent,
                track,
                folder / name / f"{track}-{level}",
                level=level,
                split=split,
                exact_pose=tracks is _HIDDEN_POSE,
                resume=True,
            )
            rates[summary.row, f"{track}-{level}"] = summary.overall.on_time["1.25"]
    settings = {(track, level): ceilings(track, level) for track, level in itertools.product(TRACKS, LEVELS)}
    rows = [
        [f"`{track}` {level}", *(f"{rates[played]:.2f}" for played in told.values())]
        for (track, level), told in settings.items()
    ]
    print(format_table(["setting", *ceilings("building", 1)], rows))


def ideal(split: str = "dev") -> None:
    """Prints the on-time rates of an agent on the grid of `rebuilt`.

    It moves from cell to cell, knows its cell, which cells may be doors, and how many have moved, and sees the cells
    within 3.5 cells. It goes the cheapest way, where an unseen door costs more. Every 8 moves it chooses the prices by
    which it would be on time most often in sampled buildings that agree with all that it saw. On time is a way of at
    most 1.25 times the cells of the shortest one.
    """
    for level in LEVELS:
        task = Task.of("rebuilt", level=level, split=split)
        trials, rng = select_trials(task)[::_EVERY], np.random.default_rng(0)
        [moved] = TRACKS["rebuilt"].levels[level - 1].perturbations
        on_time = np.array([float(_is_on_time(task, trial, moved, rng)) for trial in trials])
        mean = mean_interval(on_time, np.array([trial.episode.maze for trial in trials]))
        print(f"rebuilt {level}: {format_interval(mean)}, {len(trials)} episodes", flush=True)


def _is_on_time(task: Task, trial: Trial, moved: MovedDoors, rng: np.random.Generator) -> bool:
    """Drives through the episode of a trial; returns whether that is on time."""
    episode = trial.episode
    walls, shown = task.mazes[episode.maze].walls, show_map(task, episode).walls.astype(bool)
    maze = Maze(shown, "shown", kind=task.mazes[episode.maze].kind)
    num_moved, known = moved.num_swaps(maze), shown.astype(np.int8)  # 1 a wall, 0 free, -1 not seen
    known[tuple(door_slots(maze).T)] = -1
    known[episode.start] = known[episode.goal] = 0
    cell, driven, budget = episode.start, 0.0, ON_TIME[0] * trial.distance
    while cell != episode.goal and driven <= budget:
        # The prices that are on time most often in sampled buildings; of equals, those with the shortest ways.
        scores = np.zeros(len(_PRICES))
        for _ in range(_SAMPLES):
            building = _sample(known, shown, num_moved, rng)
            shortest = _drive(building, building.astype(np.int8), shown, 0.0, 0.0, episode.start, episode.goal, _MOST)[
                0
            ]
            if math.isinf(shortest):
                continue  # the sampled doors cut the goal off
            for index, prices in enumerate(_PRICES):
                left, _ = _drive(building, known.copy(), shown, *prices, cell, episode.goal, _MOST)
                scores[index] += (driven + left <= ON_TIME[0] * shortest) - 1e-3 * left
        length, cell = _drive(walls, known, shown, *_PRICES[scores.argmax()], cell, episode.goal, _MOVES)
        driven += length
    return driven <= budget


def _sample(known: np.ndarray, shown: np.ndarray, num_moved: int, rng: np.random.Generator) -> np.ndarray:
    """Returns walls `[N, N]` bool that agree with what is known and with the number of doors that have moved."""
    building = np.where(known < 0, shown, known > 0)
    for was_wall in (False, True):
        seen = int(((known >= 0) & (shown == was_wall) & (building != was_wall)).sum())
        doors = np.argwhere((known < 0) & (shown == was_wall))
        moved = rng.permutation(doors)[: max(num_moved - seen, 0)]
        building[tuple(moved.T)] = not was_wall
    return building


@compiled
def _drive(
    walls: np.ndarray, known: np.ndarray, shown: np.ndarray, opened: float, closed: float, cell: Cell, goal: Cell,
    most: int,
) -> tuple[float, Cell]:  # fmt: skip
    """Goes the cheapest way, planned anew when a door is not as assumed; returns the cells of way, and the last one.

    The way ends in the goal, or after `most` cells; it is infinite if none is left. `known` is updated in place.
    """
    size, length = len(walls), 0
    end = np.full(walls.shape, np.inf)
    end[goal] = 0.0
    entering = np.where(known > 0, _WALL, 1.0)
    for row in range(size):
        for column in range(size):
            if known[row, column] < 0:
                entering[row, column] += closed if shown[row, column] else opened
    following = cheapest_ways(entering, end)
    while True:
        # What is seen from the cell: unknown cells to which the line is free.
        is_other = False
        for row in range(max(cell[0] - 3, 0), min(cell[0] + 4, size)):
            for column in range(max(cell[1] - 3, 0), min(cell[1] + 4, size)):
                down, right = row - cell[0], column - cell[1]
                if known[row, column] < 0 and down**2 + right**2 <= _SIGHT**2:
                    is_seen, steps = True, 4 * max(abs(down), abs(right))
                    for step in range(1, steps):
                        r = math.floor(cell[0] + 0.5 + down * step / steps)
                        c = math.floor(cell[1] + 0.5 + right * step / steps)
                        if walls[r, c] and (r != row or c != column):
                            is_seen = False
                            break
                    if is_seen:
                        known[row, column] = walls[row, column]
                        price = _WALL if walls[row, column] else 1.0
                        is_other |= price != entering[row, column]
                        entering[row, column] = price
        if cell == goal or length == most:
            return float(length), cell

        # The next cell of the cheapest way.
        if is_other:
            following = cheapest_ways(entering, end)
        row, column = divmod(following[cell[0] * size + cell[1]], size)
        if known[row, column] > 0:
            return np.inf, cell
        cell, length = (row, column), length + 1


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["play", folder, *split]:
            play(pathlib.Path(folder), *split)
        case ["ideal", *split]:
            ideal(*split)
        case _:
            sys.exit(__doc__)
