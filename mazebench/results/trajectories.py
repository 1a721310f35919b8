"""The trajectories of an evaluation: where the body was, what the agent was shown, where it was sent.

`trajectories.npz` holds all episodes in the order of `episodes.jsonl`.

`E` is the number of episodes, `N` the cells a side of the mazes, `M` the pixels a side of the maps that the agent is
given, `L` the poses of an episode, its steps and the start.
"""

from __future__ import annotations

import base64
import dataclasses
import functools
import math
import pathlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mazebench.errors import InputError
from mazebench.storage.arrays import unpack_arrays
from mazebench.storage.files import open_file, open_whole

TRAJECTORIES = "trajectories.npz"
FORMAT = "mazebench-trajectories-1"

_DTYPES: dict[str, np.dtype] = {
    "length": np.dtype("<i4"),
    "pose": np.dtype("<f2"),
    "shown": np.dtype("u1"),
    "num_landmarks": np.dtype("<i4"),
    "landmark": np.dtype("<i4"),
}
# In results of tracks.
_OPTIONAL_DTYPES: dict[str, np.dtype] = {
    "marks": np.dtype("<i4"),
    "picture": np.dtype("u1"),
    "observed": np.dtype("<f2"),
}


@dataclasses.dataclass(frozen=True)
class Trajectory:
    """One episode."""

    pose: np.ndarray  # [L, 3] float16: x, y in metres in the maze's frame, yaw in rad, as they truly were
    shown: np.ndarray  # [N, N] bool, the walls as the agent was shown them
    landmarks: np.ndarray  # [K] int32, cells of the world as row * N + column, in order, the goal last
    # Of tracks only, None elsewhere.
    marks: np.ndarray | None = None  # [2] int32, the marked start and goal as row * M + column; -1: not marked
    # [M, M] uint8, the map that the agent was given, where its pixels are not the cells that are shown; 255 is wall.
    picture: np.ndarray | None = None
    observed: np.ndarray | None = None  # [L, 3] float16: the observed pose, where it is not the true one by design


