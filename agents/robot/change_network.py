"""A network that tells, for each cell of a shown map, how probably it has changed, from the map and what was seen.

`B` is the number of maps, `N` the number of cells on a side: any number, and mazes of any kind.
"""

from __future__ import annotations

import pathlib
from importlib import resources

import numpy as np
import torch
from torch.nn import functional

from ..common.actor import one_torch_thread
from ..common.checkpoint import load_checkpoint, load_into
from ..common.u_net import UNet

NAME = "map-changes"
SHIPPED = pathlib.Path(str(resources.files("mazebench_assets") / "checkpoints" / f"{NAME}.safetensors"))

_CHANNELS = (16, 32, 48)  # of features at 1, 2 and 4 cells
_MULTIPLE = 2 ** (len(_CHANNELS) - 1)  # of cells along an axis of the inputs


class ChangeNetwork(UNet):
    """A U-Net from the planes shown wall, seen wall and seen free to the log odds that a cell has changed."""

    def __init__(self) -> None:
        """Makes a network with new weights."""
        super().__init__(3, _CHANNELS, 1)

    def log_odds(self, shown: torch.Tensor, seen_wall: torch.Tensor, seen_free: torch.Tensor) -> torch.Tensor:
        """Returns `[B, N, N]`, the log odds of a change, of three planes `[B, N, N]`; a cell not seen has 0 in two."""
        planes, size = torch.stack([shown, seen_wall, seen_free], dim=1).float(), shown.shape[-1]
        added = -size % _MULTIPLE
        return self(functional.pad(planes, (0, added, 0, added), value=1.0))[:, 0, :size, :size]

    def loss(self, shown: torch.Tensor, true: torch.Tensor, seen: torch.Tensor) -> torch.Tensor:
        """Returns the mean cross-entropy of cells not seen inside the border; the arguments are `[B, N, N]` bool."""
        found = self.log_odds(shown, seen & true, seen & ~true)[:, 1:-1, 1:-1]
        entropy = functional.binary_cross_entropy_with_logits(
            found, (shown != true)[:, 1:-1, 1:-1].float(), reduction="none"
        )
        return entropy[~seen[:, 1:-1, 1:-1]].mean()

    @one_torch_thread()
    @torch.no_grad()
    def changes(self, shown: np.ndarray, seen_wall: np.ndarray, seen_free: np.ndarray) -> np.ndarray:
        """Returns `[N, N]` float: the probability that a cell differs from the map; the arguments are `[N, N]` bool."""
        planes = torch.from_numpy(np.stack([shown, seen_wall, seen_free]))[:, None]
        return torch.sigmoid(self.log_odds(*planes))[0].double().numpy()


def load(path: pathlib.Path = SHIPPED) -> ChangeNetwork:
    """Returns the network of a file, by default of the one that ships.

    Raises:
      InputError: if the file can't be read, or is none of such a network.
    """
    network = ChangeNetwork()
    load_into(path, network, load_checkpoint(path, NAME)[0])
    return network
