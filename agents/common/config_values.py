"""Values of configs: the ranges that they share."""

from __future__ import annotations

from typing import Annotated, Any

from annotated_types import Ge, Interval

from mazebench.errors import InputError

# What is larger than any of them is a slip of the hand.
Size = Annotated[int, Interval(ge=1, le=4096)]  # numbers of a layer or of a code
Count = Annotated[int, Interval(ge=1, le=65_536)]  # of what is computed or played side by side
Steps = Annotated[int, Interval(ge=1, le=1_000_000)]  # of the environment
Length = Annotated[int, Interval(ge=1, le=1000)]  # steps of a sequence, or of a return
Rows = Annotated[int, Interval(ge=1, le=100_000_000)]  # of the replay
Updates = Annotated[int, Interval(ge=1, le=1_000_000_000)]
Factor = Annotated[float, Ge(0.0)]  # weights of losses, learning rates
Exponent = Annotated[float, Interval(ge=0.0, le=10.0)]
Ahead = Annotated[float, Interval(ge=1.0, le=1e6)]  # a number of steps that need not be whole
Share = Annotated[float, Interval(ge=0.0, le=1.0)]


def check_rows(config: Any) -> None:
    """Checks that the replay can hold as many rows as learning waits for."""
    rows = config.replay_capacity // config.num_envs * config.num_envs
    if rows < config.min_rows:
        raise InputError(f"expected a replay_capacity of at least min_rows {config.min_rows}, found one of {rows} rows")
