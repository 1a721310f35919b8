"""A navigation task: its options and its mazes."""

from __future__ import annotations

import dataclasses

from mazebench.constants import TASK_VERSION, TRACKS_VERSION
from mazebench.errors import InputError
from mazebench.maps.maze import MAX_SIZE, MIN_CELL_SIZE, Cell, Maze, corner_cells, require_one_size
from mazebench.maps.options import THIN_WALLS
from mazebench.tasks.context import default_context_size
from mazebench.tasks.options import ENDS, TIME_LIMIT, TaskOptions
from mazebench.tasks.places import cell_of_place
from mazebench.tasks.tracks import TRACKS

MIN_CONTEXT_SIZE = 3
_LIDAR = "lidar"  # the sensor that every track offers


@dataclasses.dataclass(frozen=True, kw_only=True)
class TaskSpec(TaskOptions):
    """A navigation task on mazes of one size and scale, which the dm_env, Gymnasium and vector environments all play.

    It holds plain values: no models, no simulation.

    Raises:
      InputError: if an option is not allowed, or the mazes do not fit it.
    """

    mazes: tuple[Maze, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        require_one_size(self.mazes)
        if self.cell_size < MIN_CELL_SIZE:
            raise InputError(
                f"{self.mazes[0].name}: expected cells of at least {MIN_CELL_SIZE} m, through which the body passes, "
                f"found {self.cell_size} m; {THIN_WALLS}"
            )
        if self.time_limit == 0:
            object.__setattr__(self, "time_limit", TIME_LIMIT)
        if self.track is not None:
            self._apply_track(self.track)
        elif self.context_size == 0:
            object.__setattr__(self, "context_size", default_context_size(self.size))
        if self.context_size < MIN_CONTEXT_SIZE:
            raise InputError(f"expected context_size from {MIN_CONTEXT_SIZE} to {MAX_SIZE}, found {self.context_size}")
        for maze in self.mazes:
            if len(maze.free_cells) < 2:
                raise InputError(f"{maze.name}: expected two free cells for a start and a goal, found one")
            start, goal = self.ends(maze)
            if start is not None and start == goal:
                raise InputError(f"{maze.name}: expected start and goal in different cells, found both in {start}")
        if self.task == "local":
            self._check_distances()

    def _apply_track(self, name: str) -> None:
        """Takes over what the track called `name` fixes."""
        track = TRACKS[name]
        if self.cell_size != 1:
            raise InputError(f"track {name!r}: expected cells of 1 m, found {self.cell_size} m")
        for maze in self.mazes:
            track.check(maze, self.level)
        context_size = track.context_size(self.level, self.size)
        if self.context_size not in (0, context_size):
            raise InputError(f"track {name!r}: expected context_size {context_size}, found {self.context_size}")
        object.__setattr__(self, "context_size", context_size)
        if _LIDAR not in self.sensors:
            object.__setattr__(self, "sensors", (_LIDAR, *self.sensors))

    def _check_distances(self) -> None:
        if not self.distances:
            raise InputError("expected at least one distance, found none")
        for maze in self.mazes if self.ends_given < 2 else ():
            if max(self.distances) > (farthest := self.farthest(maze)):
                raise InputError(
                    f"{maze.name}: expected distances of at most {farthest} cells, as far as the maze reaches, "
                    f"found {max(self.distances)}; choose others (--distances)"
                )

    def ends(self, maze: Maze) -> tuple[Cell | None, Cell | None]:
        """Returns the start and the goal of all episodes in a maze; None for one that each episode draws.

        Raises:
          InputError: if one is not free.
        """
        places = {name: place for name in ENDS if (place := getattr(self, name)) is not None}
        cells = {name: cell_of_place(name, place, maze) for name, place in places.items()}
        corners = dict(zip(ENDS, corner_cells(maze), strict=True)) if self.task == "hierarchical" else {}
        start, goal = ((corners | cells).get(name) for name in ENDS)
        return start, goal

    def farthest(self, maze: Maze) -> int:
        """Returns the largest distance in cells that start and goal can have in a maze."""
        start, goal = self.ends(maze)
        if start is not None and goal is not None:
            return maze.distance(start, goal)
        given = start or goal
        return maze.diameter if given is None else int(maze.distances(given).max())

    @property
    def size(self) -> int:
        """N, the cells on a side of every maze."""
        return self.mazes[0].size

    @property
    def cell_size(self) -> float:
        """The side of every maze's cells, in metres."""
        return self.mazes[0].cell_size

    @property
    def version(self) -> int:
        """The version of what an episode is."""
        return TASK_VERSION if self.track is None else TRACKS_VERSION

    @property
    def has_legs(self) -> bool:
        """Whether the context may change within an episode: at landmarks, or where one goal follows another."""
        return self.task == "hierarchical" or self.num_goals > 1
