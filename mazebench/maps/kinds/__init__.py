"""Random mazes of several kinds of layouts. A kind is one file and one entry of `KINDS`."""

from __future__ import annotations

import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.maps.kinds.cave import CAVE
from mazebench.maps.kinds.dfs import DFS
from mazebench.maps.kinds.hospital import HOSPITAL
from mazebench.maps.kinds.house import HOUSE
from mazebench.maps.kinds.kind import Kind
from mazebench.maps.kinds.museum import MUSEUM
from mazebench.maps.kinds.obstacles import OBSTACLES
from mazebench.maps.kinds.office import OFFICE
from mazebench.maps.kinds.rooms import ROOMS
from mazebench.maps.kinds.warehouse import WAREHOUSE
from mazebench.maps.maze import MAX_SIZE, MIN_SIZE, Maze

KINDS: dict[str, Kind] = {
    "dfs": DFS,
    "house": HOUSE,
    "rooms": ROOMS,
    "office": OFFICE,
    "hospital": HOSPITAL,
    "museum": MUSEUM,
    "obstacles": OBSTACLES,
    "cave": CAVE,
    "warehouse": WAREHOUSE,
}
KNOWN = ("dfs", "house", "rooms")  # of the mazes to train and to choose agents on
NOVEL = ("office", "hospital", "museum")  # of eval mazes only; learned agents meet them in their one evaluation only
CHECK = ("obstacles", "cave", "warehouse")  # in which a map is worth little; agents may be chosen on them


def generate(kind: str, size: int, rng: np.random.Generator, name: str | None = None) -> Maze:
    """Returns a random maze of `size` x `size` cells; the same `rng` gives the same maze.

        >>> mazebench.generate("house", 31, np.random.default_rng(0)).size
        31

    Args:
      kind: of the layout: "dfs", "house", "rooms" or another one of `mazebench list`.
      size: N; `dfs` and `rooms` need an odd one.
      rng: the random stream, which goes on.
      name: of the maze; by default the kind and the size.

    Raises:
      InputError: if the kind is unknown or has no mazes of this size.
    """
    if kind not in KINDS:
        raise unknown("kind", kind, KINDS)
    if not (isinstance(size, int | np.integer) and MIN_SIZE <= size <= MAX_SIZE):
        raise InputError(f"expected a size of {MIN_SIZE} to {MAX_SIZE} cells, found {size!r}")
    if not isinstance(rng, np.random.Generator):
        raise InputError(f"expected rng as a numpy.random.Generator, found {type(rng).__name__}")
    maker = KINDS[kind]
    if size < maker.smallest:
        raise InputError(f"kind {kind!r} makes mazes of {maker.smallest} cells and more, found size {size}")
    if maker.odd and size % 2 == 0:
        raise InputError(f"kind {kind!r} makes mazes of odd sizes only, found size {size}")
    return Maze(maker.walls(size, rng), name or f"{kind}-{size}", kind=kind)
