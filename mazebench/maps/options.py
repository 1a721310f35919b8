"""The options of a task's mazes, and of how maps of one's own are read."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any

from annotated_types import Interval

from mazebench.errors import InputError
from mazebench.maps.benchmark import SPLITS
from mazebench.options import Doc, OneOf, fields_of, options


@options
class MapOptions:
    """How maps of one's own are read.

    Raises:
      InputError: if an option is not allowed.
    """

    cell_size: Annotated[
        float | None,
        Interval(ge=0.01, le=100),
        Doc(
            "Width of a cell of your own maps in metres. If not given, 1; for ROS maps and pictures with pixel_size, "
            "which are coarsened to such cells, the smallest possible from 0.4."
        ),
    ] = None
    walls: Annotated[
        str,
        OneOf("filled", "lines"),
        Doc(
            "Walls in a picture are rows of filled cells, or lines between rooms; R x C rooms become 2 R + 1 by 2 C + "
            "1 cells."
        ),
    ] = "filled"
    pixel_size: Annotated[
        float | None,
        Interval(ge=0.001, le=0.5),  # so that pixels a metre are refused
        Doc(
            "Metres per pixel of a picture of a floor plan, which may have thin walls. It is read as a ROS map is: "
            "dark is wall, light is free."
        ),
    ] = None
    unknown: Annotated[
        str,
        OneOf("wall", "free"),
        Doc("What unknown cells of an occupancy grid become; those around the building are always wall."),
    ] = "wall"
    inflate: Annotated[
        float,
        Interval(ge=0, le=10),
        Doc(
            "Metres by which the walls of an occupancy grid are thickened before cells are made, such as 0.15, the "
            "body's radius."
        ),
    ] = 0.0

    def __post_init__(self) -> None:
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
            if getattr(self, name) != fields_of(MapOptions)[name].default:
                raise InputError(f"{name} belongs to {expected}, found {found}")


# Those for which a map must say what is unknown, or have pixels smaller than cells.
OCCUPANCY_OPTIONS = ("unknown", "inflate")
PICTURE_OPTIONS = ("walls", "pixel_size")
MAP_OPTIONS = tuple(fields_of(MapOptions))
THIN_WALLS = "a floor plan with thin walls needs --pixel-size, its metres a pixel"  # of plans that can't be read

Size = Annotated[
    int | None, Doc("Cells a side of the benchmark's mazes: 13 (if not given), 15, 17, 19 or 21; a track has its own.")
]


@options
class MazeOptions(MapOptions):
    """In which mazes a task is played."""

    size: Size = None
    split: Annotated[str, OneOf(*SPLITS), Doc("The benchmark's unseen mazes, or its training mazes.")] = "train"
    # A path, or in Python also mazes and arrays (`mazebench.maps.selection.Maps`).
    maps: Annotated[Any, Doc("Mazes of your own: a text, picture, array or ROS map, or a folder of them.")] = None
