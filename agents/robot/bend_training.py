"""Trains the network that reads how drawn maps are bent, on drawings of fresh train mazes, each of them new.

python -m mazebench_agents.robot.bend_training --out map-bends.safetensors
"""

from __future__ import annotations

import argparse
import contextlib
import pathlib
import time
from collections.abc import Iterator, Mapping
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

from ..common.actor import one_torch_thread
from ..common.checkpoint import load_checkpoint, save_checkpoint
from ..common.descent import Descent, cosine
from ..common.symmetry import NUM_SYMMETRIES, turn_planes
from .bend_network import NAME, PLACES, BendNetwork, on_picture, sampled, turn_bends
from .drawn_map import GUESSED_SIZE as SIZE
from .drawn_map import drawing_box

_BATCH = 32
_NEW = 4  # drawings per update, in the place of the oldest ones
_FIRST = 256  # drawings before the first update
_NUM_KEPT = 2048  # drawings that batches are taken from
_SAME_MAZE = 3  # drawings of a maze, each with other doors
_BENDS = (0.5, 1.0, 1.5, 1.5)  # m, as likely as each other
_MOVED = (MovedDoors(45), MovedDoors(70))
_OUTSIDE = 4  # m around the maze in which points that are drawn are looked for
_PER_CELL = 4  # points at which the displacement is computed, along an axis
_NUM_TURNS = 24  # of the search for the point that is drawn at a place
_REPORTED = 200  # updates


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


class Training:
    """A training under way, `num_updates` long."""

    def __init__(self, num_updates: int, seed: int, tensors: Mapping[str, torch.Tensor] | None = None):
        """Begins, or goes on from the `tensors` of an earlier one, with other drawings."""
        torch.manual_seed(seed)
        self._network = BendNetwork()
        self._network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # a quarter faster
        self._descent = Descent(
            self._network,
            torch.optim.Adam(self._network.parameters(), 2e-3),
            max_gradient_norm=1.0,
            target_rate=0.005,
            rate=lambda update: min(1.0, update / 100) * cosine((update - 1) / num_updates),
        )
        self._num_updates, self._begin = num_updates, 0
        if tensors is not None:
            self._network.load_state_dict({name: tensors[name] for name in self._network.state_dict()})
            self._descent.load(tensors)
            self._begin = int(tensors["num_updates"])
        self._drawings, self._rng = Drawings(seed, self._begin), np.random.default_rng([seed, self._begin])

    @property
    def network(self) -> BendNetwork:
        """The moving average of the networks so far, which is the result."""
        return self._descent.target

    def tensors(self) -> dict[str, torch.Tensor]:
        """Returns what another training goes on from."""
        return self._network.state_dict() | self._descent.tensors()

    def run(self) -> Iterator[tuple[int, float]]:
        """Yields the number of updates and their mean loss, every few hundred updates."""
        side, num_drawn, losses = len(PLACES), 0, []
        pictures = np.empty((_NUM_KEPT, 2 * side, 2 * side), np.float32)
        bends = np.empty((_NUM_KEPT, 2, side, side), np.float32)
        for update in range(self._begin + 1, self._num_updates + 1):
            for _ in range(_NEW if num_drawn else _FIRST):
                drawn, place = self._drawings.draw(), num_drawn % _NUM_KEPT
                pictures[place], bends[place] = sampled(drawn.picture), true_bends(drawn)
                num_drawn += 1

            chosen = self._rng.integers(min(num_drawn, _NUM_KEPT), size=_BATCH)
            symmetry = int(self._rng.integers(NUM_SYMMETRIES))
            loss = self._network.loss(
                turn_planes(torch.from_numpy(pictures[chosen]), symmetry),
                turn_bends(torch.from_numpy(bends[chosen]), symmetry),
            )
            self._descent.step(loss)
            losses.append(loss.item())
            if update % _REPORTED == 0 or update == self._num_updates:
                yield update, float(np.mean(losses[-_REPORTED:]))


@one_torch_thread()
def main() -> None:
    """Trains, and writes the network every minute or so."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--updates", type=int, default=9_000, help=f"of {_BATCH} drawings each")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="the file to write")
    parser.add_argument("--resume", action="store_true", help="go on from the file NAME.training, which is written too")
    options = parser.parse_args()
    state = options.out.with_suffix(".training")
    before = load_checkpoint(state, NAME)[0] if options.resume else None
    training, provenance = Training(options.updates, options.seed, before), {"agent": NAME, "seed": options.seed}
    for update, loss in training.run():
        provenance["updates"] = update
        save_checkpoint(options.out, training.network.state_dict(), provenance)
        save_checkpoint(state, training.tensors(), provenance)
        print(f"{update:,} updates, {time.process_time():.0f} s of CPU, loss {loss:.3f}", flush=True)


if __name__ == "__main__":
    main()
