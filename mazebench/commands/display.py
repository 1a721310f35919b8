"""Whether this machine has a display, and which backend renders without one."""

from __future__ import annotations

import os
import sys


def has_display() -> bool:
    """Returns whether windows can be expected to open here."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def choose_rendering_backend() -> None:
    """Lets this process render without a display, unless the user chose a backend; before MuJoCo is imported."""
    if not has_display():
        os.environ.setdefault("MUJOCO_GL", "egl")
