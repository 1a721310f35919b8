"""The maze: a legal grid of walls, with its cells, points and shortest paths.

`N` is the number of rows and of columns of a maze, `F` the number of its free cells. A cell is `(row, column)` with
row 0 on top. A point is `(x, y)`, x to the right and y up from the maze's lower left corner. Points in a world are in
metres, points on a map are in cells; only `Maze` converts one into the other. In the benchmark, a cell is 1 m wide.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import numbers
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy  # its parts are loaded at their first use; they would take half of the time in which commands start

from mazebench.errors import InputError, one_line
from mazebench.maps.covering import Rectangle, cover

Cell = tuple[int, int]

MIN_SIZE = 5
MAX_SIZE = 1024
MAX_CHOSEN_SIZE = 255  # of mazes whose cells a reader finds, or whose scale it chooses
WALL_HEIGHT = 1.0  # metres; DeepMind Lab's 100 units
MIN_CELL_SIZE = 0.4  # m, in which the body drives: it is 0.3 m wide, and contacts act 0.03 m before a wall

# (rows, columns) to each neighbour, in the order in which a shortest path prefers them.
_NEIGHBOURS = ((-1, 0), (0, -1), (1, 0), (0, 1))
# Rows of distances are kept up to this F; every maze of up to 45 x 45 cells is below.
_MAX_KEPT_ROWS = 2048
_WALL_COST = 1000  # the cost, in cells, of each wall on a path through walls


class MazeError(InputError):
    """A grid that is not a legal maze.

        >>> mazebench.Maze(np.zeros((5, 5), bool))
        Traceback (most recent call last):
        MazeError: maze: expected a closed border, found cell (0, 0) free

    The message names the maze or its file.
    """


@dataclasses.dataclass(frozen=True, eq=False)
class Maze:
    """A square grid of cells, closed by walls, whose free cells are 4-connected.

        >>> walls = np.ones((5, 5), bool)
        >>> walls[1:4, 1] = walls[3, 1:4] = False
        >>> maze = mazebench.Maze(walls)
        >>> maze.size, maze.distance((1, 1), (3, 3))  # in cells
        (5, 4)

    Raises:
      MazeError: if `walls` is not such a grid; the message names a cell that is wrong.
    """

    walls: np.ndarray  # [N, N] bool, True is wall; copied and made read-only
    name: str = "maze"
    cell_size: float = 1.0  # m, the side of a cell; 1 in the benchmark
    kind: str = ""  # of its layout, see `mazebench.maps.kinds`; empty for a maze that no kind has made

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", one_line(self.name))  # files may have any bytes in their names
        walls = np.array(self.walls)
        if walls.dtype != bool:
            raise MazeError(f"{self.name}: expected walls of dtype bool, found {walls.dtype}")
        if not isinstance(self.cell_size, numbers.Real) or not 0 < self.cell_size < math.inf:
            raise MazeError(f"{self.name}: expected a cell_size above 0 m, found {self.cell_size!r}")
        if walls.ndim != 2 or walls.shape[0] != walls.shape[1]:
            raise MazeError(f"{self.name}: expected a square grid, found shape {walls.shape}")
        if not MIN_SIZE <= len(walls) <= MAX_SIZE:
            raise MazeError(f"{self.name}: expected {MIN_SIZE} to {MAX_SIZE} cells a side, found {len(walls)}")
        require_closed_border(walls, self.name)
        require_connected(walls, self.name)
        walls.flags.writeable = False
        object.__setattr__(self, "walls", walls)
        object.__setattr__(self, "cell_size", float(self.cell_size))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Maze) and self.cell_size == other.cell_size and np.array_equal(self.walls, other.walls)

    def __hash__(self) -> int:
        return hash(self.walls.tobytes())

    def __deepcopy__(self, memo: dict[int, Any]) -> Maze:
        return self  # it never changes

    def __reduce__(self) -> tuple[Any, ...]:
        return Maze, (self.walls, self.name, self.cell_size, self.kind)  # without what is cached

    @property
    def as_built(self) -> Maze:
        """The maze before any of its doors moved (`moving_doors.MovedMaze`): itself."""
        return self

    @property
    def size(self) -> int:
        """The number N of rows and of columns."""
        return self.walls.shape[0]

    @functools.cached_property
    def free_cells(self) -> np.ndarray:
        """The free cells in reading order: `[F, 2]` int."""
        return np.argwhere(~self.walls)

    @property
    def keeps_distances(self) -> bool:
        """True if the maze has so few free cells that it keeps the distances from each of them once they are known."""
        return len(self.free_cells) <= _MAX_KEPT_ROWS

    def is_free(self, cell: Cell) -> bool:
        """Returns whether `cell` lies in the maze and is not a wall."""
        row, column = cell
        return 0 <= row < self.size and 0 <= column < self.size and not self.walls[row, column]

    @property
    def side(self) -> float:
        """The side of the whole maze, in metres."""
        return self.size * self.cell_size

    def point(self, cells: np.ndarray | Cell) -> np.ndarray:
        """Returns the centres (x, y) in metres, `[..., 2]` float, of `[..., 2]` cells."""
        return self.cell_size * cell_to_point(cells, self.size)

    def cell(self, points: np.ndarray) -> np.ndarray:
        """Returns the cells, `[..., 2]` int, of `[..., 2]` points in metres; of two cells, the right or upper one."""
        return point_to_cell(np.asarray(points) / self.cell_size, self.size)

    def cell_index(self, points: np.ndarray) -> np.ndarray:
        """Returns the cells, `[...]` int, of `[..., 2]` points in metres as row * N + column, as `cell` does."""
        first = self.size * (self.size - 1.0)  # of the lower left cell
        return (np.floor(points / self.cell_size).dot([1.0, -self.size]) + first).astype(np.int64)

    def cell_at(self, x: float, y: float) -> Cell:
        """Returns the cell of a single point in metres, as `cell` does, but in a fraction of the time."""
        return cell_of_point(x / self.cell_size, y / self.cell_size, self.size)

    def require_free(self, cell: Cell) -> Cell:
        """Returns `cell` if it is free.

        Raises:
          MazeError: if it is a wall or outside.
        """
        if not self.is_free(cell):
            raise MazeError(f"{self.name}: expected a free cell, found {tuple(map(int, cell))}, a wall or outside")
        return (int(cell[0]), int(cell[1]))

    def distances(self, source: Cell) -> np.ndarray:
        """Returns the length in cells of a shortest 4-connected path from `source`: `[N, N]` int, -1 at walls."""
        return self._distances_from(self.require_free(source)).copy()

    def distance(self, start: Cell, goal: Cell) -> int:
        """Returns the length in cells of a shortest 4-connected path between two free cells."""
        start, goal = self.require_free(start), self.require_free(goal)
        if self.keeps_distances:
            return int(self._distances_from(start)[goal])
        _, ends = self._search(start, goal[0] * self.size + goal[1])
        return len(ends) - 1

    def cells_at(self, source: Cell, distance: int) -> np.ndarray:
        """Returns the free cells at exactly `distance` from `source`, in reading order: `[K, 2]` int."""
        source = self.require_free(source)
        if self.keeps_distances:
            return np.transpose((self._distances_from(source) == distance).nonzero())
        cells, ends = self._search(source, farthest=distance)
        at_distance = cells[ends[distance - 1] if distance else 0 :] if len(ends) > distance else cells[:0]
        return np.stack(np.divmod(np.sort(at_distance).astype(np.int64), self.size), axis=-1)

    @functools.cached_property
    def diameter(self) -> int:
        """The largest distance of two free cells; with over 2,048 free cells, a lower bound by a double sweep."""
        if self.keeps_distances:
            return max(len(self._search(cell)[1]) for cell in self.free_cells) - 1
        farthest = int(self.distances(tuple(self.free_cells[0])).argmax())
        return int(self.distances(divmod(farthest, self.size)).max())

    @functools.cached_property
    def boxes(self) -> list[Rectangle]:
        """The walls as few rectangles of cells."""
        return cover(self.walls)

    @functools.cached_property
    def _kept_distances(self) -> dict[Cell, np.ndarray]:
        return {}

    def _distances_from(self, source: Cell) -> np.ndarray:  # [N, N] int32, -1 at walls, which nobody may write to
        result = self._kept_distances.get(source)
        if result is None:
            from mazebench.maps.search import distances  # which needs numba

            result = distances(self.walls, source[0] * self.size + source[1])
            if self.keeps_distances:
                self._kept_distances[source] = result
        return result

    def _search(self, source: Cell | np.ndarray, goal: int = -1, farthest: int = MAX_SIZE**2) -> tuple[np.ndarray, ...]:
        from mazebench.maps.search import search  # which needs numba

        return search(self.walls, source[0] * self.size + source[1], goal, farthest)


def corner_cells(maze: Maze, cells: np.ndarray | None = None) -> tuple[Cell, Cell]:
    """Returns the free cells nearest the top-right and the bottom-left corner, the paper's global start and goal.

    They are chosen among some `cells` (`[F, 2]`), by default all free ones.
    """
    rows, columns = (maze.free_cells if cells is None else cells).T
    top_right = np.argmin(rows + (maze.size - 1 - columns))
    bottom_left = np.argmin((maze.size - 1 - rows) + columns)
    return (int(rows[top_right]), int(columns[top_right])), (int(rows[bottom_left]), int(columns[bottom_left]))


def require_one_size(mazes: Sequence[Maze]) -> None:
    """Checks that there is a maze, and that all have one size and cells of one size.

    Raises:
      MazeError: if not.
    """
    if not isinstance(mazes, Sequence) or not all(isinstance(maze, Maze) for maze in mazes):
        raise MazeError(f"expected a sequence of Maze, found {mazes!r}"[:200])
    if not mazes:
        raise MazeError("expected at least one maze, found none")
    for what, found in (
        ("one size", {maze.size for maze in mazes}),
        ("cells of one size in metres", {maze.cell_size for maze in mazes}),
    ):
        if len(found) > 1:
            raise MazeError(f"expected mazes of {what}, found {', '.join(map(str, sorted(found)))}")


def resized(maze: Maze, cell_size: float | None) -> Maze:
    """Returns `maze` with cells of `cell_size` m; itself if that is None."""
    return maze if not cell_size else dataclasses.replace(maze, cell_size=cell_size)


def path_through_walls(walls: np.ndarray, start: Cell, goal: Cell) -> list[Cell]:
    """Returns a cheapest 4-connected path on any grid (`[N, N]` bool), both ends included.

    It is a shortest free path if there is one; else each wall on the path costs 1000 cells. The landmark oracle plans
    so on maps with flipped cells (the paper's appendix on perturbed planning). Of several, it is the path whose first
    differing step comes first in the order up, left, down, right.
    """
    from mazebench.maps.search import distances  # which needs numba

    # Backwards from the goal, in a closed border: the cells from each cell to the goal.
    width = len(walls) + 2
    closed = np.ones((width, width), dtype=bool)
    closed[1:-1, 1:-1] = walls
    cell, last = ((row + 1) * width + column + 1 for row, column in (start, goal))
    left = distances(closed, last, cell).ravel().tolist()
    if left[cell] < 0 or walls[goal]:
        costs = np.full(closed.shape, math.inf)
        costs[1:-1, 1:-1] = np.where(walls, _WALL_COST, 1)
        return _cheapest_path(costs, start, goal)

    # Forwards.
    path, moves = [start], [down * width + right for down, right in _NEIGHBOURS]
    while cell != last:
        for move in moves:
            if left[cell + move] == left[cell] - 1:
                break
        cell += move
        path.append((cell // width - 1, cell % width - 1))
    return path


def _cheapest_path(costs: np.ndarray, start: Cell, goal: Cell) -> list[Cell]:
    """Returns a path whose cells cost the least to enter.

    `costs` (`[N + 2, N + 2]` float) are those of the cells and of a border, which can't be entered: infinite.
    """
    # Cells are numbers in a list of all rows: plain numbers take a fraction of the time of arrays.
    width, cost = len(costs), costs.ravel().tolist()
    first, last = ((row + 1) * width + column + 1 for row, column in (start, goal))
    moves = [down * width + right for down, right in _NEIGHBOURS]

    # Backwards from the goal as far as the start: the cost from each cell to the goal, and the cells by that cost.
    left = np.where(costs < math.inf, math.inf, -1.0).ravel().tolist()
    left[last] = 0.0
    reached = {0.0: [last]}
    while reached and (lowest := min(reached)) < left[first]:
        for cell in reached.pop(lowest):
            through = lowest + cost[cell]
            nexts = reached.setdefault(through, [])
            for move in moves:
                if through < left[cell + move]:
                    left[cell + move] = through
                    nexts.append(cell + move)

    # Forwards.
    path = [first]
    while (cell := path[-1]) != last:
        path.append(next(near for move in moves if left[cell] - left[near := cell + move] == cost[near]))
    return [(cell // width - 1, cell % width - 1) for cell in path]


def cell_to_point(cells: np.ndarray | Cell, size: int) -> np.ndarray:
    """Returns the centres (x, y) in cells, `[..., 2]` float, of `[..., 2]` cells on a map of `size` cells a side."""
    points = np.asarray(cells, dtype=np.float64)[..., ::-1] + 0.5
    points[..., 1] = size - points[..., 1]
    return points


def point_to_cell(points: np.ndarray, size: int) -> np.ndarray:
    """Returns the cells, `[..., 2]` int, of `[..., 2]` points (x, y) in cells; of two, the right or upper one."""
    points = np.floor(np.asarray(points)).astype(np.int64)
    return np.stack([size - 1 - points[..., 1], points[..., 0]], axis=-1)


def cell_of_point(x: float, y: float, size: int) -> Cell:
    """Returns the cell of a single point, as `point_to_cell` does, but in a fraction of the time."""
    return size - 1 - math.floor(y), math.floor(x)


def symmetries(walls: np.ndarray) -> list[np.ndarray]:
    """Returns the 8 rotations and mirror images of a grid."""
    return [np.rot90(grid, turns) for grid in (walls, walls.T) for turns in range(4)]


def canonical_bytes(walls: np.ndarray) -> bytes:
    """Returns bytes that are equal for two grids exactly if one is a rotation or mirror image of the other."""
    return min(np.ascontiguousarray(grid).tobytes() for grid in symmetries(walls))


def require_closed_border(walls: np.ndarray, name: str) -> None:
    """Raises `MazeError` with the first cell on the border of any grid (`[R, C]` bool) that is free."""
    border = np.ones_like(walls)
    border[1:-1, 1:-1] = False
    open_border = np.argwhere(border & ~walls)
    if len(open_border):
        raise MazeError(f"{name}: expected a closed border, found cell {tuple(open_border[0].tolist())} free")


def require_connected(walls: np.ndarray, name: str) -> None:
    """Raises `MazeError` unless the free cells of any grid (`[R, C]` bool) are one connected area of at least one."""
    components, num_components = scipy.ndimage.label(~walls)
    if num_components == 0:
        raise MazeError(f"{name}: expected a free cell, found only walls")
    if num_components > 1:
        first, cut_off = (tuple(np.argwhere(components == number)[0].tolist()) for number in (1, 2))
        raise MazeError(
            f"{name}: expected one connected free area, found {num_components}; "
            f"cell {cut_off} cannot be reached from {first}"
        )
