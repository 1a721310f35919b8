"""The options of reading mazes of one's own."""

from __future__ import annotations

import dataclasses
import functools
from typing import Annotated

from annotated_types import Interval

from mazebench.maps.places import place_text
from mazebench.options import Doc, OneOf, Options, ReadBy


@dataclasses.dataclass(frozen=True, kw_only=True)
class ReadOptions(Options):
    """Options of reading mazes of one's own."""

    cell_size: Annotated[
        float | None,
        Interval(ge=0.01, le=100),
        Doc(
            "Width of a cell of your own mazes in metres; if not given, 1, or for ROS maps and pictures with "
            "pixel_size, which are coarsened to such cells, the smallest possible from 0.4."
        ),
    ] = None
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
    area: Annotated[
        str | None,
        ReadBy(functools.partial(place_text, "area")),
        Doc(
            "The building, if a map has several separate free areas: a cell row,column or a point 1.5m,2.5m (x, y) of "
            "the maze that lies in it. If not given, the largest area, or an enclosed one if that is the ground around."
        ),
    ] = None


THIN_WALLS = "a floor plan with thin walls needs --pixel-size, its metres a pixel"  # of plans that can't be read
