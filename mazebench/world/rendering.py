"""Pictures of a world; the only place that opens a rendering context, and only when one is asked for."""

from __future__ import annotations

import mujoco
import numpy as np

from mazebench.errors import InputError


class RenderingError(InputError):
    """No picture can be rendered on this machine as it is set up."""


def render(
    model: mujoco.MjModel, data: mujoco.MjData, camera: str = "top", height: int = 480, width: int = 480
) -> np.ndarray:
    """`[height, width, 3]` uint8: what `camera` ("top", "egocentric" or "chase") sees.

    Raises:
      RenderingError: if no rendering context can be opened; the message says what to set.
    """
    with Renderer(model, height, width) as renderer:
        return renderer.render(data, camera)


class Renderer:
    """A rendering context for one model, kept open over many pictures; a context manager."""

    def __init__(self, model: mujoco.MjModel, height: int = 480, width: int = 480):
        try:
            self._renderer = mujoco.Renderer(model, height, width)
        # mujoco.gl_context is whichever backend MUJOCO_GL names; each has error classes of its own.
        except (mujoco.FatalError, RuntimeError, ImportError, AttributeError, OSError, ValueError) as error:
            raise RenderingError(
                f"can't open a rendering context: {str(error).splitlines()[0] if str(error) else error!r}; "
                "on a machine without a display set MUJOCO_GL=egl (or osmesa)"
            ) from error

    def render(self, data: mujoco.MjData, camera: str = "top") -> np.ndarray:
        """`[H, W, 3]` uint8 of the state in `data`."""
        self._renderer.update_scene(data, camera=camera)
        return self._renderer.render()

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the context. Left to the interpreter's exit, that would come after what it needs is gone, noisily."""
        self._renderer.close()
