"""The film to play with that a page saves."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from taichi_disk.computation.outcome import compute
from taichi_disk.progress import silent
from taichi_disk.scenes.setup import body_of
from taichi_disk.web.film import film
from taichi_disk.window.sandbox import Sandbox


class Films:
    """Makes films of the scene of `sandbox`.

    Attributes:
        page: the last film, an HTML page that nobody has taken yet, or "".
    """

    def __init__(self, sandbox: Sandbox) -> None:
        self.page = ""
        self._sandbox = sandbox

    def film(self) -> None:
        """Make the film of the scene from its start, as `run` computes it. Raises
        TaichiDiskError."""
        scene = self._sandbox.scene
        outcome = compute(scene.scenario(body_of(scene)), estimate=False)
        with TemporaryDirectory() as folder:
            path = Path(folder, "disk.html")
            write = film(path, [outcome], scene.video, silent)
            write()
            self.page = path.read_text(encoding="utf-8")

    def take(self) -> str:
        """Return the last film and forget it."""
        page = self.page
        self.page = ""
        return page
