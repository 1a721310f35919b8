"""An episode as a film or a picture: from above, through the agent's eyes, and on the map it was shown."""

from __future__ import annotations

import dataclasses
import pathlib
import struct
import tempfile
from collections.abc import Callable

import cv2
import numpy as np

from mazebench.agent import load_agent_class
from mazebench.errors import InputError, unknown
from mazebench.evaluation.options import EvalOptions, build_agent, is_frozen, make_task_spec, resolve_checkpoint
from mazebench.evaluation.protocol import select_trials
from mazebench.files import open_whole, writing_to
from mazebench.maps import perturb
from mazebench.maps.image import draw_grid, write_image
from mazebench.tasks.navigation import Environment
from mazebench.tasks.spec import TaskSpec
from mazebench.world.rendering import CAMERAS, Renderer

MAP = "map"
_FRAMES_PER_SECOND = 1 / 0.16  # one an agent step: the film runs in real time


def film_episode(options: EvalOptions, out: pathlib.Path, view: str, pixels: int) -> str:
    """Runs one episode of the protocol, the one that `options.seed` counts to, and writes it to `out`.

    Args:
      options: who drives where, as for an evaluation.
      out: an .mp4 or .gif of the episode, or a .png of its last moment, with the whole path on the map.
      view: a camera, "map", or "all" for all of them side by side.
      pixels: side of a view.

    Returns:
      What came of the episode, in words.

    Raises:
      InputError: if a name is unknown or `out` can't be written.
      RenderingError: if this machine can't render.
    """
    views = (MAP, *CAMERAS) if view == "all" else (view,)
    if views[0] not in (MAP, *CAMERAS):
        raise unknown("view", view, (MAP, *CAMERAS, "all"))
    if out.suffix not in _WRITERS:
        raise unknown("suffix", out.suffix, _WRITERS)
    frames, outcome = _run(options, views, pixels)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        _WRITERS[out.suffix](frames, out)
    except OSError as error:
        raise InputError(f"{out}: can't write: {error.strerror}") from error
    return outcome


def _run(options: EvalOptions, views: tuple[str, ...], pixels: int) -> tuple[list[np.ndarray], str]:
    agent_class = load_agent_class(options.agent)
    options = resolve_checkpoint(options, agent_class)
    task_spec = make_task_spec(options, agent_class)
    trials = select_trials(options.task, task_spec.mazes, is_frozen(options), options.distances)
    trial = trials[options.seed % len(trials)]
    agent = build_agent(options, agent_class, task_spec)
    environment = Environment(task_spec)
    time_step = environment.reset(episode=trial.episode)
    state = agent.initial_state(1)
    scene = _Scene(environment, task_spec, views, pixels)
    try:
        frames = [scene.draw()]
        while not time_step.last():
            observation = {key: time_step.observation[key][None] for key in ("state", "context")}
            is_first = np.array([environment.task.is_first])
            if is_first[0]:
                agent.seed_episodes(np.array([trial.episode.seed]), np.array([time_step.first()]))
            actions, state = agent.act(observation, is_first, state)
            time_step = environment.step(int(actions[0]))
            frames.append(scene.draw())
    finally:
        scene.close()
    task = environment.task
    ending = "reached the goal" if task.success else "ran out of time"
    maze = task_spec.mazes[trial.episode.maze].name
    return frames, (
        f"{options.agent} {ending} after {task.steps} steps and {task.path_length:.2f} m "
        f"(shortest {trial.shortest_path:.2f} m) in maze {maze}, from {trial.episode.start} to {trial.episode.goal}"
    )


@dataclasses.dataclass
class _Scene:
    """The views of a running episode, side by side in one picture."""

    environment: Environment
    task_spec: TaskSpec
    views: tuple[str, ...]
    pixels: int

    def __post_init__(self) -> None:
        self._path: list[np.ndarray] = []
        cameras = [view for view in self.views if view != MAP]
        self._renderer = Renderer(self.environment.physics.model.ptr, self.pixels, self.pixels) if cameras else None

    def draw(self) -> np.ndarray:
        """`[H, W, 3]` uint8 of the state now; the map, as the agent is shown it, has the path driven up to now."""
        self._path.append(self.environment.physics.position())
        return np.concatenate([self._view(view) for view in self.views], axis=1)

    def close(self) -> None:
        if self._renderer is not None:
            self._renderer.close()

    def _view(self, view: str) -> np.ndarray:
        if view != MAP:
            assert self._renderer is not None
            return self._renderer.render(self.environment.physics.data.ptr, view)
        task, size = self.environment.task, self.task_spec.size
        start, goal, path = task.episode.start, task.episode.goal, np.array(self._path)
        homography = task.shown_map.homography
        if homography is not None:
            start, goal = (perturb.warp_cell(cell, homography, size) for cell in (start, goal))
            path = perturb.warp_points(path, homography, size)
        picture = draw_grid(task.shown_map.seen_walls(), 2 * self.pixels // size + 1, start, goal, path)
        return cv2.resize(picture, (self.pixels, self.pixels), interpolation=cv2.INTER_AREA)


def _write_png(frames: list[np.ndarray], out: pathlib.Path) -> None:
    write_image(frames[-1], out)


def _write_gif(frames: list[np.ndarray], out: pathlib.Path) -> None:
    animation = cv2.Animation()
    animation.frames = [cv2.cvtColor(frame, cv2.COLOR_RGB2BGRA) for frame in frames]
    animation.durations = [round(1000 / _FRAMES_PER_SECOND)] * len(frames)
    done, content = cv2.imencodeanimation(".gif", animation)
    if not done:
        raise InputError(f"{out}: this OpenCV can't write GIF")
    with writing_to(out), open_whole(out) as file:
        file.write(content.tobytes())


def _write_mp4(frames: list[np.ndarray], out: pathlib.Path) -> None:
    height, width = frames[0].shape[:2]
    with tempfile.TemporaryDirectory() as folder:
        film = pathlib.Path(folder) / "film.mp4"
        writer = cv2.VideoWriter(str(film), cv2.VideoWriter.fourcc(*"mp4v"), _FRAMES_PER_SECOND, (width, height))
        for frame in frames:
            writer.write(cv2.cvtColor(frame, cv2.COLOR_RGB2BGR))
        writer.release()
        # OpenCV says nothing of a disk that is full. The index of the frames, b"moov", is written last.
        content = film.read_bytes() if film.exists() else b""
        if b"moov" not in _whole_boxes(content):
            raise InputError(f"{film}: can't make the film there: the disk is full, or this OpenCV can't write MP4")
    with writing_to(out), open_whole(out) as file:
        file.write(content)


def _whole_boxes(content: bytes) -> list[bytes]:
    """The names of the boxes that an MP4 file is made of, up to one that is cut off."""
    names, start = [], 0
    while start + 8 <= len(content):
        size, name = struct.unpack_from(">I4s", content, start)
        start += max(size, 8)
        if start <= len(content):
            names.append(name)
    return names


_WRITERS: dict[str, Callable[[list[np.ndarray], pathlib.Path], None]] = {
    ".png": _write_png,
    ".gif": _write_gif,
    ".mp4": _write_mp4,
}
