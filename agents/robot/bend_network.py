"""A network that reads off a hand-drawn map by how much its points are displaced, and how sure it is of that.

`B` is the number of drawings. It reads a drawing on the box around its free pixels, in which the maze's inner cells lie
if nothing is displaced (`drawing_box`). Displacements are those of the maze's points at the 32 x 32 corners of cells.
"""

from __future__ import annotations

import pathlib

import numpy as np
import torch
from scipy import ndimage
from torch.nn import functional

from ..common.actor import one_torch_thread
from ..common.checkpoint import load_checkpoint, load_into
from ..common.symmetry import NUM_SYMMETRIES, turn_planes
from ..common.u_net import UNet
from .drawn_map import GUESSED_SIZE as SIZE
from .drawn_map import Guess, drawing_box

NAME = "map-bends"
PLACES = np.arange(SIZE + 1.0)  # [32], cells, of its outputs along an axis

_CHANNELS = (24, 48, 72, 72)  # of features at 1, 2, 4 and 8 cells
_SAMPLES = (np.arange(2 * len(PLACES)) + 0.5) / 2 - 0.5  # [64], cells, of its inputs along an axis; two for each output


class BendNetwork(UNet):
    """A U-Net: features of 1, 2, 4 and 8 cells, and back."""

    places: torch.Tensor  # [1, 2, 32, 32]

    def __init__(self) -> None:
        """Makes a network with new weights."""
        super().__init__(6, _CHANNELS, 4)
        place = torch.linspace(-1, 1, len(PLACES))
        self.register_buffer("places", torch.stack(torch.meshgrid(place, place, indexing="ij"))[None], persistent=False)

    def guess(self, drawings: torch.Tensor) -> torch.Tensor:
        """Returns `[B, 2, 2, 32, 32]` of drawings `[B, 64, 64]`: displacements, and the logs of their scales.

        Both are along rows and along columns, in cells. A displacement has Laplace's distribution.
        """
        planes = functional.pixel_unshuffle(drawings[:, None], 2)
        found = self(torch.cat([planes, self.places.expand(len(planes), -1, -1, -1)], dim=1))
        bends, log_scales = found.split(2, dim=1)
        return torch.stack([bends, log_scales.clamp(-5, 2)], dim=1)

    def loss(self, drawings: torch.Tensor, bends: torch.Tensor) -> torch.Tensor:
        """Returns the mean negative log likelihood of true displacements `[B, 2, 32, 32]`, less a constant."""
        found, log_scales = self.guess(drawings).unbind(1)
        return ((found - bends).abs() * torch.exp(-log_scales) + log_scales).mean()

    @one_torch_thread()
    @torch.no_grad()
    def read(self, picture: np.ndarray) -> Guess:
        """Returns what it finds in a picture `[62, 62]`, on average over the eight ways in which this may lie."""
        drawing = torch.from_numpy(sampled(picture))
        found = self.guess(torch.stack([turn_planes(drawing, symmetry) for symmetry in range(NUM_SYMMETRIES)]))
        found[:, 1] = found[:, 1].exp()
        upright = torch.stack([turn_bends(each, _inverse(symmetry)) for symmetry, each in enumerate(found)])
        upright[:, 1] = upright[:, 1].abs()  # a turn has changed the signs of some
        bends, scales = upright.mean(dim=0).double().numpy()
        return Guess(PLACES, bends, scales)


def load(path: pathlib.Path) -> BendNetwork:
    """Returns the network of a file; raises `InputError` if that can't be read, or is none of such a network."""
    network = BendNetwork()
    load_into(path, network, load_checkpoint(path, NAME)[0])
    return network


def sampled(picture: np.ndarray) -> np.ndarray:
    """Returns `[64, 64]` float32: a picture `[62, 62]` on the box around its drawing."""
    pixels = [on_picture(_SAMPLES, *ends) - 0.5 for ends in drawing_box(picture)]
    grid = np.stack(np.meshgrid(*pixels, indexing="ij"))
    return ndimage.map_coordinates(picture.astype(np.float32), grid, order=1, mode="constant", cval=1.0)


def on_picture(places: np.ndarray, first: int, last: int) -> np.ndarray:
    """Returns where places are in a picture of which the pixels `first` to `last` are free, in pixels from its edge."""
    return first + (places - 1) * (last + 1 - first) / (SIZE - 2)


def turn_bends(bends: torch.Tensor, symmetry: int) -> torch.Tensor:
    """Returns displacements `[..., 2, 32, 32]` as they are on the drawing that `turn_planes` turns."""
    down, right = bends.unbind(-3)
    if symmetry >= 4:
        right = -right
    for _ in range(symmetry % 4):
        down, right = -right, down
    return turn_planes(torch.stack([down, right], dim=-3), symmetry)


def _inverse(symmetry: int) -> int:
    """Returns the symmetry that undoes another one; a mirror image is its own."""
    return symmetry if symmetry >= 4 else -symmetry % 4
