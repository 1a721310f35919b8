"""Parts of the kinds that are buildings: rooms that are split off each other, and doors between rooms."""

from __future__ import annotations

import numpy as np
import scipy

from mazebench.maps.kinds.kind import door_slots, rooms_beside

Box = tuple[int, int, int, int]  # the first row and column, and those after the last: top, left, bottom, right


def split_rooms(walls: np.ndarray, box: Box, least: int, rng: np.random.Generator) -> None:
    """Splits the free `box` of `walls` by walls of one cell into rooms, in place.

    A room whose longer side has more than twice `least` cells is split there, at a random place that leaves at least
    `least` on both sides.
    """
    boxes = [box]
    while boxes:
        top, left, bottom, right = boxes.pop()
        height, width = bottom - top, right - left
        if max(height, width) <= 2 * least:
            continue
        if height > width:
            row = int(rng.integers(top + least, bottom - least))
            walls[row, left:right] = True
            boxes += [(top, left, row, right), (row + 1, left, bottom, right)]
        else:
            column = int(rng.integers(left + least, right - least))
            walls[top:bottom, column] = True
            boxes += [(top, left, bottom, column), (top, column + 1, bottom, right)]


def cut(start: int, end: int, gaps: list[int], least: int, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Returns the first cells of rooms in a row, and those after their last, of random lengths from `least`.

    The first room begins at `start`, `gaps` cells lie between the rooms, and the last one ends before `end`.
    """
    spare = end - start - sum(gaps) - least * (len(gaps) + 1)
    lengths = least + rng.multinomial(spare, np.full(len(gaps) + 1, 1 / (len(gaps) + 1)))
    starts = start + np.cumsum([0, *(lengths[:-1] + gaps)])
    return list(zip(starts.tolist(), (starts + lengths).tolist(), strict=True))


def open_doors(walls: np.ndarray, cost: np.ndarray, extra: float, rng: np.random.Generator) -> None:
    """Joins all rooms by doors, in place: by a random spanning tree, and each other pair of rooms with chance `extra`.

    Two rooms have one door at most. The tree is that whose doors cost least. A door costs what `cost` (`[N, N]` float
    or bool) says of its cell, and a random number from 0 to 1.
    """
    # Of each pair of rooms, the slot that costs least.
    slots = door_slots(walls)
    slots = slots[np.argsort(cost[tuple(slots.T)] + rng.random(len(slots)))]
    rooms = np.sort(rooms_beside(walls, slots), axis=0)
    num_rooms = int(rooms.max()) + 1
    _, cheapest = np.unique(rooms[0] * num_rooms + rooms[1], return_index=True)

    # Slots are in the order of their costs, so that their numbers give the same tree. A cost of 0 would be no edge.
    graph = scipy.sparse.csr_array((cheapest + 1, rooms[:, cheapest]), shape=(num_rooms, num_rooms))
    tree = scipy.sparse.csgraph.minimum_spanning_tree(graph).data.astype(int) - 1
    others = cheapest[rng.random(len(cheapest)) < extra]
    walls[tuple(slots[np.concatenate([tree, others])].T)] = False