@dataclasses.dataclass(frozen=True)
class Trajectories:
    """All episodes of an evaluation; `trajectories[i]` is the one of record i."""

    length: np.ndarray  # [E] int32, L of each
    pose: np.ndarray  # [sum(length), 3] float16
    shown: np.ndarray  # [E, ceil(N * N / 8)] uint8, maps row by row as np.packbits packs them
    num_landmarks: np.ndarray  # [E] int32
    landmark: np.ndarray  # [sum(num_landmarks)] int32
    marks: np.ndarray | None = None  # [E, 2] int32
    picture: np.ndarray | None = None  # [E, M, M] uint8
    observed: np.ndarray | None = None  # [sum(length), 3] float16

    def __len__(self) -> int:
        return len(self.length)

    def __getitem__(self, episode: int) -> Trajectory:
        steps = slice(*self._pose_bounds[episode : episode + 2])
        landmarks = slice(*self._landmark_bounds[episode : episode + 2])
        return Trajectory(
            pose=self.pose[steps],
            shown=_unpack(self.shown[episode], self.size),
            landmarks=self.landmark[landmarks],
            marks=None if self.marks is None else self.marks[episode],
            picture=None if self.picture is None else self.picture[episode],
            observed=None if self.observed is None else self.observed[steps],
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
      InputError: if the file can't be read, is damaged, of another format or of other episodes.
    """
    with open_file(path, "trajectories") as file:
        try:
            trajectories = Trajectories(**_known_arrays(unpack_arrays(file)))
        except ValueError as error:
            raise InputError(f"{path}: expected trajectories ({FORMAT}), found a damaged file: {error}") from error
    fault = _fault(trajectories, num_episodes)
    if fault:
        raise InputError(f"{path}: {fault}")
    return trajectories


def _known_arrays(arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Returns the fields of `Trajectories` in a file's arrays.

    Raises:
      ValueError: if one is missing or of another type, or the file has another format.
    """
    if str(arrays.get("format")) != FORMAT:
        raise ValueError("another format")
    dtypes = _DTYPES | {name: dtype for name, dtype in _OPTIONAL_DTYPES.items() if name in arrays}
    for name, dtype in dtypes.items():
        if name not in arrays:
            raise ValueError(f"no {name}")
        if arrays[name].dtype != dtype:
            raise ValueError(f"{name} of type {arrays[name].dtype}, not {dtype}")
    return {name: arrays[name] for name in dtypes}


def save_trajectories(path: pathlib.Path, trajectories: Trajectories) -> None:
    """Writes them all or nothing: a reader finds the old file or the new one. The same content gives the same bytes."""
    arrays = {
        name: np.ascontiguousarray(values, dtype=dtype)
        for name, dtype in (_DTYPES | _OPTIONAL_DTYPES).items()
        if (values := getattr(trajectories, name)) is not None
    }
    with open_whole(path) as file:
        np.savez_compressed(file, allow_pickle=False, format=np.array(FORMAT), **arrays)


def pack_trajectories(episodes: list[Trajectory]) -> Trajectories:
    """Returns the trajectories of at least one episode, all of one task and in mazes of one size, in their order."""
    return Trajectories(
        length=np.array([len(episode.pose) for episode in episodes], dtype=np.int32),
        pose=np.concatenate([episode.pose for episode in episodes]).astype(np.float16, copy=False),
        shown=np.stack([np.packbits(episode.shown) for episode in episodes]),
        num_landmarks=np.array([len(episode.landmarks) for episode in episodes], dtype=np.int32),
        landmark=np.concatenate([episode.landmarks for episode in episodes]).astype(np.int32, copy=False),
        marks=_join_present(np.stack, [episode.marks for episode in episodes]),
        picture=_join_present(np.stack, [episode.picture for episode in episodes]),
        observed=_join_present(np.concatenate, [episode.observed for episode in episodes]),
    )


def to_json(trajectory: Trajectory) -> dict[str, Any]:
    """Returns a trajectory as plain values, little-endian whatever the machine."""
    content = {
        "pose": _to_base64(trajectory.pose, _DTYPES["pose"]),
        "shown": _to_base64(np.packbits(trajectory.shown), _DTYPES["shown"]),
        "landmarks": trajectory.landmarks.tolist(),
    }
    for name, dtype in _OPTIONAL_DTYPES.items():
        values = getattr(trajectory, name)
        if values is not None:
            content[name] = _to_base64(values, dtype)
    return content


def from_json(content: dict[str, Any], size: int) -> Trajectory:
    """Returns the trajectory that `to_json` made, in a maze of `size` cells a side.

    Raises:
      ValueError: if it is none.
    """
    try:
        pose = _from_base64(content["pose"], _DTYPES["pose"]).reshape(-1, 3)
        shown = _unpack(_from_base64(content["shown"], _DTYPES["shown"]), size)
        landmarks = np.array(content["landmarks"], dtype=_DTYPES["landmark"])
        optional = {
            name: _from_base64(content[name], dtype) for name, dtype in _OPTIONAL_DTYPES.items() if name in content
        }
    except (KeyError, TypeError, OverflowError) as error:
        raise ValueError(f"no trajectory: {error}") from error
    if "picture" in optional:
        side = math.isqrt(len(optional["picture"]))
        optional["picture"] = optional["picture"].reshape(side, side)
    if "observed" in optional:
        optional["observed"] = optional["observed"].reshape(-1, 3)
    trajectory = Trajectory(pose=pose, shown=shown, landmarks=landmarks, **optional)
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
    return _fault_of_optional(trajectories)


def _fault_of_optional(trajectories: Trajectories) -> str | None:
    """Returns what is wrong with the arrays that only tracks have, in words; None if nothing is."""
    num_episodes, pose = len(trajectories), trajectories.pose
    marks, picture, observed = trajectories.marks, trajectories.picture, trajectories.observed
    side = trajectories.size if picture is None else picture.shape[-1]
    if picture is not None and picture.shape != (num_episodes, side, side):
        return f"expected {num_episodes} pictures of M x M pixels, found shape {picture.shape}"
    if marks is not None and marks.shape != (num_episodes, 2):
        return f"expected marks of shape {(num_episodes, 2)}, found {marks.shape}"
    if marks is not None and (marks.min() < -1 or marks.max() >= side * side):
        return f"expected marks from -1 to {side * side - 1}, found others"
    if observed is not None and (observed.shape != pose.shape or not np.isfinite(observed).all()):
        return f"expected {len(pose)} finite observed poses, found others"
    return None


def _join_present(
    join: Callable[[Sequence[np.ndarray]], np.ndarray], arrays: Sequence[np.ndarray | None]
) -> np.ndarray | None:
    """Returns the arrays in one; None if there are none."""
    present = [array for array in arrays if array is not None]
    return join(present) if present else None


def _to_base64(values: np.ndarray, dtype: np.dtype) -> str:
    return base64.b64encode(values.astype(dtype).tobytes()).decode("ascii")


def _from_base64(text: str, dtype: np.dtype) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype)


def _unpack(packed: np.ndarray, size: int) -> np.ndarray:
    return np.unpackbits(packed, count=size * size).reshape(size, size).astype(bool)


def _bounds(counts: np.ndarray) -> np.ndarray:
    """Returns `[E + 1]`: the indices where each episode's entries begin, and where the last one's end."""
    return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
