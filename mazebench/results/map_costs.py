"""The metres and seconds that an old map costs an agent per trip, and what to do with the map.

A trip is an episode; the same ones are driven with the old map, with the right one and without any. docs/your_map.md
has the definitions. `E` is the number of trips.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from mazebench.constants import STEP_TIME
from mazebench.results.intervals import Estimate, difference_interval
from mazebench.results.records import Record, column

OLD, RIGHT, NONE = "old-map", "right-map", "no-map"  # the names of the three parts

# Of the metres of a trip with the right map: what an old map may cost that is kept, and from where on it is drawn anew.
LITTLE, MUCH = 0.05, 0.25
KEEP, REDRAW, ANEW = "keep it", "keep it, but redraw these places", "draw it anew"
OPEN = "this building is so open that an old map costs nothing"
TOO_FEW = "too few trips"
LEAST_ARRIVED, NO_VERDICT = 0.9, "none, as this robot misses its goals with the right map, too"


@dataclasses.dataclass(frozen=True)
class Cost:
    """The cost of a map above that of the right one, over the same trips."""

    metres: Estimate  # per trip
    seconds: Estimate  # per trip
    tenth: float  # m; one trip in ten needs at least so much more
    num_arrived: int


@dataclasses.dataclass(frozen=True)
class Answer:
    """The cost of an old map for an agent, and the verdict on it."""

    num_trips: int
    metres: float  # per trip with the right map
    num_arrived: int  # with the right map
    old: Cost
    none: Cost | None  # without a map; None for an agent that needs one

    @property
    def verdict(self) -> str:
        """The verdict on the map, by the bounds of the metres' intervals; see docs/your_map.md."""
        little, much = LITTLE * self.metres, MUCH * self.metres
        low, high = self.old.metres.low, self.old.metres.high
        if self.num_arrived < LEAST_ARRIVED * self.num_trips:
            return NO_VERDICT
        if high < little:
            is_open = self.none is not None and self.none.metres.high < little
            return OPEN if is_open else KEEP
        if low >= much:
            return ANEW
        if low > 0 and high < much:
            return REDRAW
        left = [word for word, is_left in ((KEEP, low <= 0), (REDRAW, low < much), (ANEW, high >= much)) if is_left]
        return f"{TOO_FEW} to choose: {', or '.join(left)}"

    @property
    def sentence(self) -> str:
        """The costs in words."""
        old, none = self.old, self.none
        tenth = f"one trip in ten needs {_metres(old.tenth)} m or more"
        words = (
            f"With the old map this robot needs {_more(old)} per trip than with the right one {_interval(old)}; "
            f"{tenth}; {_arrived(old.num_arrived, self.num_trips)}."
        )
        if none is not None:
            arrived = "" if none.num_arrived == self.num_trips else f"; {_arrived(none.num_arrived, self.num_trips)}"
            words += f" Without a map: {_more(none)} {_interval(none)}{arrived}."
        if self.num_arrived < self.num_trips:
            words += f" With the right map, {_arrived(self.num_arrived, self.num_trips)}."
        return words


def answer(old: Sequence[Record], right: Sequence[Record], none: Sequence[Record] | None, top_speed: float) -> Answer:
    """Returns the answer of the records of the same trips with each map.

    Args:
      old: with the old map; `right` with the right one, and `none` without a map, or None.
      top_speed: of the body, in m/s.
    """

    def cost(records: Sequence[Record]) -> Cost:
        metres, seconds = (driven(records, top_speed) - driven(right, top_speed)).T
        mazes = column(records, "maze")
        return Cost(
            _estimate(metres, mazes),
            _estimate(seconds, mazes),
            float(np.quantile(metres, 0.9)),
            int(column(records, "success").sum()),
        )

    return Answer(
        num_trips=len(right),
        metres=float(driven(right, top_speed)[:, 0].mean()),
        num_arrived=int(column(right, "success").sum()),
        old=cost(old),
        none=None if none is None else cost(none),
    )


def driven(records: Sequence[Record], top_speed: float) -> np.ndarray:
    """Returns the metres and seconds of trips: `[E, 2]` float.

    A trip that does not arrive uses up its time. It counts the metres that the body drives in this time at top speed,
    which no trip that arrives exceeds.
    """
    seconds = STEP_TIME * column(records, "steps")
    metres = np.where(column(records, "success"), column(records, "path_length"), top_speed * seconds)
    return np.column_stack([metres, seconds])


def _estimate(differences: np.ndarray, mazes: np.ndarray) -> Estimate:
    return difference_interval(differences, mazes, max(1.0, float(np.abs(differences).max())))


def _more(cost: Cost) -> str:
    return f"{_metres(cost.metres.value)} m ({_metres(cost.seconds.value)} s) more"


def _interval(cost: Cost) -> str:
    return f"[{_metres(cost.metres.low)}, {_metres(cost.metres.high)}]"


def _metres(value: float) -> str:
    """Returns a number with one decimal, from 10 on with none; no -0."""
    return f"{round(value, 0 if abs(value) >= 10 else 1) + 0.0:g}"


def _arrived(number: int, of: int) -> str:
    return f"all {of} arrive" if number == of else f"{number} of {of} arrive"
