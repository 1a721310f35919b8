"""Trains the network that reads how drawn maps are bent, on drawings of fresh train mazes, each of them new.

python -m mazebench_agents.robot.bend_training --out map-bends.safetensors
"""

from __future__ import annotations

import contextlib
from typing import NamedTuple

import numpy as np
import torch
from scipy import ndimage

from mazebench.errors import InputError
from mazebench.maps.drawn import FreshMazes
from mazebench.maps.kinds import KNOWN
from mazebench.maps.maze import Maze
from mazebench.tasks.perturbations.hand_drawing import HandDrawing, HandDrawnMap, Line
from mazebench.tasks.perturbations.moved_doors import MovedDoors
from mazebench.tasks.perturbations.perturbation import ShownMap

from ..common.lessons import KeptLessons, main
from ..common.symmetry import turn_planes
from .bend_network import NAME, PLACES, BendNetwork, on_picture, sampled, turn_bends
from .drawn_map import GUESSED_SIZE as SIZE
from .drawn_map import drawing_box

_SAME_MAZE = 3  # drawings of a maze, each with other doors
_BENDS = (0.5, 1.0, 1.5, 1.5)  # m, as likely as each other
_MOVED = (MovedDoors(45), MovedDoors(70))
_OUTSIDE = 4  # m around the maze in which points that are drawn are looked for
_PER_CELL = 4  # points at which the displacement is computed, along an axis
_NUM_TURNS = 24  # of the search for the point that is drawn at a place


class Drawn(NamedTuple):
    """A drawing and its truth."""

    walls: np.ndarray  # [31, 31] bool, that are drawn
    picture: np.ndarray  # [62, 62] float32
    drawing: HandDrawing


class Drawings:
    """A stream of drawings of mazes of some kinds, with doors moved or not."""

    def __init__(self, seed: int, begin: int = 0, kinds: tuple[str, ...] = KNOWN):
        """Draws from a seed of two numbers; each maze is a new one."""
        self._mazes = FreshMazes(kinds, SIZE)
        self._rng = np.random.default_rng([seed, begin, 2])
        self._maze: Maze = self._mazes[0]
        self._num_drawn = 0

    def draw(self, bend: float | None = None) -> Drawn:
        """Returns the next drawing, bent by up to `bend` m, or by one of those that are trained on."""
        rng = self._rng
        if self._num_drawn % _SAME_MAZE == 0:
            self._maze = self._mazes[int(rng.integers(len(self._mazes)))]
        shown = ShownMap(self._maze.walls, kind=self._maze.kind)
        if self._num_drawn % _SAME_MAZE:
            with contextlib.suppress(InputError):  # of a maze with few doors
                shown = _MOVED[rng.integers(len(_MOVED))].shown(shown, (), rng)
        self._num_drawn += 1
        bend = rng.choice(_BENDS) if bend is None else bend
        shown = HandDrawnMap(bend).shown(shown, (), rng)
        assert isinstance(shown.drawing, HandDrawing)
        return Drawn(shown.walls, shown.seen_walls, shown.drawing)


def true_bends(drawn: Drawn) -> np.ndarray:
    """Returns `[2, 32, 32]` float32: by how much the points that are drawn at the places are displaced, in cells."""
    drawing, box = drawn.drawing, drawing_box(drawn.picture)
    pixels = np.stack(np.meshgrid(*(on_picture(PLACES, *ends) for ends in box), indexing="ij"))
    aim = (pixels - drawing.origin[:, None, None]) / drawing.scale[:, None, None]

    # The point whose displacement leads to the aim, by a fixed point, half a step at a time.
    moved = drawing.displacement.on_grid(Line(_PER_CELL * (SIZE + 2 * _OUTSIDE) + 1, _PER_CELL, -_PER_CELL * _OUTSIDE))
    points = aim
    for _ in range(_NUM_TURNS):
        index = (points + _OUTSIDE) * _PER_CELL
        there = [ndimage.map_coordinates(axis, index, order=1, mode="nearest") for axis in moved]
        points = (points + aim - np.stack(there)) / 2
    return (points - np.stack(np.meshgrid(PLACES, PLACES, indexing="ij"))).astype(np.float32)


class BendLessons(KeptLessons):
    """Drawings and how they are bent."""

    name, num_updates, learning_rate, batch = NAME, 9_000, 2e-3, 32
    new, first, kept = 4, 256, 2048

    def __init__(self, seed: int, begin: int = 0):
        super().__init__(seed, begin)
        self._drawings = Drawings(seed, begin)

    def make_network(self) -> BendNetwork:
        return BendNetwork()

    def sample(self) -> tuple[np.ndarray, ...]:
        drawn = self._drawings.draw()
        return sampled(drawn.picture), true_bends(drawn)

    def loss(self, network: BendNetwork, parts: list[torch.Tensor], symmetry: int) -> torch.Tensor:
        pictures, bends = parts
        return network.loss(turn_planes(pictures, symmetry), turn_bends(bends, symmetry))


if __name__ == "__main__":
    main(BendLessons, __doc__)
