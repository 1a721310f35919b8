"""The trajectories of an evaluation on disk: where the body was, what the agent was shown, where it was sent.

`trajectories.npz` holds all episodes in the order of `episodes.jsonl`, and is written whole or not at all. Until then
they wait in `trajectories.journal`, each in a block with a checksum, so that a kill costs at most the last block.

`E` is the number of episodes, `N` the cells a side of the mazes, `L` the poses of an episode, its steps and the start.
"""

from __future__ import annotations

import dataclasses
import functools
import io
import math
import os
import pathlib
import struct
import tokenize
import zipfile
import zlib

import numpy as np

from mazebench.errors import InputError

TRAJECTORIES = "trajectories.npz"
JOURNAL = "trajectories.journal"
FORMAT = "mazebench-trajectories-1"

_MAX_BYTES = 2**30  # of all arrays together; the 1,500 local episodes of a benchmark's size take at most 1 MB
_DTYPES: dict[str, np.dtype] = {
    "length": np.dtype("<i4"),
    "pose": np.dtype("<f2"),
    "shown": np.dtype("u1"),
    "num_landmarks": np.dtype("<i4"),
    "landmark": np.dtype("<i4"),
}
_MAX_HEADER = 10_000  # bytes that describe an array
# What zipfile, zlib and NumPy's header reader raise for content that is damaged or made up.
_DAMAGE = (
    *(zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError, EOFError, SyntaxError),
    *(ValueError, KeyError, RuntimeError, OverflowError, UnicodeError),
)
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
    try:
        arrays = _read_arrays(path)
    except OSError as error:
        raise InputError(f"{path}: can't read the trajectories: {error.strerror or error}") from error
    except _DAMAGE as error:
        found = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"{path}: expected trajectories ({FORMAT}), found a damaged file: {found}") from error
    trajectories = Trajectories(**arrays)
    fault = _fault(trajectories, num_episodes)
    if fault:
        raise InputError(f"{path}: {fault}")
    return trajectories


def save_trajectories(path: pathlib.Path, trajectories: Trajectories) -> None:
    """Writes them all or nothing: a reader finds the old file or the new one. The same content gives the same bytes."""
    temporary = path.with_name(path.name + ".tmp")
    arrays = {name: np.ascontiguousarray(getattr(trajectories, name), dtype=dtype) for name, dtype in _DTYPES.items()}
    with temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, format=np.array(FORMAT), **arrays)
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)


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

    def __init__(self, folder: pathlib.Path, num_episodes: int):
        """Reads what is there; a block of the journal that is not whole is cut off, with all behind it.

        Raises:
          InputError: if the folder's trajectories are damaged or of other episodes.
        """
        self._folder, self._num_episodes = folder, num_episodes
        self._episodes: dict[int, Trajectory] = {}
        if (folder / TRAJECTORIES).exists():
            whole = load_trajectories(folder / TRAJECTORIES, num_episodes)
            self._episodes = {index: whole[index] for index in range(num_episodes)}
        self._episodes |= {
            index: episode for index, episode in _repair_and_read(folder / JOURNAL).items() if index < num_episodes
        }
        self._journal = open(folder / JOURNAL, "ab")  # noqa: SIM115 (closed by __exit__)

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
        self._journal.close()


def _read_arrays(path: pathlib.Path) -> dict[str, np.ndarray]:
    with zipfile.ZipFile(path) as archive:
        sizes = {member.filename: member.file_size for member in archive.infolist()}
        if sum(sizes.values()) > _MAX_BYTES:
            raise ValueError(f"{sum(sizes.values())} bytes of content, more than {_MAX_BYTES}")
        content = {name: archive.read(f"{name}.npy") for name in ("format", *_DTYPES)}
    if str(_to_array(content.pop("format"), None)) != FORMAT:
        raise ValueError("another format")
    return {name: _to_array(content[name], dtype) for name, dtype in _DTYPES.items()}


def _to_array(content: bytes, dtype: np.dtype | None) -> np.ndarray:
    """An array in NumPy's file format; `dtype` None for a short text."""
    file = io.BytesIO(content)
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError("an array of another version of NumPy's format")
    shape, is_fortran, found = np.lib.format.read_array_header_1_0(file, max_header_size=_MAX_HEADER)
    if is_fortran or (found != dtype if dtype is not None else found.kind != "U"):
        raise ValueError(f"an array of {found}")
    num_bytes = math.prod(shape) * found.itemsize
    if min(shape, default=1) < 0 or len(content) - file.tell() != num_bytes:
        raise ValueError(f"{len(content) - file.tell()} bytes for an array of shape {shape}")
    return np.frombuffer(content, found, offset=file.tell()).reshape(shape) if num_bytes else np.empty(shape, found)


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


def _repair_and_read(path: pathlib.Path) -> dict[int, Trajectory]:
    """The episodes of a journal by index; what follows its last whole block is removed from it."""
    if not path.exists():
        return {}
    content, episodes, start = path.read_bytes(), {}, 0
    while start + _BLOCK.size <= len(content):
        *counts, checksum = _BLOCK.unpack_from(content, start)
        index, num_poses, num_map_bytes, num_landmarks = counts
        end = start + _BLOCK.size + 6 * num_poses + num_map_bytes + 4 * num_landmarks
        body = content[start + _BLOCK.size : end]
        if end > len(content) or zlib.crc32(body, zlib.crc32(_BLOCK.pack(*counts, 0))) != checksum:
            break
        episodes[index] = _from_body(body, num_poses, num_map_bytes)
        start = end
    if start < len(content):
        os.truncate(path, start)
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
