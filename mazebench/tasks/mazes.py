"""The mazes in which a task is played."""

from __future__ import annotations

from mazebench.errors import InputError
from mazebench.maps.maze import Maze
from mazebench.maps.options import MAP_OPTIONS, NO_OPTIONS, MapOptions
from mazebench.maps.selection import Maps, load_mazes_of
from mazebench.tasks.options import TaskOptions
from mazebench.tasks.tracks import TRACKS


def load_task_mazes(
    options: TaskOptions, size: int | None, split: str, maps: Maps | None = None, map_options: MapOptions = NO_OPTIONS
) -> tuple[Maze, ...]:
    """Returns the mazes in which a task with `options` is played; see `load_mazes_of`.

    Raises:
      InputError: if there are no such mazes, the options' track has another size, or a map can't be read.
    """
    if options.track is None or maps is not None:
        return load_mazes_of(size, split, maps, map_options)
    map_options.require_defaults(MAP_OPTIONS, "maps of your own", f"the track {options.track!r}")
    track = TRACKS[options.track]
    mazes = track.mazes(options.level, split)
    if size not in (None, mazes[0].size):
        raise InputError(
            f"track {options.track!r}, level {options.level[0]}: expected size {mazes[0].size}, found {size}; "
            f"levels 1 to 3 have sizes {', '.join(map(str, track.sizes))}"
        )
    return mazes
