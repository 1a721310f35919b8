"""The trajectories of an evaluation: where the body was, what the agent was shown, where it was sent.

`trajectories.npz` holds all episodes in the order of `episodes.jsonl`.

`E` is the number of episodes, `N` the cells a side of the mazes, `L` the poses of an episode, its steps and the start.
"""

from __future__ import annotations

import base64
import dataclasses
import functools
import math
import pathlib
from typing import Any

import numpy as np

from mazebench.errors import InputError
from mazebench.storage.arrays import read_arrays
from mazebench.storage.files import open_file, open_whole
from mazebench.tasks.episode import Episode
from mazebench.tasks.route import plan_route
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.spec import TaskSpec

TRAJECTORIES = "trajectories.npz"
FORMAT = "mazebench-trajectories-1"

_MAX_BYTES = 2**28  # of all arrays together; the 1,500 local episodes of a benchmark's size take at most 1 MB
_DTYPES: dict[str, np.dtype] = {
    "length": np.dtype("<i4"),
    "pose": np.dtype("<f2"),
    "shown": np.dtype("u1"),
    "num_landmarks": np.dtype("<i4"),
    "landmark": np.dtype("<i4"),
}
_NUM_POSES = 128  # room for a local episode; more is made where it is needed


@dataclasses.dataclass(frozen=True)
class Trajectory:
    """One episode."""

    pose: np.ndarray  # [L, 3] float16: x, y in metres in the maze's frame, yaw in rad, as they truly were
    shown: np.ndarray  # [N, N] bool, the walls as the agent was shown them
    landmarks: np.ndarray  # [K] int32, cells of the world as row * N + column, in order, the goal last


@dataclasses.dataclass(frozen=True)
class Trajectories:
    """All episodes of an evaluation; `trajectories[i]` is the one of record i."""

    length: np.ndarray  # [E] int32, L of each
    pose: np.ndarray  # [sum(length), 3] float16
    shown: np.ndarray  # [E, ceil(N * N / 8)] uint8, maps row by row as np.packbits packs them
    num_landmarks: np.ndarray  # [E] int32
    landmark: np.ndarray  # [sum(num_landmarks)] int32

    def __len__(self) -> int:
        return len(self.length)

    def __getitem__(self, episode: int) -> Trajectory:
        poses, landmarks = self._pose_bounds, self._landmark_bounds
        return Trajectory(
            self.pose[poses[episode] : poses[episode + 1]],
            _unpack(self.shown[episode], self.size),
            self.landmark[landmarks[episode] : landmarks[episode + 1]],
        )

    @property
    def size(self) -> int:
        """N: from 5 cells a side on, no two sizes take the same number of bytes."""
        return math.isqrt(8 * self.shown.shape[1])

    @functools.cached_property
    def _pose_bounds(self) -> np.ndarray:
        return _bounds(self.length)

    @functools.cached_property
    def _landmark_bounds(self) -> np.ndarray:
        return _bounds(self.num_landmarks)


def load_trajectories(path: pathlib.Path, num_episodes: int) -> Trajectories:
    """Returns the trajectories of an evaluation of `num_episodes` episodes.

    Raises:
      InputError: if the file can't be read, is damaged, too large or of other episodes.
    """
    with open_file(path, "trajectories") as file:
        try:
            arrays = read_arrays(file, {"format": None, **_DTYPES}, _MAX_BYTES)
            if str(arrays.pop("format")) != FORMAT:
                raise ValueError("another format")
        except ValueError as error:
            raise InputError(f"{path}: expected trajectories ({FORMAT}), found a damaged file: {error}") from error
    trajectories = Trajectories(**arrays)
    fault = _fault(trajectories, num_episodes)
    if fault:
        raise InputError(f"{path}: {fault}")
    return trajectories


def save_trajectories(path: pathlib.Path, trajectories: Trajectories) -> None:
    """Writes them all or nothing: a reader finds the old file or the new one. The same content gives the same bytes."""
    arrays = {name: np.ascontiguousarray(getattr(trajectories, name), dtype=dtype) for name, dtype in _DTYPES.items()}
    with open_whole(path) as file:
        np.savez_compressed(file, allow_pickle=False, format=np.array(FORMAT), **arrays)


def pack_trajectories(episodes: list[Trajectory]) -> Trajectories:
    """Returns the trajectories of at least one episode, all in mazes of one size, in their order."""
    return Trajectories(
        length=np.array([len(episode.pose) for episode in episodes], dtype=np.int32),
        pose=np.concatenate([episode.pose for episode in episodes]).astype(np.float16, copy=False),
        shown=np.stack([np.packbits(episode.shown) for episode in episodes]),
        num_landmarks=np.array([len(episode.landmarks) for episode in episodes], dtype=np.int32),
        landmark=np.concatenate([episode.landmarks for episode in episodes]).astype(np.int32, copy=False),
    )


