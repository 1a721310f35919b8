"""The rendering backend of a command, settled before MuJoCo is imported."""

from __future__ import annotations

import os

from mazebench.world import backend


def load_mujoco(renders: bool) -> None:
    """Imports MuJoCo for a command, which then works with any value of MUJOCO_GL if it renders nothing.

    Args:
      renders: whether the command renders. Without a display it does so with EGL, unless the user chose a backend.

    Raises:
      RenderingError: if the command renders and the backend can't be loaded.
    """
    if renders and not backend.has_display():
        os.environ.setdefault("MUJOCO_GL", "egl")
    try:
        backend.load_mujoco()
    except backend.RenderingError:
        if renders:
            raise
        os.environ["MUJOCO_GL"] = "off"  # in worker processes too
