"""What is played: the mazes, how start and goal are drawn, what the agent is shown, and when it ends.

A `TaskSpec` holds no simulation. The dm_env, Gymnasium and vector environments all play by the one they are given.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.maps import perturb
from mazebench.maps.generators import corner_cells
from mazebench.maps.maze import MAX_SIZE, Cell, Maze, path_through_walls
from mazebench.tasks import TASK_VERSION
from mazebench.tasks.context import build_context, default_context_size
from mazebench.tasks.episode import Episode, Route, ShownMap
from mazebench.world.models import MazeModels
from mazebench.world.rendering import CAMERAS, MAX_PIXELS, Cameras

TIME_LIMIT = 100  # agent steps a leg
TRAIN_DISTANCES = tuple(range(1, 6))
EVAL_DISTANCES = tuple(range(1, 16))
PAIRS = ("random", "fixed")

_MAX_POSITION_NOISE = 1000.0  # m; more would be a mistake
_SEEDS = 2**31
_MAX_TRIES = 1000
_FIXED_PAIR_SEED = 20210  # of the pairs of the extremely-low-data regime; any number, once and for all


@dataclasses.dataclass(frozen=True)
class Perturbation:
    """What is wrong with what the agent is shown; the world stays true."""

    map_flip: float = 0.0  # probability of each inner cell but start and goal to be shown flipped
    map_warp: float = 0.0  # largest shift of a corner of the map, in shares of its side
    position_noise: float = 0.0  # m, standard deviation on x and y of each observation

    def __post_init__(self) -> None:
        for name, highest in (
            ("map_flip", 1.0),
            ("map_warp", perturb.MAX_WARP),
            ("position_noise", _MAX_POSITION_NOISE),
        ):
            value = getattr(self, name)
            if not 0 <= value <= highest:
                raise InputError(f"expected {name} from 0 to {highest}, found {value}")


@dataclasses.dataclass(frozen=True, eq=False)
class TaskSpec:
    """A navigation task on a set of mazes of one size.

    Raises:
      InputError: if an option is out of range, or no pair of cells of a maze is a wanted distance apart.
    """

    version: ClassVar[int] = TASK_VERSION  # of what an episode is, whichever environment plays it

    task: str  # a name in TASKS
    mazes: tuple[Maze, ...]
    distances: tuple[int, ...] = TRAIN_DISTANCES  # cells; of start and goal of a local episode
    pairs: str = "random"  # a new pair each episode, or "fixed": one a maze, the paper's extremely-low-data regime
    time_limit: int = TIME_LIMIT  # agent steps to the goal, or to each landmark
    landmark_distance: int = 5  # cells between the landmarks of a hierarchical episode
    context_size: int = 0  # M; 0 for min(N, 21)
    num_goals: int = 1  # of a local episode, one after the other without a reset: long trajectories to learn from
    perturbation: Perturbation = Perturbation()
    continuous: bool = False  # actions are velocities (forward, left, turn) instead of one of six
    cameras: tuple[str, ...] = ()  # whose pictures are observed too
    camera_size: int = 64  # pixels a side of these pictures

    def __post_init__(self) -> None:
        if self.task not in TASKS:
            raise unknown("task", self.task, TASKS)
        for camera in self.cameras:
            if camera not in CAMERAS:
                raise unknown("camera", camera, CAMERAS)
        if len(set(self.cameras)) < len(self.cameras):
            raise InputError(f"expected each camera once, found {', '.join(self.cameras)}")
        if self.pairs not in PAIRS:
            raise unknown("pairs", self.pairs, PAIRS)
        if not self.mazes:
            raise InputError("expected at least one maze, found none")
        if self.context_size == 0:
            object.__setattr__(self, "context_size", default_context_size(self.size))
        self._require("time_limit", 1, np.inf)
        self._require("landmark_distance", 1, np.inf)
        self._require("context_size", 3, MAX_SIZE)
        self._require("camera_size", 1, MAX_PIXELS)
        self._require("num_goals", 1, np.inf if self.task == "local" and self.pairs == "random" else 1)
        if self.task == "local":
            self._check_distances()
        for maze in self.mazes:
            if len(maze.free_cells) < 2:
                raise InputError(f"{maze.name}: expected two free cells for a start and a goal, found one")

    def _require(self, name: str, lowest: float, highest: float) -> None:
        value = getattr(self, name)
        if not lowest <= value <= highest:
            raise InputError(f"expected {name} from {lowest} to {highest}, found {value}")

    def _check_distances(self) -> None:
        if not self.distances or min(self.distances) < 1:
            raise InputError(f"expected distances of at least 1 cell, found {list(self.distances)}")
        for maze in self.mazes:
            if max(self.distances) > maze.diameter:
                raise InputError(
                    f"{maze.name}: no two cells are {max(self.distances)} cells apart; the farthest are {maze.diameter}"
                )

    @functools.cached_property
    def size(self) -> int:
        """N, the cells a side of every maze.

        Raises:
          InputError: if the mazes differ in size.
        """
        sizes = sorted({maze.size for maze in self.mazes})
        if len(sizes) != 1:
            raise InputError(f"expected mazes of one size, found sizes {sizes}")
        return sizes[0]

    @property
    def has_legs(self) -> bool:
        """Whether the context may change within an episode: at landmarks, or where a goal follows another."""
        return self.task == "hierarchical" or self.num_goals > 1

    @functools.cached_property
    def models(self) -> MazeModels:
        """The MuJoCo models of `mazes`, shared by all environments that play this task."""
        return MazeModels(self.mazes)

    def open_cameras(self) -> Cameras | None:
        """What takes the pictures that are observed; None if none are."""
        return Cameras(self.models[0], self.cameras, self.camera_size) if self.cameras else None

    def sample_episode(self, rng: np.random.Generator) -> Episode:
        """Draws an episode as the task has it."""
        maze = int(rng.integers(len(self.mazes)))
        start, goal = TASKS[self.task](self, maze, rng)
        return Episode(maze, start, goal, float(rng.uniform(-np.pi, np.pi)), int(rng.integers(_SEEDS)))

    def check_episode(self, episode: Episode) -> Episode:
        """`episode` itself if it can be played here.

        Raises:
          InputError: if there is no such maze, or start or goal is not free in it.
        """
        if not 0 <= episode.maze < len(self.mazes):
            raise InputError(f"expected a maze from 0 to {len(self.mazes) - 1}, found {episode.maze}")
        for cell in (episode.start, episode.goal):
            self.mazes[episode.maze].require_free(cell)
        return episode

    def show(self, episode: Episode) -> ShownMap:
        """The map that the agent is shown in `episode`."""
        walls = self.mazes[episode.maze].walls
        perturbation = self.perturbation
        if not perturbation.map_flip and not perturbation.map_warp:
            return ShownMap(walls)
        flips, warps, *_ = episode.streams()
        if perturbation.map_flip:
            walls = perturb.flip(walls, perturbation.map_flip, [episode.start, episode.goal], flips)
        if perturbation.map_warp:
            return ShownMap(walls, perturb.random_homography(self.size, perturbation.map_warp, warps))
        return ShownMap(walls)

    def route(self, episode: Episode, shown: ShownMap) -> Route:
        """The cells the agent is sent to: the goal, in the hierarchical task after landmarks planned on the shown map.

        Landmarks are cells of the world, so they are planned before a warp moves the planes.
        """
        if self.task == "local":
            return Route([episode.start, episode.goal], self.time_limit, self.num_goals, self._next_goal(episode))
        path = path_through_walls(shown.walls, episode.start, episode.goal)
        return Route([*path[: -1 : self.landmark_distance], path[-1]], self.time_limit)

    def _next_goal(self, episode: Episode) -> Callable[[Cell], Cell] | None:
        """Draws a goal at a wanted distance from a cell, as near to it as the maze has one."""
        if self.num_goals == 1:
            return None
        maze, rng = self.mazes[episode.maze], episode.streams()[3]

        def draw(start: Cell) -> Cell:
            farthest = int(maze.distances(start).max())
            distance = min(self.distances[rng.integers(len(self.distances))], farthest)
            goals = maze.cells_at(start, distance)
            row, column = goals[rng.integers(len(goals))]
            return int(row), int(column)

        return draw

    def context(self, shown: ShownMap, start: Cell, goal: Cell) -> np.ndarray:
        """`[4, M, M]` float32: the context of a leg (see `build_context`)."""
        if shown.homography is not None:
            start, goal = (perturb.warp_cell(cell, shown.homography, self.size) for cell in (start, goal))
        return build_context(shown.seen_walls(), start, goal, self.context_size)


def sample_pair(maze: Maze, distance: int, rng: np.random.Generator) -> tuple[Cell, Cell]:
    """A start and a goal `distance` cells apart: a start uniform among those that have such a goal, then one of these.

    Raises:
      InputError: if no two cells of the maze are that far apart.
    """
    for _ in range(_MAX_TRIES):
        start = maze.free_cells[rng.integers(len(maze.free_cells))]
        goals = maze.cells_at((int(start[0]), int(start[1])), distance)
        if len(goals):
            goal = goals[rng.integers(len(goals))]
            return (int(start[0]), int(start[1])), (int(goal[0]), int(goal[1]))
    raise InputError(f"{maze.name}: found no two cells {distance} cells apart; the farthest are {maze.diameter}")


def _local_pair(spec: TaskSpec, maze: int, rng: np.random.Generator) -> tuple[Cell, Cell]:
    if spec.pairs == "fixed":
        rng = np.random.default_rng([_FIXED_PAIR_SEED, maze])
    return sample_pair(spec.mazes[maze], spec.distances[rng.integers(len(spec.distances))], rng)


def _corner_pair(spec: TaskSpec, maze: int, rng: np.random.Generator) -> tuple[Cell, Cell]:
    return corner_cells(spec.mazes[maze])


TASKS: dict[str, Callable[[TaskSpec, int, np.random.Generator], tuple[Cell, Cell]]] = {
    "local": _local_pair,
    "hierarchical": _corner_pair,
}
