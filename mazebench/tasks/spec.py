"""A navigation task: its options and its mazes."""

from __future__ import annotations

import dataclasses

from mazebench.errors import InputError
from mazebench.maps.maze import MAX_SIZE, Maze
from mazebench.tasks import TASK_VERSION, TRACKS_VERSION
from mazebench.tasks.context import default_context_size
from mazebench.tasks.options import TaskOptions
from mazebench.tasks.tracks import TRACKS

_MIN_CONTEXT_SIZE = 3
_LIDAR = "lidar"  # the sensor that every track offers


@dataclasses.dataclass(frozen=True, kw_only=True)
class TaskSpec(TaskOptions):
    """A navigation task on mazes of one size, which the dm_env, Gymnasium and vector environments all play.

    It holds plain values: no models, no simulation.

    Raises:
      InputError: if an option is not allowed, or the mazes do not fit it.
    """

    mazes: tuple[Maze, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        sizes = sorted({maze.size for maze in self.mazes})
        if not sizes:
            raise InputError("expected at least one maze, found none")
        if len(sizes) > 1:
            raise InputError(f"expected mazes of one size, found sizes {sizes}")
        if self.track is not None:
            self._apply_track(self.track)
        elif self.context_size == 0:
            object.__setattr__(self, "context_size", default_context_size(self.size))
        if self.context_size < _MIN_CONTEXT_SIZE:
            raise InputError(f"expected context_size from {_MIN_CONTEXT_SIZE} to {MAX_SIZE}, found {self.context_size}")
        for maze in self.mazes:
            if len(maze.free_cells) < 2:
                raise InputError(f"{maze.name}: expected two free cells for a start and a goal, found one")
        if self.task == "local":
            self._check_distances()

    def _apply_track(self, name: str) -> None:
        """Takes over what the track called `name` fixes."""
        track = TRACKS[name]
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
        for maze in self.mazes:
            if max(self.distances) > maze.diameter:
                raise InputError(
                    f"{maze.name}: no two cells are {max(self.distances)} cells apart; the farthest are "
                    f"{maze.diameter}; choose smaller distances"
                )

    @property
    def size(self) -> int:
        """N, the cells on a side of every maze."""
        return self.mazes[0].size

    @property
    def version(self) -> int:
        """The version of what an episode is."""
        return TASK_VERSION if self.track is None else TRACKS_VERSION

    @property
    def has_legs(self) -> bool:
        """Whether the context may change within an episode: at landmarks, or where one goal follows another."""
        return self.task == "hierarchical" or self.num_goals > 1
