"""Passages that a round body fits through on the pixels of a map, opened where its cells are too coarse for them.

The free positions of the body's centre are split at the cells' sides into nodes, each connected within one cell. Two
nodes are joined where the body can move from one to the other across the side that their cells share.

`H` and `W` are the numbers of rows and columns of pixels, `R` and `C` of cells, `K` of nodes.
"""

from __future__ import annotations

import dataclasses
import functools

import cv2
import numpy as np
import scipy

WORTH_REACHING = 1.0  # m2, of the positions in a region to which a way is opened
_ON_FREE_CELLS = 1e-6  # the cost of a step to a free cell, where one to a wall costs 1
_NEVER = 1e9  # the cost of a step to a node through which no way may lead
_MAX_TRIES = 300  # ways that are tried in one map
_ABOUT = 1  # cells around a cell to be opened in which its sides must be joined by the pixels, too
_SIDES = ((-1, 0), (1, 0), (0, -1), (0, 1))


@dataclasses.dataclass(frozen=True, eq=False)
class Nodes:
    """Positions of the body's centre, as nodes of a graph."""

    cells: np.ndarray  # [K] int, the cell of each as row * C + column
    areas: np.ndarray  # [K] float, m2 of positions
    links: scipy.sparse.csr_array  # [K, K], True where the body moves from one to the other
    shape: tuple[int, int]  # R, C

    @functools.cached_property
    def _order(self) -> np.ndarray:
        return np.argsort(self.cells, kind="stable")

    def of_cell(self, cell: int) -> np.ndarray:
        """Returns the nodes of a cell."""
        begin, end = np.searchsorted(self.cells, (cell, cell + 1), sorter=self._order)
        return self._order[begin:end]

    def around(self, node: int) -> set[int]:
        """Returns the nodes that are joined with one of them within the cells about its own."""
        row, column = divmod(int(self.cells[node]), self.shape[1])
        found, new = {node}, [node]
        while new:
            last = new.pop()
            for near in self.links.indices[self.links.indptr[last] : self.links.indptr[last + 1]].tolist():
                near_row, near_column = divmod(int(self.cells[near]), self.shape[1])
                is_about = abs(near_row - row) <= _ABOUT and abs(near_column - column) <= _ABOUT
                if is_about and near not in found:
                    found.add(near)
                    new.append(near)
        return found


