"""The map that the agent is shown in an episode, and the context of a leg on it."""

from __future__ import annotations

import numpy as np

from mazebench.maps.maze import Cell
from mazebench.tasks.context import build_context
from mazebench.tasks.episode import Episode
from mazebench.tasks.perturbations import active_perturbations
from mazebench.tasks.perturbations.base import ShownMap
from mazebench.tasks.spec import TaskSpec


def show_map(spec: TaskSpec, episode: Episode) -> ShownMap:
    """Returns the map that the agent is shown in `episode`."""
    shown = ShownMap(spec.mazes[episode.maze].walls)
    for perturbation, level in active_perturbations(spec):
        rng = episode.stream(perturbation.stream)
        shown = perturbation.show(shown, level, (episode.start, episode.goal), rng)
    return shown


def leg_context(spec: TaskSpec, shown: ShownMap, start: Cell, goal: Cell) -> np.ndarray:
    """Returns `[4, M, M]` float32: the context of the leg between two cells of the maze (see `build_context`)."""
    return build_context(shown.seen_walls(), shown.seen_cell(start), shown.seen_cell(goal), spec.context_size)
