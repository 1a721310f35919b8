"""The trajectories of an evaluation on disk: where the body was, what the agent was shown, where it was sent.

`trajectories.npz` holds all episodes in the order of `episodes.jsonl`, and is written whole or not at all. Until then
they wait in `trajectories.journal`, each in a block with a checksum, so that a kill costs at most the last block.

`E` is the number of episodes, `N` the cells a side of the mazes, `L` the poses of an episode, its steps and the start.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
import pathlib
import struct
import zlib

import numpy as np

from mazebench.arrays import read_arrays
from mazebench.errors import InputError
from mazebench.files import open_file, open_to_write, open_whole, read_at_most

TRAJECTORIES = "trajectories.npz"
JOURNAL = "trajectories.journal"
FORMAT = "mazebench-trajectories-1"

_MAX_BYTES = 2**28  # of all arrays together; the 1,500 local episodes of a benchmark's size take at most 1 MB
_DTYPES: dict[str, np.dtype] = {
    "length": np.dtype("<i4"),
    "pose": np.dtype("<f2"),
    "shown": np.dtype("u1"),
    "num_landmarks": np.dtype("<i4"),
    "landmark": np.dtype("<i4"),
}
_BLOCK = struct.Struct("<IIIII")  # episode, L, bytes of the map, landmarks, CRC-32 of the rest of the block


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
    """The trajectories of an evaluation of `num_episodes` episodes.

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
    """The episodes in one value, in their order; at least one, all of mazes of one size."""
    return Trajectories(
        length=np.array([len(episode.pose) for episode in episodes], dtype=np.int32),
        pose=np.concatenate([episode.pose for episode in episodes]).astype(np.float16, copy=False),
        shown=np.stack([np.packbits(episode.shown) for episode in episodes]),
        num_landmarks=np.array([len(episode.landmarks) for episode in episodes], dtype=np.int32),
        landmark=np.concatenate([episode.landmarks for episode in episodes]).astype(np.int32, copy=False),
    )


class TrajectoryLog:
    """The trajectories of `num_episodes` episodes in `folder`, those already there included; a context manager."""

    def __init__(self, folder: pathlib.Path, num_episodes: int, size: int):
        """Reads what is there, of mazes of `size` cells a side.

        A block of the journal that is not whole is cut off, with all behind it.

        Raises:
          InputError: if the folder's trajectories are damaged or of other episodes.
        """
        self._folder, self._num_episodes = folder, num_episodes
        self._episodes: dict[int, Trajectory] = {}
        if (folder / TRAJECTORIES).exists():
            whole = load_trajectories(folder / TRAJECTORIES, num_episodes)
            if whole.size != size:
                raise InputError(f"{folder / TRAJECTORIES}: expected maps of {size} cells a side, found {whole.size}")
            self._episodes = {index: whole[index] for index in range(num_episodes)}
        waiting = _repair_and_read(folder / JOURNAL, size)
        self._episodes |= {index: episode for index, episode in waiting.items() if index < num_episodes}
        self._journal = open_to_write(folder / JOURNAL, "ab")  # closed by __exit__

    @property
    def missing(self) -> list[int]:
        """The indices of the episodes that have no trajectory yet."""
        return [index for index in range(self._num_episodes) if index not in self._episodes]

    def add(self, episodes: dict[int, Trajectory]) -> None:
        """Stores the trajectories of episodes that just ended, by their indices; before their records are."""
        for index, episode in episodes.items():
            self._episodes[index] = episode
            self._journal.write(_to_block(index, episode))
        self._journal.flush()

    def finish(self) -> None:
        """Writes all trajectories in order and removes the journal; none may be missing."""
        episodes = [self._episodes[index] for index in range(self._num_episodes)]
        save_trajectories(self._folder / TRAJECTORIES, pack_trajectories(episodes))
        self._journal.close()
        (self._folder / JOURNAL).unlink()

    def __enter__(self) -> TrajectoryLog:
        return self

    def __exit__(self, *exception: object) -> None:
        with contextlib.suppress(OSError):  # what could not be written was told before
            self._journal.close()


def _fault(trajectories: Trajectories, num_episodes: int) -> str | None:
    """What is wrong, in words."""
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


def _to_block(index: int, episode: Trajectory) -> bytes:
    """Little-endian whatever the machine, as the journal may be resumed on another."""
    pose = episode.pose.astype(_DTYPES["pose"]).tobytes()
    shown = np.packbits(episode.shown).tobytes()
    landmarks = episode.landmarks.astype(_DTYPES["landmark"]).tobytes()
    body = pose + shown + landmarks
    counts = (index, len(episode.pose), len(shown), len(episode.landmarks))
    return _BLOCK.pack(*counts, zlib.crc32(body, zlib.crc32(_BLOCK.pack(*counts, 0)))) + body


def _repair_and_read(path: pathlib.Path, size: int) -> dict[int, Trajectory]:
    """The episodes of a journal by index; what follows its last whole block is removed from it.

    Raises:
      InputError: if a whole block holds no trajectory in a maze of `size` cells a side.
    """
    if not path.exists():
        return {}
    content = read_at_most(path, _MAX_BYTES, "trajectories")
    if len(content) > _MAX_BYTES:
        raise InputError(f"{path}: expected at most {_MAX_BYTES} bytes, found more")
    episodes, start = {}, 0
    while start + _BLOCK.size <= len(content):
        *counts, checksum = _BLOCK.unpack_from(content, start)
        index, num_poses, num_map_bytes, num_landmarks = counts
        end = start + _BLOCK.size + 6 * num_poses + num_map_bytes + 4 * num_landmarks
        body = content[start + _BLOCK.size : end]
        if end > len(content) or zlib.crc32(body, zlib.crc32(_BLOCK.pack(*counts, 0))) != checksum:
            break
        if num_map_bytes != -(-size * size // 8) or min(num_poses, num_landmarks) < 1:
            raise InputError(f"{path}: expected a pose, a goal and a map of {size} cells a side, found episode {index}")
        episodes[index] = _from_body(body, num_poses, num_map_bytes)
        fault = _fault(pack_trajectories([episodes[index]]), 1)
        if fault:
            raise InputError(f"{path}: episode {index}: {fault}")
        start = end
    if start < len(content):
        with open_to_write(path, "r+b") as file:
            file.truncate(start)
    return episodes


def _from_body(body: bytes, num_poses: int, num_map_bytes: int) -> Trajectory:
    packed = np.frombuffer(body, np.uint8, num_map_bytes, 6 * num_poses)
    return Trajectory(
        np.frombuffer(body, _DTYPES["pose"], 3 * num_poses).reshape(-1, 3),
        _unpack(packed, math.isqrt(8 * num_map_bytes)),
        np.frombuffer(body, _DTYPES["landmark"], offset=6 * num_poses + num_map_bytes),
    )


def _unpack(packed: np.ndarray, size: int) -> np.ndarray:
    return np.unpackbits(packed, count=size * size).reshape(size, size).astype(bool)


def _bounds(counts: np.ndarray) -> np.ndarray:
    """`[E + 1]`: where each episode's entries begin, and where the last one's end."""
    return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
