"""A figure as one value: what is drawn where, and how it looks.

`describe.py` makes it from tables and episodes. `draw.py` draws it by matplotlib.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

from mazebench.report.looks import Look


class Point(NamedTuple):
    """A value, with its interval if it has one."""

    x: float
    value: float
    low: float | None = None
    high: float | None = None
    text: str = ""  # the value in words
    tick: int = 0  # the index of the tick that it belongs to; several series stand beside one another at a tick
    is_starred: bool = False  # whether a star stands beside it


@dataclasses.dataclass(frozen=True)
class Series:
    """The points of one agent, joined by a line, and the areas behind them."""

    label: str  # its look is the figure's look of this label
    points: tuple[Point, ...] = ()
    has_line: bool = True
    has_bars: bool = False  # the points' intervals
    mark_every: int = 1  # one of so many points has a marker
    areas: tuple[tuple[tuple[float, float], ...], ...] = ()  # the corners (x, y) of each
    opacity: float = 0.0  # of the areas
    outline: float = 0.0  # pt, around the areas


@dataclasses.dataclass(frozen=True)
class Panel:
    """Two axes and the series in them."""

    title: str
    x_name: str
    series: tuple[Series, ...]
    y_name: str = ""
    ticks: tuple[tuple[float, str], ...] = ()  # along the x axis, positions and texts; those of matplotlib if empty
    x_range: tuple[float, float] | None = None  # what the data need if None
    y_range: tuple[float, float] | None = None
    y_ticks: tuple[float, ...] = ()
    metric: str = ""  # the page shows it while this metric is chosen, or always
    agent: str = ""  # the page leaves it out while this agent is switched off
    is_in_file: bool = True  # or on the page only


@dataclasses.dataclass(frozen=True)
class Figure:
    """Panels beside and below one another, with one legend."""

    name: str  # of its files
    title: str
    note: str
    panels: tuple[Panel, ...]
    looks: Mapping[str, Look]  # of the labels of all series, in the order of legends
    panel_height: float  # inches, in files
