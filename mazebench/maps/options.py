"""The options with which maps of one's own are read."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

from mazebench.errors import InputError
from mazebench.options import Options, option, options_of


@dataclasses.dataclass(frozen=True, kw_only=True)
class MapOptions(Options):
    """How maps of one's own are read.

    Raises:
      InputError: if an option is not allowed.
    """

    cell_size: float | None = option(
        None,
        "Width of a cell of your own maps in metres. If not given, 1; for ROS maps and pictures with pixel_size, which "
        "are coarsened to such cells, the smallest possible from 0.4.",
        lowest=0.01,
        highest=100,
    )
    walls: str = option(
        "filled",
        "Walls in a picture are rows of filled cells, or lines between rooms; R x C rooms become 2 R + 1 by 2 C + 1 "
        "cells.",
        choices=("filled", "lines"),
    )
    pixel_size: float | None = option(
        None,
        "Metres per pixel of a picture of a floor plan, which may have thin walls. It is read as a ROS map is: dark is "
        "wall, light is free.",
        lowest=0.001,
        highest=0.5,  # so that pixels a metre are refused
    )
    unknown: str = option(
        "wall",
        "What unknown cells of an occupancy grid become; those around the building are always wall.",
        choices=("wall", "free"),
    )
    inflate: float = option(
        0.0,
        "Metres by which the walls of an occupancy grid are thickened before cells are made, such as 0.15, the body's "
        "radius.",
        lowest=0,
        highest=10,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.pixel_size is not None:
            self.require_defaults(("walls",), "pictures without a pixel_size", f"pixel_size {self.pixel_size:g}")

    def require_defaults(self, names: Iterable[str], expected: str, found: str) -> None:
        """Raises `InputError` if one of the options `names` has another value than its default.

        Args:
          names: of fields.
          expected: what the options belong to, for the message.
          found: what there is instead.
        """
        for name in names:
            if getattr(self, name) != getattr(MapOptions(), name):
                raise InputError(f"{name} belongs to {expected}, found {found}")


# Those for which a map must say what is unknown, or have pixels smaller than cells.
OCCUPANCY_OPTIONS = ("unknown", "inflate")
PICTURE_OPTIONS = ("walls", "pixel_size")
MAP_OPTIONS = tuple(options_of(MapOptions))
NO_OPTIONS = MapOptions()
THIN_WALLS = "a floor plan with thin walls needs --pixel-size, its metres a pixel"  # of plans that can't be read
