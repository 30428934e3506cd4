"""From a scene to its window."""

from __future__ import annotations

from pathlib import Path

from taichi_disk.errors import TaichiDiskError
from taichi_disk.model import runtime
from taichi_disk.scene import Scene
from taichi_disk.view.display import window_problem


def view(scene: Scene, out: Path) -> None:
    """Open the sandbox on `scene`; returns when its window has been closed. Files go into `out`.

    Raises TaichiDiskError, with the remedy, where no window can be opened.
    """
    if problem := window_problem():
        raise TaichiDiskError(f"no window: {problem}")
    from taichi_disk.view.window import Viewer

    runtime.start("cpu")
    Viewer(scene, out).run()
