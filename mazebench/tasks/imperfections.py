"""The imperfections of an episode: the perturbations that are switched on, or the track at its level."""

from __future__ import annotations

import numpy as np

from mazebench.tasks.episode import Episode
from mazebench.tasks.perturbations import PERTURBATIONS
from mazebench.tasks.perturbations.perturbation import Perturbation
from mazebench.tasks.streams import Stream
from mazebench.tasks.task import Task
from mazebench.tasks.tracks import TRACKS


def imperfections(spec: Task, episode: Episode) -> list[tuple[Perturbation, float, np.random.Generator]]:
    """Returns what is wrong in `episode`, in the order in which it applies, each with its level and random stream."""
    active = [(PERTURBATIONS[name], level) for name, level in spec.active_perturbations]
    if spec.track is not None:
        active = [*active, *TRACKS[spec.track].parts(episode_level(spec, episode))]
    return [(perturbation, level, episode.stream(perturbation.stream)) for perturbation, level in active]


def episode_level(spec: Task, episode: Episode) -> int:
    """Returns the level of the track at which `episode` is played."""
    if len(spec.level) == 1:
        return spec.level[0]
    return spec.level[int(episode.stream(Stream.LEVEL).integers(len(spec.level)))]
