"""An episode as a film or a picture: from above, through the agent's eyes, with its rays, on the map it was shown."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
import tempfile
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike

from mazebench.agent_loading import load_agent_class
from mazebench.constants import MAX_PIXELS, STEP_TIME
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError, remark, unknown
from mazebench.evaluation.eval_options import EvalOptions
from mazebench.evaluation.plan import Plan, build_agent, make_plan
from mazebench.maps.pictures import draw_grid, draw_rays, write_image
from mazebench.results.played import played_task
from mazebench.results.reading import CONFIG, Result
from mazebench.rollout import agent_seed, rollout
from mazebench.storage.files import make_folder, open_whole, writing_to
from mazebench.storage.json_files import read_json
from mazebench.tasks.context import resized_map
from mazebench.tasks.episode import Episode
from mazebench.tasks.perturbations.perturbation import ShownMap
from mazebench.tasks.sensors import LIDAR, SENSORS
from mazebench.tasks.sensors.cameras import as_colors
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.trials import counting_option
from mazebench.world.ray_casting import ahead_of, ray_ends
from mazebench.world.rendering import CAMERAS, Cameras

MAP, _TOP = "map", "top"
# What stands above each of several views; others are called by their names.
_TITLES = {MAP: "shown map, driven path", LIDAR: "building, lidar, path", _TOP: "from above", "chase": "from behind"}
_TITLE_SHARE = 0.07  # of a view's side, above it
_AROUND = 0.02  # of the side of a maze, seen by the camera on top at each side of it
_CODEC = "vp09"  # VP9, which browsers play
_FRAMES_PER_SECOND = 1 / STEP_TIME  # one an agent step: the film runs in real time


class Outcome(NamedTuple):
    """The end of an episode."""

    success: bool
    steps: int
    words: str  # a line that tells both, the path and the place


def film_episode(options: EvalOptions, out: pathlib.Path, view: str, pixels: int) -> str:
    """Runs the episode number `options.seed` of the protocol and writes it to `out`.

    Args:
      options: who drives where, as for an evaluation.
      out: an .mp4 or .gif of the episode, or a .png of its last moment, with the whole path on the map.
      view: a camera, "map", a sensor of the task, or "all" for all of them side by side; a camera that is a sensor
        shows what the agent observed.
      pixels: side of a view.

    Returns:
      What came of the episode, in words.

    Raises:
      InputError: if a name is unknown or `out` can't be written.
      RenderingError: if this machine can't render.
    """
    plan = make_plan(options)
    return _film(plan, options.seed % len(plan.trials), out, view, pixels).words


def film_result(
    result: Result, number: int, out: pathlib.Path, view: str, pixels: int, agent: str | None = None, **chosen: Any
) -> str:
    """Runs the episode `number` of a finished evaluation again, and writes it as `film_episode` does.

    A `mazebench.errors.Remark` warns if success or steps are not those of the record. The result may be somebody
    else's: of its config, only what may change results counts, and a `module:Class` is imported only if `agent` names
    it. `chosen` has `checkpoint`, that of the evaluation unless it is the shipped one, and `overrides`, further values
    of the agent's config.

    Raises:
      InputError: also if there is no such episode, or the mazes or the checkpoint are not those of the evaluation.
    """
    folder, summary, origin = result.folder, result.summary, result.summary.provenance
    if summary.task.num_goals > 1:
        raise InputError(f"{folder}: expected results with one goal per episode, found {summary.task.num_goals} goals")
    if not number < summary.episodes:
        raise InputError(f"{folder}: expected an episode from 0 to {summary.episodes - 1}, found {number}")
    if agent != summary.agent and (agent is not None or ":" in summary.agent):
        raise InputError(f"{folder}: its agent is {summary.agent!r}; name it by --agent, found {agent or 'none named'}")
    config = load_agent_class(summary.agent).eval_config
    known = config.identity() if config else {}
    if other := summary.config.keys() - known.keys():
        expected = ", ".join(known) or "none"
        raise InputError(f"{folder}: expected in config what may change results: {expected}; found {min(other)!r}")
    played_task(summary)  # refuses mazes that were changed

    # The evaluation's plan.
    identity, counting = read_json(folder / CONFIG), counting_option(summary.task)
    if not isinstance(identity, dict):
        raise InputError(f"{folder / CONFIG}: expected the identity of a run, found {type(identity).__name__}")
    if counting is not None:
        chosen[counting] = identity.get(counting)
    options = EvalOptions(agent=summary.agent, task=summary.task, seed=origin.seed, **chosen)
    plan = make_plan(options.replace(overrides={**summary.config, **options.overrides}))
    expected, found = (str(each.checkpoint_sha256)[:8] for each in (origin, plan.provenance))
    if found != expected:
        raise InputError(f"{folder}: expected the checkpoint with SHA-256 {expected}, found {found}; use --checkpoint")

    outcome, record = _film(plan, number, out, view, pixels), result.records[number]
    if outcome[:2] != (record.success, record.steps):
        code = "the same" if plan.provenance.agent_code_sha256 == origin.agent_code_sha256 else "changed"
        remark(
            f"{folder}: episode {number}: expected success {record.success} after {record.steps} steps, as recorded, "
            f"found {outcome.success} after {outcome.steps}; the agent's code is {code}"
        )
    return outcome.words


def _film(plan: Plan, number: int, out: pathlib.Path, view: str, pixels: int) -> Outcome:
    """Runs an episode of a plan and writes it to `out`."""
    if view not in (every := (MAP, *{**dict.fromkeys(CAMERAS), **SENSORS}, "all")):
        raise unknown("view", view, every)
    if out.suffix not in _WRITERS:
        raise unknown("suffix", out.suffix, _WRITERS)
    out = out.absolute()  # agents may change the working folder
    frames, outcome = run_episode(plan, number, view, pixels, is_film=out.suffix != ".png")
    make_folder(out.parent)
    with writing_to(out):
        _WRITERS[out.suffix](frames, out)
    return outcome


def run_episode(plan: Plan, number: int, view: str, pixels: int, is_film: bool) -> tuple[list[np.ndarray], Outcome]:
    """Runs an episode of a plan; returns a picture of each of its moments, or of the last one, and its outcome."""
    if view in SENSORS and view not in (*CAMERAS, *plan.task.options.sensors):
        raise InputError(f"view {view!r}: expected a task with this sensor; add --sensors {view}")
    views = (MAP, *dict.fromkeys((*CAMERAS, *plan.task.options.sensors))) if view == "all" else (view,)
    trial = plan.trials[number]
    episode = trial.episode
    maze = plan.task.mazes[episode.maze]

    agent, frames = build_agent(plan.options, plan.task, plan.agent_class), []
    envs = MazeVectorEnv(plan.task, 1, num_threads=1, episode_source=lambda _: episode, autoreset_mode="Disabled")
    with contextlib.closing(envs):
        first = envs.reset()
        with contextlib.closing(_Scene(envs, episode, show_map(plan.task, episode), views, pixels)) as scene:
            if is_film:
                frames.append(scene.draw(first[0]))
            steps = rollout(
                agent,
                envs,
                first,
                lambda _: [agent_seed(plan.options.seed, number)],
                needs_truth=plan.agent_class.needs_truth,
            )
            for step in steps:
                scene.record_position()
                if is_film or step.ended.item():
                    frames.append(scene.draw(step.next_observation))
                if step.ended.item():
                    break
    info = {name: values[0] for name, values in step.next_info.items()}

    ending = "reached the goal" if info["success"] else "ran out of time"
    return frames, Outcome(
        bool(info["success"]),
        int(info["steps"]),
        f"{plan.options.agent} {ending} after {info['steps']} steps and {info['path_length']:.2f} m "
        f"(shortest {trial.shortest_path:.2f} m) in maze {maze.name}, from {episode.start} to {episode.goal}",
    )


@dataclasses.dataclass
class _Scene:
    """The views of the running episode of one environment, side by side in one picture."""

    envs: MazeVectorEnv
    episode: Episode
    shown: ShownMap
    views: tuple[str, ...]
    pixels: int

    def __post_init__(self) -> None:
        self._task = self.envs.task
        self._path: list[np.ndarray] = []  # [2] m each
        self.record_position()
        names = tuple(view for view in self.views if view in CAMERAS and view not in self._task.options.sensors)
        self._walls = self._task.mazes[self.episode.maze].walls
        rows, columns = _part_of_free(self._walls)
        pixels = self.pixels * len(self._walls) // max(rows.stop - rows.start, columns.stop - columns.start)
        pixels = min(pixels, MAX_PIXELS) if _TOP in names else self.pixels  # of what is cut out, as many are left
        self._cameras = Cameras(self._task.standing, names, pixels, self._task.body) if names else None

    def record_position(self) -> None:
        """Adds the body's position to the driven path."""
        self._path.append(self.envs.rules.pose[0, :2].copy())

    def draw(self, observation: Mapping[str, np.ndarray]) -> np.ndarray:
        """Returns a picture `[H, W, 3]` uint8 of the current state, in which `observation` was made.

        The shown map, and the maze in the view of the range sensor, have the path driven up to now.
        """
        pictures, rules = {}, self.envs.rules
        if self._cameras is not None:
            pictures = self._cameras.take(rules.maze.item(), rules.pose[0], rules.marker[0])
            if _TOP in pictures:
                pictures[_TOP] = _cut_out(pictures[_TOP], self._walls, _AROUND)
        for view in set(self.views) - pictures.keys():
            if view == MAP:
                picture = self._map()
            elif view == LIDAR:
                picture = self._rays(observation[LIDAR][0])
            else:
                picture = as_colors(view, observation[view][0])
            pictures[view] = picture
        fitted = {view: _fitted(pictures[view], self.pixels) for view in self.views}
        if len(fitted) == 1:
            return fitted[self.views[0]]
        return np.concatenate([_titled(picture, _TITLES.get(view, view)) for view, picture in fitted.items()], axis=1)

    def close(self) -> None:
        if self._cameras is not None:
            self._cameras.close()

    def _map(self) -> np.ndarray:
        """Returns a picture of the map that the agent is shown, some two times as large as a view."""
        shown, side = self.shown, self._task.context_size
        size = len(shown.seen_walls)
        walls = resized_map(shown.seen_walls, side)
        pixels = (shown.seen_cell(cell) for cell in (self.episode.start, self.episode.goal))
        start, goal = ((row * side // size, column * side // size) for row, column in pixels)
        path = shown.seen_points(self._to_cells(self._path)) * (side / size)
        return _cut_out(draw_grid(walls, self._cell_pixels(walls), start, goal, path), walls)

    def _rays(self, ranges: np.ndarray) -> np.ndarray:
        """Returns a picture of the true maze with the rays of the range sensor, some two times as large as a view."""
        walls, pose = self._task.standing[self.envs.rules.maze.item()].walls, self.envs.rules.pose[0]
        cell_pixels = self._cell_pixels(walls)
        picture = draw_grid(walls, cell_pixels, self.episode.start, self.episode.goal, self._to_cells(self._path))
        sensor = ahead_of(pose, self._task.body.lidar_offset)
        draw_rays(picture, cell_pixels, self._to_cells(sensor[:2]), self._to_cells(ray_ends(sensor, ranges)))
        return _cut_out(picture, self._walls)

    def _to_cells(self, points: ArrayLike) -> np.ndarray:  # [..., 2] m
        return np.asarray(points) / self._task.cell_size

    def _cell_pixels(self, walls: np.ndarray) -> int:
        return 2 * self.pixels // len(walls) + 1


def _part_of_free(walls: np.ndarray) -> tuple[slice, slice]:
    """Returns the rows and columns of a map that have free cells, with the walls around them."""
    ends = (np.flatnonzero((walls < 0.5).any(axis=axis))[[0, -1]] for axis in (1, 0))
    rows, columns = (slice(max(first - 1, 0), last + 2) for first, last in ends)
    return rows, columns


def _cut_out(picture: np.ndarray, walls: np.ndarray, around: float = 0.0) -> np.ndarray:
    """Returns the part of a square picture that shows what is free on a map; `around` is the map's share on each side.

    A picture of a map that is free up to its border stays as it is.
    """
    part = _part_of_free(walls)
    if all(each.stop - each.start >= len(walls) for each in part):
        return picture
    scale = len(picture) / (1 + 2 * around)
    place = (np.array([[each.start, each.stop] for each in part]) / len(walls) + around) * scale
    rows, columns = (slice(*each) for each in np.rint(place).astype(int).tolist())
    return picture[rows, columns]


def _fitted(picture: np.ndarray, pixels: int) -> np.ndarray:
    """Returns a picture in the middle of a white square with sides of `pixels`."""
    scale = pixels / max(picture.shape[:2])
    height, width = (max(1, round(side * scale)) for side in picture.shape[:2])
    way = cv2.INTER_NEAREST if scale > 1 else cv2.INTER_AREA
    square = np.full((pixels, pixels, 3), 255, dtype=np.uint8)
    top, left = (pixels - height) // 2, (pixels - width) // 2
    square[top : top + height, left : left + width] = cv2.resize(picture, (width, height), interpolation=way)
    return square


def _titled(picture: np.ndarray, title: str) -> np.ndarray:
    """Returns a picture with a title above it, and a white line at its sides."""
    pixels = len(picture)
    height = 2 * round(pixels * _TITLE_SHARE / 2)  # films have even sides
    line = np.full((height, pixels, 3), 255, dtype=np.uint8)
    place = (round(0.02 * pixels), round(0.7 * height))
    cv2.putText(line, title, place, cv2.FONT_HERSHEY_SIMPLEX, pixels / 600, (28, 33, 39), 1, cv2.LINE_AA)
    picture[:, [0, -1]] = 255
    return np.concatenate([line, picture])


def _write_gif(frames: list[np.ndarray], out: pathlib.Path) -> None:
    animation = cv2.Animation()
    animation.frames = [cv2.cvtColor(frame, cv2.COLOR_RGB2BGRA) for frame in frames]
    animation.durations = [round(1000 / _FRAMES_PER_SECOND)] * len(frames)
    _, content = cv2.imencodeanimation(".gif", animation)
    with open_whole(out) as file:
        file.write(content.tobytes())


def _write_mp4(frames: list[np.ndarray], out: pathlib.Path) -> None:
    height, width = frames[0].shape[:2]
    with tempfile.TemporaryDirectory() as folder:
        film = pathlib.Path(folder) / "film.mp4"
        writer = cv2.VideoWriter(str(film), cv2.VideoWriter.fourcc(*_CODEC), _FRAMES_PER_SECOND, (width, height))
        for frame in frames:
            writer.write(cv2.cvtColor(frame, cv2.COLOR_RGB2BGR))
        writer.release()
        content = film.read_bytes() if film.exists() else b""
        # OpenCV reports no error if the disk is full. A whole film ends with its index: a size, "moov" and the rest.
        index = content.rfind(b"moov") - 4
        if index < 0 or index + int.from_bytes(content[index : index + 4], "big") != len(content):
            raise InputError(f"{film}: can't make the film there: the disk is full, or this OpenCV can't write MP4")
    with open_whole(out) as file:
        file.write(content)


_WRITERS: dict[str, Callable[[list[np.ndarray], pathlib.Path], None]] = {
    ".png": lambda frames, out: write_image(frames[0], out),
    ".gif": _write_gif,
    ".mp4": _write_mp4,
}