class PoseRecorder:
    """The poses in each of B environments since its episode began."""

    def __init__(self, num_envs: int):
        self._pose = np.empty((num_envs, _NUM_POSES, 3), dtype=np.float16)
        self._count = np.zeros(num_envs, dtype=np.int64)

    def add(self, position: np.ndarray, yaw: np.ndarray, active: np.ndarray) -> None:
        """Notes true positions `[B, 2]` (m) and yaws `[B]` (rad) of the environments that are `active` `[B]`."""
        if self._count.max() == self._pose.shape[1]:
            self._pose = np.concatenate([self._pose, np.empty_like(self._pose)], axis=1)
        slots = np.arange(len(position))
        self._pose[slots, self._count, :2] = position
        self._pose[slots, self._count, 2] = yaw
        self._count += active

    def take(self, slot: int, position: np.ndarray, yaw: float, task: TaskSpec, episode: Episode) -> Trajectory:
        """Returns the trajectory of the episode that ended in `slot` in this pose, and forgets its poses."""
        last = np.array([[*position, yaw]], dtype=np.float16)
        pose = np.concatenate([self._pose[slot, : self._count[slot]], last])
        self._count[slot] = 0
        shown = show_map(task, episode)
        cells = plan_route(task, episode, shown).cells[1:]
        landmarks = np.array([row * task.size + column for row, column in cells], dtype=np.int32)
        return Trajectory(pose, shown.seen_walls(), landmarks)


def to_json(trajectory: Trajectory) -> dict[str, Any]:
    """Returns a trajectory as plain values, little-endian whatever the machine."""
    return {
        "pose": base64.b64encode(trajectory.pose.astype(_DTYPES["pose"]).tobytes()).decode("ascii"),
        "shown": base64.b64encode(np.packbits(trajectory.shown).tobytes()).decode("ascii"),
        "landmarks": trajectory.landmarks.tolist(),
    }


def from_json(content: dict[str, Any], size: int) -> Trajectory:
    """Returns the trajectory that `to_json` made, in a maze of `size` cells a side.

    Raises:
      ValueError: if it is none.
    """
    try:
        pose = np.frombuffer(base64.b64decode(content["pose"]), _DTYPES["pose"]).reshape(-1, 3)
        shown = _unpack(np.frombuffer(base64.b64decode(content["shown"]), np.uint8), size)
        trajectory = Trajectory(pose, shown, np.array(content["landmarks"], dtype=_DTYPES["landmark"]))
    except (KeyError, TypeError, OverflowError) as error:
        raise ValueError(f"no trajectory: {error}") from error
    fault = _fault(pack_trajectories([trajectory]), 1)
    if fault:
        raise ValueError(fault)
    return trajectory


def _fault(trajectories: Trajectories, num_episodes: int) -> str | None:
    """Returns what is wrong with them, in words; None if nothing is."""
    length, num_landmarks = trajectories.length, trajectories.num_landmarks
    if length.shape != (num_episodes,) or num_landmarks.shape != (num_episodes,):
        found = length.shape[0] if length.ndim == 1 else length.shape
        return f"expected trajectories of {num_episodes} episodes, found {found}"
    if num_episodes == 0 or min(length.min(), num_landmarks.min()) < 1:
        return "expected a pose and a goal in every episode, found an episode without"
    for name, width, expected in (("pose", (3,), length), ("landmark", (), num_landmarks)):
        shape = (int(expected.sum(dtype=np.int64)), *width)
        if getattr(trajectories, name).shape != shape:
            return f"expected {name} of shape {shape}, found {getattr(trajectories, name).shape}"
    shown = trajectories.shown
    size = trajectories.size if shown.ndim == 2 else 0
    if shown.shape != (num_episodes, -(-size * size // 8)):
        return f"expected {num_episodes} maps of N x N cells, found shape {shown.shape}"
    if trajectories.landmark.min() < 0 or trajectories.landmark.max() >= size * size:
        return f"expected landmarks from 0 to {size * size - 1}, found others"
    if not np.isfinite(trajectories.pose).all():
        return "expected finite poses, found others"
    return None


def _unpack(packed: np.ndarray, size: int) -> np.ndarray:
    return np.unpackbits(packed, count=size * size).reshape(size, size).astype(bool)


def _bounds(counts: np.ndarray) -> np.ndarray:
    """Returns `[E + 1]`: the indices where each episode's entries begin, and where the last one's end."""
    return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
