"""Reads a map with fewer pixels than the maze has cells: which doors of a maze of corridors explain its grey values.

In a maze of corridors, cells with odd row and column are rooms, those with even row and column are pillars, and the
others are doors, open or closed. A pixel shows the share of wall in it, so each pixel ties the few doors in it
together. The probability of each door to be closed follows by loopy belief propagation (Kschischang, Frey and Loeliger
2001) between doors and two kinds of factors: pixels, and rooms, of which few are closed or open on all sides.

`N` is the number of cells on a side of the maze, `M` the number of pixels, `D` the number of doors, `F` of factors and
`K` of the most doors of a factor.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from scipy import special

from ..common.kernels import compiled, inlined

_CLOSED = 0.43  # prior probability of a door to be closed
# Log weights of rooms with 0 to 4 closed doors: half of what sets mazes of corridors apart from doors drawn at random.
# All of it would count twice what chains of rooms tell.
_ROOM_WEIGHTS = np.array([-0.86, -0.16, 0.31, -0.43, -4.6])
# Standard deviations of a pixel's value, one a round: at first wide, so that no door is settled too early. 8 bits have
# 0.0011.
_NOISE = np.geomspace(0.02, 0.003, 15)
_DAMPING = 0.5  # share of the new messages
_LARGEST_MESSAGE = 15.0  # log odds
_ERROR = 0.002  # probability that a cell is misread, at least
_MOST_DOORS = 12  # of a pixel, all of whose states are summed over
_LARGEST_RESIDUAL = 0.02  # root mean square difference of pixels that mazes of corridors explain


class _Factors(NamedTuple):
    """The doors that each factor ties together."""

    doors: np.ndarray  # [F, K] int, indices of doors; D, a door that is closed, for places that are walls
    num_doors: np.ndarray  # [F] int, how many of them
    shares: np.ndarray  # [F, K] float, of each door in a pixel


def read_coarse_map(picture: np.ndarray, size: int, known: np.ndarray) -> np.ndarray:
    """Returns `[N, N]` float: the probability that each cell is a wall, 1 at the border only.

    Args:
      picture: `[M, M]` float, the share of wall in each pixel, M < N.
      size: N.
      known: `[N, N]` float, 0 for free cells that are known, 1 for walls, else NaN.
    """
    shares = _overlaps(size, len(picture))
    walls = _explained(picture, size, known)
    if walls is None or np.sqrt(((picture - shares @ walls @ shares.T) ** 2).mean()) > _LARGEST_RESIDUAL:
        # The maze is no maze of corridors. A cell is as much wall as the pixels over it.
        walls = shares.T @ picture @ shares / np.outer(shares.sum(axis=0), shares.sum(axis=0))
    walls = np.clip(np.where(np.isnan(known), walls, known), _ERROR, 1 - _ERROR)
    walls[[0, -1]] = walls[:, [0, -1]] = 1.0
    return walls


def _explained(picture: np.ndarray, size: int, known: np.ndarray) -> np.ndarray | None:
    """Returns `[N, N]` float: the probabilities of walls in a maze of corridors; None if the maze can't be one."""
    if size % 2 == 0:
        return None
    pixels, rooms = _pixel_factors(size, len(picture)), _room_factors(size)
    if pixels.doors.shape[1] > _MOST_DOORS:
        return None
    shares, (is_door, others) = _overlaps(size, len(picture)), _doors(size)
    told = np.nan_to_num(known[is_door], nan=_CLOSED)
    log_odds = np.append(special.logit(told), np.inf)
    rest = (picture - shares @ others @ shares.T).ravel()  # what doors have to explain
    messages, room_messages = np.zeros(pixels.doors.shape), np.zeros(rooms.doors.shape)
    for noise in _NOISE:
        _pass_pixels(log_odds, messages, pixels.doors, pixels.num_doors, pixels.shares, rest, float(noise))
        _pass_rooms(log_odds, room_messages, rooms.doors)
    walls = others.copy()
    walls[is_door] = special.expit(log_odds[:-1])
    return walls


@functools.lru_cache
def _overlaps(size: int, num_pixels: int) -> np.ndarray:
    """Returns `[M, N]` float: the share of each cell in each pixel along one axis; rows sum to 1."""
    edges, cells = np.arange(num_pixels + 1) * size / num_pixels, np.arange(size)
    overlaps = np.minimum(edges[1:, None], cells + 1) - np.maximum(edges[:-1, None], cells)
    return np.maximum(overlaps, 0.0) * num_pixels / size


