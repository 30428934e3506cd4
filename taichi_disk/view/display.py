"""Whether a window can be opened here, asked without opening one: GLFW ends the process where it cannot."""

from __future__ import annotations

import ctypes
import os
import sys

from taichi_disk.render.film import film_problem


def window_problem() -> str | None:
    """Why no window can be opened on this machine and what mends it, or None. Needs no `ti.init`."""
    if sys.platform.startswith("linux"):
        name = os.environ.get("DISPLAY", "")
        remedy = (
            "run it on a desktop, log in with `ssh -X`, or give it a virtual one: "
            "`xvfb-run -s '-screen 0 1280x1024x24' taichi-disk view`; `taichi-disk run` films without a display"
        )
        if not name:
            return f"there is no display (DISPLAY is not set): {remedy}"
        if not _x_answers():
            return f"the display DISPLAY={name} does not answer: {remedy}"
    return film_problem()


def _x_answers() -> bool:
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return True  # Taichi cannot be loaded either, and says so better
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XCloseDisplay.argtypes = [ctypes.c_void_p]
    display = x11.XOpenDisplay(None)
    if display:
        x11.XCloseDisplay(display)
    return bool(display)
