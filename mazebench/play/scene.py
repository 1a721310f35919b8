"""The views of an episode on the page: what the person is shown of each moment, and what came of it.

On the page, a plane of `M` x `M` has places (x, y) in its pixels, y down from the upper edge.
"""

from __future__ import annotations

import base64
from typing import Any

import cv2
import numpy as np

from mazebench.agent import Observation
from mazebench.constants import ON_TIME, STEP_TIME, YAW, X, Y
from mazebench.evaluation.chunk import Result, to_record
from mazebench.evaluation.plan import Plan
from mazebench.play.person import keys_of
from mazebench.results.metrics import ON_TIMES
from mazebench.results.naming import title_of
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START
from mazebench.tasks.route import plan_route
from mazebench.tasks.sensors import LIDAR
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.tracks import TRACKS

CAMERA = "egocentric"
_JPEG_QUALITY = 90


class Scene:
    """The episode `number` of a plan, as it is driven."""

    def __init__(self, plan: Plan, number: int):
        task, options, episode = plan.task, plan.task.options, plan.trials[number].episode
        self._plan, self._number = plan, number
        self._shown = show_map(task, episode)
        track, level = TRACKS.get(options.track or ""), options.track_level if options.track else 0
        self._told = {
            "phase": "drive",
            "title": title_of(options),
            "meaning": f"{track.help} Level {level}: {track.levels[level - 1].meaning}." if track else "",
            "keys": keys_of(task.interface.actions, task.body),
            "limit": plan_route(task, episode, self._shown).time_limit * STEP_TIME,
            "reach": task.interface.lidar.max_range if task.interface.lidar else None,
            "radius": task.body.radius,
        }
        self._knows_pose = track is None or not track.hides_pose or options.exact_pose
        self._step, self._trail, self._last = -1, list[list[float]](), dict[str, Any]()

    def observe(self, observation: Observation) -> None:
        """Takes note of a step, or of the beginning."""
        self._step += 1
        if self._knows_pose and observation["context"][0, START].any():
            x, y, yaw = observation["state"][0, [X, Y, YAW]].tolist()
            task = self._plan.task
            pixel = task.mazes[0].side / task.context_size  # m
            self._trail.append([x / pixel, task.context_size - y / pixel, yaw])

    def view(self, observation: Observation) -> dict[str, Any]:
        """Returns what is shown of the moment that was observed last."""
        context = observation["context"][0]
        view: dict[str, Any] = {
            "side": self._plan.task.context_size,
            "map": None if "map" in self._plan.task.options.hide else _packed(context[GLOBAL_MAP]),
            "start": _marked(context[START]),
            "goal": _marked(context[GOAL]),
            "trail": [[round(value, 3) for value in pose] for pose in self._trail],
            "seconds": self._step * STEP_TIME,
        }
        if CAMERA in observation:
            picture = cv2.cvtColor(observation[CAMERA][0], cv2.COLOR_RGB2BGR)
            _, content = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
            view["camera"] = f"data:image/jpeg;base64,{base64.b64encode(content.tobytes()).decode()}"
        else:
            view["ranges"] = [round(each, 2) for each in observation[LIDAR][0].tolist()]
        self._last = self._told | view
        return self._last

    def end(self, result: Result, oracle: Result) -> dict[str, Any]:
        """Returns what is shown of the end, besides the last moment: the result, the oracle's, and the building."""
        plan, task, episode = self._plan, self._plan.task, self._plan.trials[self._number].episode
        oracle_steps = oracle.steps if oracle.success else None
        record = to_record(plan, result).model_copy(update={"oracle_steps": oracle_steps})
        verdict = "On time" if ON_TIMES[0].of([record])[0] else "Late" if result.success else "Out of time"
        words = f"You reached the goal after {result.steps * STEP_TIME:.1f} s" if result.success else "The time is up"
        if oracle_steps is not None:
            words += f"; the oracle, which knows the building, needs {oracle_steps * STEP_TIME:.1f} s."
            words += f" Up to {ON_TIME[0] * oracle_steps * STEP_TIME:.1f} s are on time."
        shown, walls = self._shown.walls, task.mazes[episode.maze].walls
        differs = np.argwhere(shown != walls).tolist() if shown.shape == walls.shape else []
        return {
            **self._last,
            "phase": "end",
            "keys": ["next"],
            "seconds": result.steps * STEP_TIME,
            "verdict": verdict,
            "words": words,
            "building": _packed(walls),
            "size": task.size,
            "ends": [row * task.size + column for row, column in (episode.start, episode.goal)],
            "changed": [[row, column, bool(walls[row, column])] for row, column in differs],
            "ways": [self._way(each) for each in (oracle, result)],
        }

    def _way(self, result: Result) -> list[list[float]]:
        """Returns the positions that were driven through, in cells of the building."""
        task = self._plan.task
        positions = np.array(result.kept)[:, :2] / task.cell_size
        return [[round(x, 3), round(task.size - y, 3)] for x, y in positions.tolist()]


def _packed(plane: np.ndarray) -> str:
    """Returns shares of wall `[M, M]` as bytes in base64."""
    return base64.b64encode(np.rint(plane * 255.0).astype(np.uint8).tobytes()).decode()


def _marked(plane: np.ndarray) -> int:
    """Returns the number of the pixel that a plane marks, row by row; -1 if there is none."""
    return int(plane.argmax()) if plane.any() else -1
