"""Pictures of a world. Only this module opens rendering contexts, each with the first picture."""

from __future__ import annotations

import atexit
import copy
import weakref

import mujoco
import numpy as np

from mazebench.errors import InputError
from mazebench.world.models import copy_maze

CAMERAS = ("top", "chase", "egocentric")


class RenderingError(InputError):
    """This machine, as it is set up, can't render."""


class Renderer:
    """A rendering context for one model, open until it is closed; a context manager.

    Raises:
      RenderingError: if no rendering context can be opened; the message says what to set.
    """

    def __init__(self, model: mujoco.MjModel, height: int = 480, width: int = 480):
        try:
            self._renderer = mujoco.Renderer(model, height, width)
        # MUJOCO_GL names the backend, and each backend raises errors of its own.
        except (mujoco.FatalError, RuntimeError, ImportError, AttributeError, OSError, ValueError) as error:
            raise RenderingError(
                f"can't open a rendering context: {str(error).splitlines()[0] if str(error) else error!r}; "
                "on a machine without a display set MUJOCO_GL=egl (or osmesa)"
            ) from error
        _close_at_exit(self)

    def render(self, data: mujoco.MjData, camera: str = "top") -> np.ndarray:
        """Returns a picture of the state in `data`: `[H, W, 3]` uint8."""
        self._renderer.update_scene(data, camera=camera)
        return self._renderer.render()

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the context."""
        self._renderer.close()


class Cameras:
    """Pictures of any worlds of one `MazeModels` through one rendering context, which opens with the first of them."""

    def __init__(self, model: mujoco.MjModel, names: tuple[str, ...], pixels: int, smooth: bool = False):
        """`names` are of `CAMERAS`, `pixels` is the side of a picture; `model` is any of the models.

        Edges are stepped unless `smooth`: without a GPU, smoothing takes four fifths of the time of a small picture.
        """
        self._model = copy.copy(model)
        if not smooth:
            self._model.vis.quality.offsamples = 0
        self._data = mujoco.MjData(self._model)
        self._names, self._pixels = names, pixels
        self._shown: mujoco.MjModel | None = None
        self._renderer: Renderer | None = None

    def take(self, model: mujoco.MjModel, qpos: np.ndarray, marker: np.ndarray) -> dict[str, np.ndarray]:
        """`[pixels, pixels, 3]` uint8 by camera, of the maze of `model`.

        Args:
          model: of the same `MazeModels` as all others.
          qpos: `[3]`, the body's x, y (m) and yaw (rad).
          marker: `[3]` m, where the goal's marker stands.

        Raises:
          RenderingError: if no rendering context can be opened.
        """
        if self._renderer is None:
            self._renderer = Renderer(self._model, self._pixels, self._pixels)
        if model is not self._shown:
            copy_maze(model, self._model)
            self._shown = model
        self._data.qpos[:], self._data.mocap_pos[0] = qpos, marker
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        return {name: self._renderer.render(self._data, name) for name in self._names}

    def close(self) -> None:
        """Closes the context, if it was opened; the next picture opens another."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


_open_renderers: weakref.WeakSet[Renderer] = weakref.WeakSet()


def _close_at_exit(renderer: Renderer) -> None:
    """Makes sure that `renderer` is closed before the interpreter unloads the modules that closing needs."""
    _open_renderers.add(renderer)
    # Exit functions run in reverse order. Registered again after a renderer is opened, ours runs before the backend's.
    atexit.unregister(_close_renderers)
    atexit.register(_close_renderers)


def _close_renderers() -> None:
    for renderer in list(_open_renderers):
        renderer.close()
