"""Pictures and films of the disk: one drawing routine on a GGUI canvas, text around it, an encoder behind it."""

from __future__ import annotations

from taichi_disk.doctor import REMEDY
from taichi_disk.errors import TaichiDiskError


def film_problem() -> str | None:
    """Why no film can be made on this machine and the command that mends it, or None. Needs no `ti.init`."""
    try:
        from taichi_disk.engine import ti
    except ImportError as error:
        return f"Taichi cannot be loaded ({error}); as root: {REMEDY}"
    if not ti._lib.core.with_vulkan():
        return f"pictures are drawn with Vulkan, and there is no Vulkan driver here; as root: {REMEDY}"
    return None


def require_film() -> None:
    """Raise TaichiDiskError if no film can be made on this machine."""
    if problem := film_problem():
        raise TaichiDiskError(f"no film: {problem}")
