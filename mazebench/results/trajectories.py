"""The trajectories of an evaluation on disk: where the body was in each episode.

`trajectories.npz` holds all episodes in the order of `episodes.jsonl`. What the agents were shown follows from the task
(`results/played.py`).

`L` is the number of poses of an episode: its steps and the start.
"""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mazebench.errors import InputError
from mazebench.storage.array_files import read_arrays
from mazebench.storage.files import open_whole

TRAJECTORIES = "trajectories.npz"


class Trajectory(NamedTuple):
    """One episode."""

    pose: np.ndarray  # [L, 3] float32: true x, y in metres in the maze's frame, yaw in rad
    observed: np.ndarray | None = None  # [L, 3] float32: the observed pose, on tracks where it is not the true one


def load_trajectories(path: pathlib.Path) -> list[Trajectory]:
    """Returns the trajectories of an evaluation."""
    arrays = read_arrays(path, "file of trajectories")
    try:
        ends = np.cumsum(arrays["length"])[:-1]
        pose = np.split(arrays["pose"], ends)
        observed = np.split(arrays["observed"], ends) if "observed" in arrays else [None] * len(pose)
        return [Trajectory(*episode) for episode in zip(pose, observed, strict=True)]
    except (KeyError, ValueError) as error:
        raise InputError(f"{path}: expected trajectories, found a damaged file: {error}") from error


def save_trajectories(path: pathlib.Path, episodes: Sequence[Trajectory]) -> None:
    """Writes them all or nothing: a reader finds the old file or the new one. The same content gives the same bytes."""
    arrays = {
        "length": np.array([len(episode.pose) for episode in episodes], dtype="<i4"),
        "pose": np.concatenate([episode.pose for episode in episodes], dtype="<f4"),
    }
    observed = [episode.observed for episode in episodes if episode.observed is not None]
    if observed:
        arrays["observed"] = np.concatenate(observed, dtype="<f4")
    with open_whole(path) as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)
