"""The sandbox as a widget of a notebook: JupyterLab, VS Code, marimo. Needs the extra `notebook`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from taichi_disk import runtime
from taichi_disk.errors import TaichiDiskError, pip_install
from taichi_disk.scenes import Scene, load_scene

try:
    from rendercanvas.anywidget import AnywidgetRenderCanvas
except ImportError as error:
    raise TaichiDiskError(f"no widget, because of {error}: {pip_install('taichi-disk[notebook]')}") from None

if TYPE_CHECKING:
    from taichi_disk.window.sandbox import Result

FASTEST = 40  # pictures per second at most


class Sandbox(AnywidgetRenderCanvas):
    """A scene to play with, by mouse and by the keys of `taichi-disk view` once it was clicked.

        from taichi_disk.notebook import Sandbox
        Sandbox("exponential_wall", ["material.eta_star=30"])

    It moves while no cell runs, and while it is seen.
    """

    def __init__(
        self, scene: str | Path | Scene, overrides: Sequence[str] = (), out: str | Path = "out/view", height: int = 700
    ) -> None:
        """Saved scenes, films and pictures go into `out`; `height` in pixels, the width is the cell's.

        Raises InputError for a bad scene or a folder that cannot be written, TaichiDiskError where Vulkan is missing.
        """
        runtime.start()
        from taichi_disk.render import require_film
        from taichi_disk.simulation.simulation import KernelCache
        from taichi_disk.window.app import presets
        from taichi_disk.window.canvas import SessionCanvas
        from taichi_disk.window.session import Session

        first = scene if isinstance(scene, Scene) else load_scene(scene, overrides)
        require_film()
        with runtime.alone():
            self._session = Session(presets(first), Path(out), KernelCache())
        super().__init__(size=None, max_fps=FASTEST)
        self.set_css_width("calc(100% - 4px)")  # without its frame
        self.set_css_height(f"{height}px")
        self._shown = SessionCanvas(self, self._session)

    def close(self) -> None:
        """Let go of everything. (That of rendercanvas 2.7 calls itself without end.)"""
        if not self.get_closed():
            self._is_closed: bool = True
            self._shown.end()
            super().close()

    @property
    def scene(self) -> Scene:
        """As it would be saved now: it can be given to `run`."""
        return self._session.sandbox.scene

    @property
    def results(self) -> list[Result]:
        """Of the last scenes that came to their end, the newest last: each with its `value`."""
        return self._session.sandbox.results
