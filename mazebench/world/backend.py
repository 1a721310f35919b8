"""The rendering backend that MUJOCO_GL names. MuJoCo and dm_control load it when they are imported."""

from __future__ import annotations

import contextlib
import ctypes.util
import importlib
import os
import sys
from collections.abc import Iterator

from mazebench.errors import InputError

_LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}  # of the backends that need no display


class RenderingError(InputError):
    """This machine, as it is set up, can't render."""


def load_mujoco() -> None:
    """Imports MuJoCo, and with it the rendering backend.

    Raises:
      RenderingError: if it can't load the backend that the environment variable MUJOCO_GL names.
    """
    if "MUJOCO_GL" not in os.environ:
        return  # it takes what there is
    with loading_backend():
        importlib.import_module("mujoco")


@contextlib.contextmanager
def loading_backend() -> Iterator[None]:
    """Turns what an import raises that can't load the rendering backend into a `RenderingError`."""
    try:
        yield
    # The kind of error depends on the backend.
    except (AttributeError, ImportError, OSError, RuntimeError, ValueError) as error:
        raise rendering_error(error) from None  # it says all


def rendering_error(error: Exception) -> RenderingError:
    """Returns an error that says why `error` came up while a backend was opened, and which backends are installed."""
    chosen, device = os.environ.get("MUJOCO_GL"), os.environ.get("MUJOCO_EGL_DEVICE_ID", "0")
    backend, platform = (chosen or "").strip().lower(), os.environ.get("PYOPENGL_PLATFORM", "")
    setting = "MUJOCO_GL is not set" if chosen is None else f"MUJOCO_GL={chosen}"
    # GLFW always is installed, but it needs a display.
    installed = ["glfw"] * has_display() + [name for name in _LIBRARIES if ctypes.util.find_library(_LIBRARIES[name])]
    others = [f"MUJOCO_GL={name}" for name in installed if name != chosen]
    advice = f"set {' or '.join(others)} before Python starts" if others else "no other backend is installed here"
    reason = str(error).splitlines()[0] if str(error) else repr(error)
    # Other variables that keep a backend from loading, after which MuJoCo lacks its renderer.
    if backend in _LIBRARIES and platform and platform.lower() != backend:
        reason, advice = f"PYOPENGL_PLATFORM={platform} names another backend", "unset it before Python starts"
    elif isinstance(error, AttributeError) and backend in _LIBRARIES and backend not in installed:
        reason = f"the library {_LIBRARIES[backend]} is not installed"
    elif backend == "egl" and not device.strip().isdecimal():
        reason, advice = f"expected MUJOCO_EGL_DEVICE_ID as a number, found {device!r}", "set it before Python starts"
    return RenderingError(f"can't open a rendering context, {setting}: {reason}; {advice}")


def has_display() -> bool:
    """Returns whether windows can be expected to open here."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
