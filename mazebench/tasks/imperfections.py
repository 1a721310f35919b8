"""What is wrong in an episode: the perturbations that are switched on, or the track at its level."""

from __future__ import annotations

import numpy as np

from mazebench.tasks.episode import Episode
from mazebench.tasks.perturbations import active_perturbations
from mazebench.tasks.perturbations.base import Perturbation
from mazebench.tasks.spec import TaskSpec
from mazebench.tasks.tracks import TRACKS

_LEVEL_STREAM = 4  # number of the episode's random stream that draws its level, where a task has several


def imperfections(spec: TaskSpec, episode: Episode) -> list[tuple[Perturbation, float, np.random.Generator]]:
    """Returns what is wrong in `episode`, in the order in which it applies, each with its level and random stream."""
    active = active_perturbations(spec)
    if spec.track is not None:
        active = [*active, *TRACKS[spec.track].parts(episode_level(spec, episode))]
    return [(perturbation, level, episode.stream(perturbation.stream)) for perturbation, level in active]


def episode_level(spec: TaskSpec, episode: Episode) -> int:
    """Returns the level of the track at which `episode` is played."""
    if len(spec.level) == 1:
        return spec.level[0]
    return spec.level[int(episode.stream(_LEVEL_STREAM).integers(len(spec.level)))]


def time_limit(spec: TaskSpec, episode: Episode) -> int:
    """Returns the agent steps that each leg of `episode` may take."""
    if spec.track is None:
        return spec.time_limit
    distance = spec.mazes[episode.maze].distance(episode.start, episode.goal)
    return TRACKS[spec.track].time_limit(episode_level(spec, episode), distance)
