"""A navigation task: what is played and in which mazes."""

from __future__ import annotations

from pydantic import InstanceOf

from mazebench.errors import InputError
from mazebench.maps.drawn import FreshMazes, Mazes
from mazebench.maps.maze import MAX_SIZE, MIN_CELL_SIZE, Maze, require_one_size
from mazebench.maps.maze_options import THIN_WALLS
from mazebench.options import options
from mazebench.tasks.task_options import ENDS, TaskOptions, Variants
from mazebench.tasks.time_limit import track_time_limit
from mazebench.tasks.tracks import TRACKS

MIN_CONTEXT_SIZE = 3
_NUM_CHECKED = 10  # of fresh mazes, one of which must have the distances


@options
class TaskSpec(TaskOptions, Variants):
    """A navigation task on mazes of one size and scale, which the dm_env, Gymnasium and vector environments all play.

    `mazebench.tasks.build` computes it from options. It is complete: its distances, time limit, context size and
    sensors are those that are played. The time limit is 0 on a track, where it depends on the distance. A task holds
    plain values: no models, no simulation.

    Raises:
      InputError: if a value is not allowed, or no goal is as far away as wanted.
    """

    mazes: tuple[InstanceOf[Maze], ...] | InstanceOf[FreshMazes]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.num_goals > 1 and (self.task != "local" or self.pairs != "random"):
            raise InputError(
                f"expected num_goals 1 unless the task is local and pairs are random, found {self.num_goals}"
            )
        if self.ends_given and self.pairs == "fixed":
            raise InputError("expected pairs 'random' beside a start or a goal, found 'fixed', pairs of their own")
        if self.hide and self.num_goals > 1:
            raise InputError(f"hide {','.join(self.hide)}: expected num_goals 1, found {self.num_goals}")
        if self.lidar_noise is not None and "lidar" not in self.sensors:
            found = ", ".join(self.sensors) or "none"
            raise InputError(f"lidar_noise {self.lidar_noise}: expected the sensor lidar, found {found}")
        if self.goal is not None and self.num_goals > 1:
            raise InputError(f"expected num_goals 1 beside a goal, found {self.num_goals}")
        if not self.context_size >= MIN_CONTEXT_SIZE:
            raise InputError(f"expected context_size from {MIN_CONTEXT_SIZE} to {MAX_SIZE}, found {self.context_size}")
        if self.task == "local":
            self._check_distances()

    def _check_track(self, name: str) -> None:
        super()._check_track(name)
        for option_name, value in {"pairs": "random", "num_goals": 1}.items():
            found = getattr(self, option_name)
            if found != value:
                raise InputError(f"track {name!r}: expected {option_name} {value!r}, found {found!r}")
        context_size = TRACKS[name].pixels_per_cell * self.size
        if self.context_size != context_size:
            raise InputError(f"track {name!r}: expected context_size {context_size}, found {self.context_size}")

    def _check_distances(self) -> None:
        if not self.distances:
            raise InputError("expected at least one distance, found none")
        mazes = self.mazes
        if isinstance(mazes, FreshMazes):  # an episode whose maze is too small takes another one
            mazes = (max((mazes[number] for number in range(_NUM_CHECKED)), key=self.farthest),)
        for maze in mazes if self.ends_given < 2 else ():
            if max(self.distances) > (farthest := self.farthest(maze)):
                raise InputError(
                    f"{maze.name}: expected distances of at most {farthest} cells, as far as the maze reaches, "
                    f"found {max(self.distances)}; choose others (--distances)"
                )

    @property
    def fixed_mazes(self) -> tuple[Maze, ...]:
        """The mazes.

        Raises:
          InputError: if every episode has a new one.
        """
        if isinstance(self.mazes, FreshMazes):
            raise InputError("expected a task with a number of mazes, found fresh ones")
        return self.mazes

    @property
    def size(self) -> int:
        """N, the cells on a side of every maze."""
        return self.mazes[0].size

    @property
    def cell_size(self) -> float:
        """The side of every maze's cells, in metres."""
        return self.mazes[0].cell_size

    @property
    def longest_time_limit(self) -> int:
        """The agent steps that a leg may take; on a track, those to the farthest goals."""
        return self.time_limit if self.track is None else track_time_limit(self.track, max(self.distances))

    @property
    def has_legs(self) -> bool:
        """True if the context may change within an episode: at landmarks, or where one goal follows another."""
        return self.task == "hierarchical" or self.num_goals > 1


def check_mazes(task: TaskOptions, mazes: Mazes) -> None:
    """Checks that a task can be played in some mazes.

    Raises:
      InputError: if they are not of one size and scale, a cell is too narrow for the body, a maze has no two free cells
        for a start and a goal, or the task's track does not take them.
    """
    if isinstance(mazes, FreshMazes):
        _check_fresh(task, mazes)
        return
    require_one_size(mazes)
    name, cell_size = mazes[0].name, mazes[0].cell_size
    if cell_size < MIN_CELL_SIZE:
        raise InputError(
            f"{name}: expected cells of at least {MIN_CELL_SIZE} m, through which the body passes, "
            f"found {cell_size} m; {THIN_WALLS}"
        )
    if task.track is not None and cell_size != 1:
        raise InputError(f"track {task.track!r}: expected cells of 1 m, found {cell_size} m")
    for maze in mazes:
        if task.track is not None:
            TRACKS[task.track].require(maze, task.level)
        if len(maze.free_cells) < 2:
            raise InputError(f"{maze.name}: expected two free cells for a start and a goal, found one")
        start, goal = task.ends(maze)
        if start is not None and start == goal:
            raise InputError(f"{maze.name}: expected start and goal in different cells, found both in {start}")


def _check_fresh(task: TaskOptions, mazes: FreshMazes) -> None:
    if task.textures:
        raise InputError("fresh mazes: expected no textures, which take long to make, found textures")
    for name in ENDS:
        if (end := getattr(task, name)) is not None:
            raise InputError(f"fresh mazes: expected no {name}, which may be a wall in one of them, found {end!r}")
    mazes.max_boxes  # noqa: B018 - raises if a kind can't make mazes of this size