def nodes_of(positions: np.ndarray, cell_of: np.ndarray, shape: tuple[int, int], resolution: float) -> Nodes:
    """Returns the nodes of the positions of a body.

    Args:
      positions: `[H, W]` bool, the pixels at which the body's centre may be.
      cell_of: `[H, W]` int, the cell of each pixel as row * C + column, -1 where there is none.
      shape: R and C.
      resolution: m, the side of a pixel.
    """
    is_node = positions & (cell_of >= 0)

    # Connected pixels of one cell; the picture of twice the size has a pixel for each step between two pixels.
    height, width = positions.shape
    steps = np.zeros((2 * height - 1, 2 * width - 1), dtype=np.uint8)
    steps[::2, ::2] = is_node
    for axis in (0, 1):
        first, second = (_pairs(is_node, axis, number) for number in (0, 1))
        is_same = _pairs(cell_of, axis, 0) == _pairs(cell_of, axis, 1)
        (steps[1::2, ::2] if axis == 0 else steps[::2, 1::2])[:] = first & second & is_same
    count, labels = cv2.connectedComponents(steps, connectivity=4)
    numbers = labels[::2, ::2] - 1
    count -= 1
    cells = np.zeros(count, dtype=int)
    cells[numbers[is_node]] = cell_of[is_node]
    areas = np.bincount(numbers[is_node], minlength=count) * resolution**2

    # Steps from one cell to a neighbour, but not across a corner.
    ends = []
    for axis in (0, 1):
        first, second = (_pairs(numbers, axis, number) for number in (0, 1))
        is_step = (_pairs(is_node, axis, 0) & _pairs(is_node, axis, 1)) & (first != second)
        pairs = np.unique(first[is_step].astype(np.int64) * count + second[is_step])
        ends.append(np.stack(np.divmod(pairs, max(1, count))))
    begin, end = np.concatenate(ends, axis=1)
    is_side = np.isin(np.abs(cells[begin] - cells[end]), (1, shape[1]))
    is_side &= (cells[begin] // shape[1] == cells[end] // shape[1]) | (cells[begin] % shape[1] == cells[end] % shape[1])
    begin, end = begin[is_side], end[is_side]
    links = scipy.sparse.coo_array((np.ones(len(begin), dtype=bool), (begin, end)), (count, count))
    return Nodes(cells, areas, (links + links.T).tocsr(), shape)


def _pairs(pixels: np.ndarray, axis: int, number: int) -> np.ndarray:
    """Returns the first or the second of all pairs of neighbours along an axis."""
    along = slice(1, None) if number else slice(None, -1)
    return pixels[along] if axis == 0 else pixels[:, along]


def open_ways(walls: np.ndarray, area: np.ndarray, shut: np.ndarray, nodes: Nodes, least: float) -> np.ndarray:
    """Returns walls in which an area is joined with the regions that the body reaches from it: `[R, C]` bool.

    If one of them has at least `least` m2, ways to all from `WORTH_REACHING` are opened. The cells that are opened are
    the fewest along a way of the body, and each has a position on that way. None is opened that would join cells beside
    it between which the body can't move there.

    Args:
      walls: `[R, C]` bool.
      area: `[R, C]` bool, a connected area of free cells.
      shut: `[R, C]` bool, cells that no way may lead through.
      nodes: the positions of the body.
      least: m2.
    """
    walls = walls.copy()
    if (reached := _reached(nodes, area, shut)) is None:
        return walls
    way_through: dict[int, int] = {}  # of each cell that was opened, the node
    is_barred, is_left_out = np.zeros((2, len(reached.cells)), dtype=bool)
    for _ in range(_MAX_TRIES):
        free, _ = scipy.ndimage.label(~walls)
        area = free == free[area].max()
        region = _largest_far(reached, area, ~is_left_out)
        if region is None or (not way_through and reached.areas[region].sum() < least):
            break

        # The way of the body to the free cells in the region, or to its end, on which the fewest walls are opened.
        cost = np.where(is_barred, _NEVER, np.where(walls.ravel()[reached.cells], 1.0, _ON_FREE_CELLS))
        graph = scipy.sparse.csr_array(
            (cost[reached.links.indices], reached.links.indices, reached.links.indptr), reached.links.shape
        )
        begin = np.flatnonzero(area.ravel()[reached.cells])
        costs, before, _ = scipy.sparse.csgraph.dijkstra(graph, indices=begin, min_only=True, return_predecessors=True)
        number = free.ravel()[reached.cells] * region
        sizes = np.bincount(number, reached.areas)[1:]
        if sizes.any():
            target = number == 1 + sizes.argmax()
            end = int(np.argmin(np.where(target, costs, np.inf)))
        else:
            target = region
            end = int(np.argmax(np.where(target & (costs < _NEVER), costs, -1)))
        if not target[end] or costs[end] >= _NEVER:
            is_left_out |= target
            continue
        way = [end]
        while before[way[-1]] >= 0:
            way.append(int(before[way[-1]]))

        # Its cells, from the area on.
        new: dict[int, int] = {}
        for node in reversed(way):
            cell = int(reached.cells[node])
            if walls.flat[cell] and cell not in new:
                if not _joins_rightly(reached, node, walls, way_through | new):
                    is_barred[node] = True
                    break
                new[cell] = node
        else:
            way_through |= new
            walls.flat[list(new)] = False
    return walls


def _reached(nodes: Nodes, area: np.ndarray, shut: np.ndarray) -> Nodes | None:
    """Returns the nodes that the body reaches from an area, not through what is shut; None if it can't be in it."""
    open_nodes = np.flatnonzero(~shut.ravel()[nodes.cells])
    _, component = scipy.sparse.csgraph.connected_components(nodes.links[open_nodes][:, open_nodes], directed=False)
    common = np.bincount(component, (area.ravel()[nodes.cells] * nodes.areas)[open_nodes])
    if not common.any():
        return None
    kept = open_nodes[component == common.argmax()]
    return Nodes(nodes.cells[kept], nodes.areas[kept], nodes.links[kept][:, kept], nodes.shape)


def _largest_far(nodes: Nodes, area: np.ndarray, is_asked: np.ndarray) -> np.ndarray | None:
    """Returns the nodes of the largest region that is neither in an area nor beside it: `[K]` bool.

    None is returned if no region counts.
    """
    beside = cv2.dilate(area.astype(np.uint8), np.ones((3, 3))) > 0
    far = np.flatnonzero(is_asked & ~beside.ravel()[nodes.cells])
    _, component = scipy.sparse.csgraph.connected_components(nodes.links[far][:, far], directed=False)
    sizes = np.bincount(component, nodes.areas[far], minlength=1)
    if sizes.max() < WORTH_REACHING:
        return None
    region = np.zeros(len(nodes.cells), dtype=bool)
    region[far[component == sizes.argmax()]] = True
    return region


def _joins_rightly(nodes: Nodes, node: int, walls: np.ndarray, way_through: dict[int, int]) -> bool:
    """Returns whether the body can move from a node to all open cells beside its cell, near that cell."""
    row, column = divmod(int(nodes.cells[node]), nodes.shape[1])
    around = nodes.around(node)
    for down, right in _SIDES:
        near_row, near_column = row + down, column + right
        if not (0 <= near_row < nodes.shape[0] and 0 <= near_column < nodes.shape[1]):
            continue
        cell = near_row * nodes.shape[1] + near_column
        if cell in way_through:
            if way_through[cell] not in around:
                return False
        elif not walls.flat[cell] and around.isdisjoint(nodes.of_cell(cell).tolist()):
            return False
    return True
