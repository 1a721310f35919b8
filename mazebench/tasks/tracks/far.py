"""The track `far`: the map is right, but large."""

from __future__ import annotations

from mazebench.tasks.tracks.base import Track


class Far(Track):
    """Large mazes and far goals; at level 3 the map is smaller than the maze."""

    help = "The map is right, but large."
    stream = 8
    levels = (
        "31 x 31 cells, goals 20 to 40 cells away",
        "51 x 51 cells, goals 30 to 60 cells away",
        "51 x 51 cells, goals 30 to 60 cells away, the map given as 21 x 21",
    )
    sizes = (31, 51, 51)

    def distances(self, level: int) -> tuple[int, ...]:
        return tuple(range(20, 41)) if level == 1 else tuple(range(30, 61))

    def _context_size(self, level: int, size: int) -> int:
        return 21 if level == 3 else size

    def time_limit(self, level: int, distance: int) -> int:
        return 6 * distance + 50
