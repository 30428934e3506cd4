"""Pictures and films of the disk: drawn on a GGUI canvas, completed with text and
curves, and encoded."""

from __future__ import annotations

from taichi_disk.doctor import REMEDY
from taichi_disk.errors import TaichiDiskError


def film_problem() -> str | None:
    """Return why this machine cannot make films, with the command that helps, or None.
    Needs no `ti.init`."""
    try:
        from taichi_disk.engine import ti
    except ImportError as error:
        return f"Taichi cannot be loaded ({error}); as root: {REMEDY}"
    if not ti._lib.core.with_vulkan():
        return (
            "pictures are drawn with Vulkan, and there is no Vulkan driver here; as"
            f" root: {REMEDY}"
        )
    return None


def require_film() -> None:
    if problem := film_problem():
        raise TaichiDiskError(f"no film: {problem}")
