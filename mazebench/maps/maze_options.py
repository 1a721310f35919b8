"""The options of a task's mazes, and of how mazes of one's own are read."""

from __future__ import annotations

from typing import Annotated, Any

from annotated_types import Ge, Interval
from pydantic import BeforeValidator

from mazebench.errors import InputError
from mazebench.maps.benchmark import ALL_SPLITS
from mazebench.maps.kinds import CHECK, KNOWN, NOVEL
from mazebench.options import Doc, OneOf, fields_of, options


@options
class ReadOptions:
    """Options of reading mazes of one's own."""

    cell_size: Annotated[
        float | None,
        Interval(ge=0.01, le=100),
        Doc(
            "Width of a cell of your own mazes in metres. If not given, 1; for ROS maps and pictures with pixel_size, "
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


THIN_WALLS = "a floor plan with thin walls needs --pixel-size, its metres a pixel"  # of plans that can't be read

Size = Annotated[
    int | None,
    Doc(
        "Cells a side of the benchmark's mazes: 13 (if not given), 15, 17, 19 or 21; of drawn mazes, any that their "
        "kinds can make; a track has its own."
    ),
]
DRAWN_KINDS = (*KNOWN, *CHECK)


def _refuse_novel(kinds: tuple[Any, ...]) -> tuple[Any, ...]:
    for kind in kinds:
        if kind in NOVEL:
            raise InputError(f"kind {kind!r}: only the eval split has it; kinds: {', '.join(DRAWN_KINDS)}")
    return kinds


@options
class DrawnOptions:
    """Options of mazes that are drawn, instead of the benchmark's."""

    kinds: Annotated[
        tuple[Annotated[str, OneOf(*DRAWN_KINDS)], ...],
        BeforeValidator(_refuse_novel),
        Doc(f"Mazes that are drawn, of these kinds, as dfs,house; {DRAWN_KINDS[0]} beside the other two options."),
    ] = ()
    num_mazes: Annotated[int, Ge(0), Doc("Drawn mazes of each kind; 0 stands for 20.")] = 0
    fresh: Annotated[bool, Doc("Every episode has a new maze, of one of the kinds (not in an evaluation).")] = False

    def __post_init__(self) -> None:
        if len(set(self.kinds)) < len(self.kinds):
            raise InputError(f"expected each kind once, found {', '.join(self.kinds)}")
        if self.fresh and self.num_mazes:
            raise InputError(f"expected no num_mazes beside fresh, found {self.num_mazes}")

    @property
    def is_drawn(self) -> bool:
        """True if mazes are drawn."""
        return bool(self.kinds or self.num_mazes or self.fresh)

    @property
    def drawn_kinds(self) -> tuple[str, ...]:
        """The kinds of mazes that are drawn."""
        return self.kinds or DRAWN_KINDS[:1]


@options
class MazeOptions(ReadOptions, DrawnOptions):
    """Options of the mazes of a task."""

    size: Size = None
    split: Annotated[
        str,
        OneOf(*ALL_SPLITS),
        Doc("The benchmark's training mazes, unseen ones to choose agents on (tracks), or those for results."),
    ] = "train"
    # A path, or in Python also mazes and arrays (`mazebench.maps.selection.OwnMazes`).
    mazes: Annotated[Any, Doc("Mazes of your own: a text, picture, array or ROS map, or a folder of them.")] = None

    def __post_init__(self) -> None:
        DrawnOptions.__post_init__(self)
        if self.is_drawn and self.mazes is not None:
            raise InputError("expected mazes of your own or mazes that are drawn, found both")
        for name, field in fields_of(ReadOptions).items():
            if self.mazes is None and getattr(self, name) != field.default:
                raise InputError(f"expected mazes of your own with {name}, found none")
