"""A window to drive in, MuJoCo's viewer, with the shown map in a corner."""

from __future__ import annotations

import queue
import threading
import types
import warnings
from typing import Any

import cv2
import mujoco
import numpy as np

from mazebench.errors import InputError
from mazebench.maps.maze import Maze
from mazebench.maps.pictures import draw_grid
from mazebench.play.game import HELP, Game
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START
from mazebench.world.mjcf import BODY_HEIGHT, wall_boxes
from mazebench.world.ray_casting import NUM_RAYS
from mazebench.world.rendering import set_boxes

_ESCAPE = 256  # GLFW's key codes; those of letters are the codes of capital letters
_ARROWS = {262: "right", 263: "left", 264: "down", 265: "up"}
_MAP_PIXELS = 260  # side of the map in the corner of the window
_RAY_COLOUR = np.array([0.16, 0.6, 0.75, 1], dtype=np.float32)
_WITHOUT = "`mazebench render` films episodes without a window"


def play(game: Game) -> None:
    """Plays until Escape, or until the window is closed.

    Raises:
      InputError: if no window can be opened.
    """
    viewer_module = _import_viewer()
    model, data = game.env.simulation.model, game.env.simulation.data
    keys: queue.SimpleQueue[int] = queue.SimpleQueue()
    others = set(threading.enumerate())
    try:
        viewer = viewer_module.launch_passive(
            model, data, key_callback=keys.put, show_left_ui=False, show_right_ui=False
        )
    except RuntimeError as error:  # macOS without mjpython
        raise InputError(f"can't open MuJoCo's viewer: {error}; {_WITHOUT}") from error
    threads = set(threading.enumerate()) - others
    try:
        with viewer:
            _play(viewer, game, keys)
    finally:
        # A window that is still closing when Python exits would crash it.
        for thread in threads:
            thread.join(timeout=10.0)


def _play(viewer: Any, game: Game, keys: queue.SimpleQueue[int]) -> None:
    """Plays in an open window until Escape, or until it is closed."""
    model = game.env.simulation.model
    viewer.cam.type = mujoco.mjtCamera.mjCAMERA_FIXED
    viewer.cam.fixedcamid = model.camera("chase").id
    # Some of these letters toggle flags of the viewer too: the flags are reset all the time.
    flags = viewer.opt.flags.copy(), viewer.user_scn.flags.copy()
    walls = Walls(model.material("wall").rgba)
    while viewer.is_running():
        with viewer.lock():
            viewer.opt.flags[:], viewer.user_scn.flags[:] = flags
            walls.draw(viewer.user_scn, game.maze)
            _draw_rays(viewer.user_scn, game)
        _overlay(viewer, game)
        viewer.sync()
        try:
            code = keys.get(timeout=0.02)
        except queue.Empty:
            continue
        if code == _ESCAPE:
            return
        with viewer.lock():
            game.press(_ARROWS.get(code) or (chr(code).lower() if code < 128 else ""))


def _import_viewer() -> types.ModuleType:
    """Imports mujoco.viewer if a window can be opened; otherwise its launch would never return."""
    try:
        import glfw
        import mujoco.viewer
    except (ImportError, RuntimeError) as error:
        raise InputError(f"can't open MuJoCo's viewer: {error}; {_WITHOUT}") from error
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", glfw.GLFWError)  # reported below, in one line
        opens = glfw.init()
    if not opens:
        raise InputError(f"can't open a window: there is no display, or it refuses; {_WITHOUT}")
    return mujoco.viewer


class Walls:
    """All walls of the maze, of which the simulation has those near the body only."""

    def __init__(self, rgba: np.ndarray):
        self._rgba = rgba
        self._drawn: Maze | None = None
        self._num_boxes = 0

    def draw(self, scene: mujoco.MjvScene, maze: Maze) -> None:
        """Makes the walls, as many as it has room for, all that is in the scene, which is always the same one."""
        if maze is not self._drawn:
            middle, half = wall_boxes(maze)
            self._drawn, self._num_boxes = maze, min(len(middle), scene.maxgeom - NUM_RAYS)
            shown = slice(self._num_boxes)
            set_boxes(scene.geoms[shown], middle[shown], half[shown], self._rgba)
        scene.ngeom = self._num_boxes


def _draw_rays(scene: mujoco.MjvScene, game: Game) -> None:
    """Adds the rays of the range sensor to a scene, from the body's centre to the walls, if the task has it."""
    ends = game.rays
    if ends is None:
        return
    height = BODY_HEIGHT / 2
    for geom, end in zip(scene.geoms[scene.ngeom :], ends, strict=False):
        capsule, radius = mujoco.mjtGeom.mjGEOM_CAPSULE, 0.008
        mujoco.mjv_initGeom(geom, capsule, np.zeros(3), np.zeros(3), np.zeros(9), _RAY_COLOUR)
        mujoco.mjv_connector(geom, capsule, radius, np.array([*game.path[-1], height]), np.array([*end, height]))
    scene.ngeom += len(ends)


def _overlay(viewer: Any, game: Game) -> None:
    """Draws the map in the upper right corner, and the episode and the keys on the left."""
    window = viewer.viewport
    if window is None:
        return
    side = min(_MAP_PIXELS, window.width // 3, window.height // 2)
    area = mujoco.MjrRect(window.width - side - 10, window.height - side - 10, side, side)
    viewer.set_images((area, _map_picture(game.observation["context"], side)))
    corner = mujoco.mjtGridPos
    viewer.set_texts(
        [
            (None, corner.mjGRID_TOPLEFT, game.title(), ""),
            (None, corner.mjGRID_BOTTOMLEFT, f"{game.status()}\n{HELP}", ""),
        ]
    )


def _map_picture(context: np.ndarray, side: int) -> np.ndarray:
    """Returns `[side, side, 3]` uint8: a context `[4, M, M]` as a picture of its walls, start and goal."""
    num_cells = context.shape[-1]
    start, goal = (divmod(int(context[plane].argmax()), num_cells) for plane in (START, GOAL))
    picture = draw_grid(context[GLOBAL_MAP], -(-side // num_cells), start, goal)
    return cv2.resize(picture, (side, side), interpolation=cv2.INTER_AREA)
