"""Draws a maze of each kind: docs/images/kinds.png. `python -m benchmarks.kind_pictures`."""

from __future__ import annotations

import pathlib

import numpy as np
from matplotlib.figure import Figure

from mazebench.maps.doors import door_slots
from mazebench.maps.kinds import CHECK, KNOWN, NOVEL, generate
from mazebench.maps.pictures import draw_grid

IMAGE = pathlib.Path(__file__).parent.parent / "docs" / "images" / "kinds.png"
SIZE = 31  # cells a side
SEED = 4
CELL_PIXELS = 12
CLOSED = 0.7  # shade of closed door slots, as a share of wall


def main() -> None:
    """Draws the picture: a row for each group of kinds."""
    groups = {"known": KNOWN, "novel": NOVEL, "check": CHECK}
    figure = Figure(figsize=(9, 9.6), layout="constrained")
    for row, (group, kinds) in zip(figure.subplots(3, 3), groups.items(), strict=True):
        for axes, kind in zip(row, kinds, strict=True):
            axes.set_axis_off()
            axes.imshow(draw_kind(kind, has_doors=kinds is not CHECK), interpolation="antialiased")
            axes.set_title(f"{kind} ({group})", fontsize=10)
    figure.savefig(IMAGE, dpi=110, metadata={"Software": None})
    print(IMAGE)


def draw_kind(kind: str, has_doors: bool) -> np.ndarray:
    """Returns the picture of a maze, `[H, W, 3]` uint8 RGB; closed door slots are gray if it `has_doors`."""
    maze = generate(kind, SIZE, np.random.default_rng(SEED))
    shades = maze.walls.astype(float)
    if has_doors:
        shades[tuple(door_slots(maze).T)] *= CLOSED
    return draw_grid(shades, CELL_PIXELS)


if __name__ == "__main__":
    main()
