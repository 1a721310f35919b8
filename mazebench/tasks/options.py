"""The options of a task."""

from __future__ import annotations

import dataclasses

from mazebench.errors import InputError
from mazebench.maps.maze import MAX_SIZE
from mazebench.options import option
from mazebench.tasks.perturbations import Perturbations
from mazebench.tasks.sensors import SENSORS
from mazebench.tasks.sensors.base import SensorOptions

TASKS = ("local", "hierarchical")
TRAIN_DISTANCES = tuple(range(1, 6))
EVAL_DISTANCES = tuple(range(1, 16))
PAIRS = ("random", "fixed")


@dataclasses.dataclass(frozen=True, kw_only=True)
class TaskOptions(Perturbations, SensorOptions):
    """What is played, except the mazes.

    Raises:
      InputError: if an option is not allowed.
    """

    task: str = option("local", "Kind of navigation.", choices=TASKS)
    distances: tuple[int, ...] = option(
        TRAIN_DISTANCES,
        "Distances between start and goal in cells (local task); on the benchmark's eval mazes, 1 to 15 by default.",
        lowest=1,
    )
    pairs: str = option(
        "random",
        "random: a new start and goal in each episode; fixed: one pair in each maze, the paper's extremely-low-data "
        "regime (local task).",
        choices=PAIRS,
    )
    time_limit: int = option(100, "Agent steps to the goal, in the hierarchical task to each landmark.", lowest=1)
    landmark_distance: int = option(
        5, "Cells between landmarks, along a shortest path on the shown map (hierarchical task).", lowest=1
    )
    context_size: int = option(
        0,
        "M, the cells on a side of the context's planes, at least 3; 0 stands for min(N, 21).",
        lowest=0,
        highest=MAX_SIZE,
    )
    num_goals: int = option(
        1,
        "Goals of an episode, one after the other without a reset (local task, random pairs); rewards and success are "
        "those of the last one.",
        lowest=1,
    )
    continuous: bool = option(False, "Actions are velocities (forward, left, turn) instead of one of six.")
    sensors: tuple[str, ...] = option(
        (), "Sensors that are observed besides the state and the context.", choices=SENSORS
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(set(self.sensors)) < len(self.sensors):
            raise InputError(f"expected each sensor once, found {', '.join(self.sensors)}")
        if self.num_goals > 1 and (self.task != "local" or self.pairs != "random"):
            raise InputError(
                f"expected num_goals 1 unless the task is local and pairs are random, found {self.num_goals}"
            )
