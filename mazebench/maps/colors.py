"""The colours of start and goal: the same in worlds, maps, figures and the page of a report."""

from __future__ import annotations

Color = tuple[float, float, float]  # red, green and blue in [0, 1]

START: Color = (0.25, 0.63, 0.39)
GOAL: Color = (0.84, 0.24, 0.24)


def to_bytes(color: Color) -> tuple[int, int, int]:
    """Returns a colour as numbers in 0 to 255, as pictures have it."""
    red, green, blue = (round(255 * part) for part in color)
    return red, green, blue


def to_hex(color: Color) -> str:
    """Returns a colour as "#rrggbb"."""
    return "#" + bytes(to_bytes(color)).hex()