@functools.lru_cache
def _doors(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns `[N, N]` bool, the cells that are doors, and `[N, N]` float, which of the others are walls."""
    is_door, walls = np.zeros((size, size), dtype=bool), np.zeros((size, size))
    is_door[1:-1:2, 2:-1:2] = is_door[2:-1:2, 1:-1:2] = True
    walls[::2, ::2] = 1.0
    walls[[0, -1]] = walls[:, [0, -1]] = 1.0
    return is_door, walls


def _numbers(size: int) -> np.ndarray:
    """Returns `[N, N]` int: the index of each door, D at all other cells."""
    is_door, _ = _doors(size)
    numbers = np.full((size, size), is_door.sum())
    numbers[is_door] = np.arange(is_door.sum())
    return numbers


@functools.lru_cache
def _pixel_factors(size: int, num_pixels: int) -> _Factors:
    shares, (is_door, _), numbers = _overlaps(size, num_pixels), _doors(size), _numbers(size)
    found = []
    for rows in shares:
        for columns in shares:
            share = np.outer(rows, columns) * is_door
            found.append((numbers[share > 0], share[share > 0]))
    count = np.array([len(doors) for doors, _ in found])
    doors, door_shares = np.zeros((len(found), count.max()), dtype=np.int64), np.zeros((len(found), count.max()))
    for factor, (its_doors, its_shares) in enumerate(found):
        doors[factor, : len(its_doors)], door_shares[factor, : len(its_doors)] = its_doors, its_shares
    return _Factors(doors, count, door_shares)


@functools.lru_cache
def _room_factors(size: int) -> _Factors:
    numbers = _numbers(size)
    sides = numbers[:-1:2, 1::2], numbers[2::2, 1::2], numbers[1::2, :-1:2], numbers[1::2, 2::2]
    doors = np.stack(sides, axis=-1).reshape(-1, 4)
    return _Factors(doors, np.full(len(doors), 4), np.ones(doors.shape))


@compiled
def _pass_pixels(
    log_odds: np.ndarray, messages: np.ndarray, doors: np.ndarray, num_doors: np.ndarray, shares: np.ndarray,
    values: np.ndarray, noise: float,
) -> None:  # fmt: skip
    """Updates what each pixel tells its doors: `messages` `[F, K]`, and `log_odds` `[D + 1]`, both in place.

    `values` `[F]` are the shares of wall that the doors have to explain, with deviation `noise`.
    """
    weights = np.empty(2 ** doors.shape[1])
    for factor in range(len(doors)):
        for state in range(2 ** num_doors[factor]):
            off = values[factor]
            for k in range(num_doors[factor]):
                if state >> k & 1:
                    off -= shares[factor, k]
            weights[state] = -((off / noise) ** 2) / 2
        _send(log_odds, messages[factor], doors[factor, : num_doors[factor]], weights)


@compiled
def _pass_rooms(log_odds: np.ndarray, messages: np.ndarray, doors: np.ndarray) -> None:
    """Updates what each room tells its doors: `messages` `[F, 4]`, and `log_odds` `[D + 1]`, both in place."""
    weights = np.empty(16)
    for state in range(16):
        weights[state] = _ROOM_WEIGHTS[(state & 1) + (state >> 1 & 1) + (state >> 2 & 1) + (state >> 3 & 1)]
    for factor in range(len(doors)):
        _send(log_odds, messages[factor], doors[factor], weights)


@inlined
def _send(log_odds: np.ndarray, messages: np.ndarray, doors: np.ndarray, weights: np.ndarray) -> None:
    """Updates the messages `[K]` of one factor to its doors, and their log odds.

    `weights` `[2 ** K]` are the factor's log weights; bit k of a state says that door k is closed. Doors whose log odds
    are infinite are known.
    """
    num_doors = len(doors)
    received = np.empty(num_doors)
    for k in range(num_doors):
        received[k] = min(max(log_odds[doors[k]] - messages[k], -1e3), 1e3)
    largest = -np.inf
    joint = np.empty(2**num_doors)
    for state in range(2**num_doors):
        joint[state] = weights[state]
        for k in range(num_doors):
            joint[state] += received[k] * (state >> k & 1)
        largest = max(largest, joint[state])
    closed, total = np.zeros(num_doors), 0.0
    for state in range(2**num_doors):
        probability = math.exp(joint[state] - largest)
        total += probability
        for k in range(num_doors):
            closed[k] += probability * (state >> k & 1)
    for k in range(num_doors):
        if math.isinf(log_odds[doors[k]]):
            continue
        told = math.log(max(closed[k], 1e-18) / max(total - closed[k], 1e-18)) - received[k]
        told = min(max(told, -_LARGEST_MESSAGE), _LARGEST_MESSAGE)
        change = _DAMPING * (told - messages[k])
        log_odds[doors[k]] += change
        messages[k] += change
