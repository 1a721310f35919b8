"""Pictures of worlds. Only this module opens rendering contexts, each with the first picture."""

from __future__ import annotations

import atexit
import contextlib
import weakref
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np

from mazebench.maps.moving_doors import StandingMazes
from mazebench.world.backend import RenderingError, rendering_error
from mazebench.world.bodies import SLIDER, Body
from mazebench.world.mjcf import boxes_spec, wall_boxes

CAMERAS = ("top", "chase", "egocentric")
_PICTURE_SIZE = 480  # pixels a side


class Cameras:
    """Pictures of mazes of one size through one rendering context, which opens with the first of them.

    One model without walls does for all mazes: a picture is given the boxes.
    """

    def __init__(self, mazes: StandingMazes, names: tuple[str, ...], pixels: int = _PICTURE_SIZE, body: Body = SLIDER):
        """`names` are of `CAMERAS`, `pixels` is the side of a picture, and `body` is in the mazes."""
        self._mazes, self._names, self._pixels = mazes, names, pixels
        self._model = boxes_spec(mazes[0], *np.zeros((2, 0, 3)), body=body).compile()
        self._data = mujoco.MjData(self._model)
        self._middle, self._half = np.zeros((2, 0, 3))  # of the boxes of the maze that was seen last
        self._maze = -1  # and its index
        self._renderer: mujoco.Renderer | None = None
        self._most_boxes = 0  # that the context has room for
        self._drawn = -1  # the index of the maze whose boxes the scene has

    def take(self, maze: int, qpos: np.ndarray, marker: np.ndarray) -> dict[str, np.ndarray]:
        """Returns `[pixels, pixels, 3]` uint8 by camera.

        Args:
          maze: its index among the mazes.
          qpos: `[3]`, the body's x, y (m) and yaw (rad).
          marker: `[3]` m, where the goal marker stands.

        Raises:
          RenderingError: if no rendering context can be opened; the message says what to set.
        """
        if maze != self._maze:
            self._maze, (self._middle, self._half) = maze, wall_boxes(self._mazes[maze])
        if self._renderer is None or self._most_boxes < len(self._middle):
            self.close()
            self._renderer = self._open(2 * len(self._middle))  # for mazes with more walls
        self._data.qpos[:], self._data.mocap_pos[0] = qpos, marker
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        return {name: self._render(self._renderer, name) for name in self._names}

    def _render(self, renderer: mujoco.Renderer, camera: str) -> np.ndarray:
        view, scene = mujoco.MjvCamera(), renderer.scene
        view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, self._model.camera(camera).id
        every = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, self._data, mujoco.MjvOption(), None, view, every, scene)

        # The boxes come behind the model's geoms, where the next update leaves them.
        first, last = scene.ngeom, scene.ngeom + len(self._middle)
        if self._drawn != self._maze:
            set_boxes(scene.geoms[first:last], self._middle, self._half, self._model.material("wall").rgba)
        self._drawn, scene.ngeom = self._maze, last
        return renderer.render()

    def _open(self, most_boxes: int) -> mujoco.Renderer:
        self._most_boxes, self._drawn = most_boxes, -1
        most_shown = self._model.ngeom + self._model.nsite + most_boxes
        with opening_context():
            renderer = mujoco.Renderer(self._model, self._pixels, self._pixels, max_geom=most_shown)

        # The cameras close before the interpreter unloads the modules that closing needs. Exit functions run in reverse
        # order: registered again after a context is opened, this one runs before the backend's.
        _open_cameras.add(self)
        atexit.unregister(_close_cameras)
        atexit.register(_close_cameras)
        return renderer

    def close(self) -> None:
        """Closes the context, if it was opened; the next picture opens another."""
        if self._renderer is not None:
            # MuJoCo frees textures and buffers by their numbers in the context that is current, whosever that is. A
            # picture makes the right one current.
            self._renderer.render()
            self._renderer.close()
            self._renderer = None

    def __del__(self) -> None:
        self.close()


# Why the process could not open its first context; empty if it could. MuJoCo would end the process at another try.
_failure: str | None = None


@contextlib.contextmanager
def opening_context() -> Iterator[None]:
    """Turns what is raised where a rendering context is opened into a `RenderingError`, always that of the first."""
    global _failure
    if _failure:
        raise RenderingError(_failure)
    try:
        yield
    # MUJOCO_GL names the backend, and each backend raises errors of its own.
    except (mujoco.FatalError, RuntimeError, ImportError, AttributeError, OSError, ValueError) as error:
        found = rendering_error(error)
        _failure = str(found) if _failure is None else ""
        raise found from error
    _failure = ""


def set_boxes(geoms: Sequence[mujoco.MjvGeom], middle: np.ndarray, half: np.ndarray, rgba: np.ndarray) -> None:
    """Makes boxes of the geoms of a scene, with these middles and half sides (`[K, 3]` m) and one colour (`[4]`)."""
    for geom, size, place in zip(geoms, half, middle, strict=True):
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_BOX, size, place, np.eye(3).ravel(), rgba)


_open_cameras: weakref.WeakSet[Cameras] = weakref.WeakSet()


def _close_cameras() -> None:
    for cameras in list(_open_cameras):
        cameras.close()
