"""Ranges from pictures: a network that tells how far the walls in a camera's view are, and how sure it is of that.

`B` is the number of pictures, `R` of rays in view. Like the lidar's, rays begin in the body's centre, at equal angles
round the body; the first one points straight ahead, the others follow counter-clockwise.
"""

from __future__ import annotations

import pathlib
from importlib import resources

import numpy as np
import torch
from torch import nn

from mazebench.errors import UnplayableError
from mazebench.world.looks import Camera

from ..common.actor import one_torch_thread
from ..common.checkpoint import load_checkpoint, load_into
from ..common.layers import in_batches, without_exposure
from .beams import Beams

NUM_RAYS = 96  # round the body
MAX_RANGE = 3.5  # m, as the lidar of the tracks; what is farther reads as much
SHIPPED = (75, 170, 360)  # degrees
NAME = "camera-ranges"

_SIZE = 64  # pixels of a picture's side
_NEAREST = 0.15  # m
_FARTHEST = MAX_RANGE + 0.5  # m, of what is learned
_FAR_SCALES = 3.0  # by which a range is surely farther than `MAX_RANGE`
SURE = 0.1  # m, the largest scale of a range that is trusted; chosen on train mazes
# The beam model's: m, the share of rays that read the largest range, or anything, and 1/m.
_SIGMA, _LOST, _RANDOM, _GROWTH = 0.03, 0.01, 0.05, 0.015
_WEIGHT = 0.1  # of a ray; chosen on train mazes
_AT_ONCE = 32  # pictures, always, since PyTorch rounds differently at another batch size


def rays_in_view(fov: float) -> np.ndarray:
    """Returns the numbers of the rays that a camera of `fov` degrees sees, `[R]` int, from right to left."""
    most = min(int((fov / 2 - 1) / (360 / NUM_RAYS)), NUM_RAYS // 2)
    return np.arange(-most, most + 1)[:NUM_RAYS] % NUM_RAYS


class RangeNetwork(nn.Module):
    """Convolutions of a picture, first towards its columns, then along them."""

    places: torch.Tensor  # [1, 2, 64, 64]

    def __init__(self, num_rays: int):
        """Reads pictures of 64 x 64 pixels."""
        super().__init__()
        self._num_rays = num_rays
        self.picture = nn.Sequential(
            nn.Conv2d(5, 16, 5, stride=2, padding=2), nn.ReLU(), nn.Conv2d(16, 24, 3, stride=2, padding=1), nn.ReLU(),
            nn.Conv2d(24, 32, 3, stride=(2, 1), padding=1), nn.ReLU(),
            nn.Conv2d(32, 32, 3, stride=(2, 1), padding=1), nn.ReLU(),
        )  # fmt: skip
        self.columns = nn.Sequential(
            nn.Conv1d(32 * _SIZE // 16, 96, 3, padding=1), nn.ReLU(), nn.Conv1d(96, 48, 3, padding=1), nn.ReLU(),
            nn.Flatten(), nn.Linear(48 * _SIZE // 4, 2 * num_rays),
        )  # fmt: skip
        place = torch.linspace(-1, 1, _SIZE)
        self.register_buffer("places", torch.stack(torch.meshgrid(place, place, indexing="ij"))[None], persistent=False)

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        """Returns `[B, 2, R]` of pictures `[B, 64, 64, 3]` uint8: the inverse of each range, and the log of its scale.

        The inverse has Laplace's distribution.
        """
        colors = without_exposure(pictures.movedim(-1, 1) / 255)
        planes = torch.cat([colors, self.places.expand(len(colors), -1, -1, -1)], dim=1)
        inverse, scale = self.columns(self.picture(planes).flatten(1, 2)).split(self._num_rays, dim=1)
        return torch.stack([inverse + 0.6, scale.clamp(-6, 2) - 1], dim=1)

    def loss(self, pictures: torch.Tensor, ranges: torch.Tensor) -> torch.Tensor:
        """Returns the mean negative log likelihood of true ranges `[B, R]` (m), less a constant."""
        inverse, log_scale = self(pictures).unbind(1)
        off = (inverse - 1 / ranges.clamp(_NEAREST, _FARTHEST)).abs()
        return (off / log_scale.exp() + log_scale).mean()

    @torch.no_grad()
    def read(self, pictures: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns ranges and their scales, `[B, R]` float64 each, in m."""
        read = in_batches(self, _AT_ONCE, torch.from_numpy(pictures)).double().numpy()
        ranges = 1 / np.maximum(read[:, 0], 1 / (_FARTHEST + 1))
        return ranges, np.exp(read[:, 1]) * ranges**2


class CameraRanges:
    """Ranges by the network that ships for a camera."""

    def __init__(self, camera: Camera, agent: str):
        """Reads the network; raises `UnplayableError`, in the name of `agent`, if none ships for the camera."""
        if camera != Camera(_SIZE, camera.fov) or camera.fov not in SHIPPED:
            views = ", ".join(map(str, SHIPPED))
            raise UnplayableError(
                f"agent {agent!r}: expected a lidar, or a camera of {_SIZE} pixels and {views} degrees at the default "
                f"height, offset and pitch, found {camera}"
            )
        self._rays = rays_in_view(camera.fov)
        self.network = RangeNetwork(len(self._rays))
        shipped = resources.files("mazebench_assets.checkpoints") / f"ranges-{camera.fov:g}.safetensors"
        path = pathlib.Path(str(shipped))
        load_into(path, self.network, load_checkpoint(path, NAME)[0])

    def beams(self, cells_per_metre: float) -> Beams:
        """Returns the beam model of these ranges, whose errors grow with the square of the range."""
        reach, sigma, growth = MAX_RANGE * cells_per_metre, _SIGMA * cells_per_metre, _GROWTH / cells_per_metre
        return Beams(reach, sigma, _LOST, _RANDOM, cells_per_metre, growth, _WEIGHT)

    @one_torch_thread()
    def read(self, pictures: np.ndarray, chosen: np.ndarray | None = None) -> np.ndarray:
        """Returns the ranges `[B, 96]` float64 in m of pictures `[B, 64, 64, 3]` uint8; NaN where it is not sure.

        Only pictures that are `chosen` (`[B]` bool) are read.
        """
        rows = np.arange(len(pictures)) if chosen is None else np.flatnonzero(chosen)
        ranges, scales = self.network.read(pictures[rows])
        is_far = 1 / ranges + _FAR_SCALES * scales / ranges**2 < 1 / (MAX_RANGE - 0.1)
        found = np.full((len(pictures), NUM_RAYS), np.nan)
        found[np.ix_(rows, self._rays)] = np.where(is_far, MAX_RANGE, np.where(scales > SURE, np.nan, ranges))
        return found
