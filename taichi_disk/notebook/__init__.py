"""The sandbox as a widget of a notebook: JupyterLab, VS Code, marimo. Needs the extra `notebook`."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taichi_disk import runtime
from taichi_disk.errors import TaichiDiskError, pip_install
from taichi_disk.scenes import Scene, load_scene
from taichi_disk.web.drawing import DRAWING, bundle, source

try:
    import traitlets
    from anywidget import AnyWidget
except ImportError as error:
    raise TaichiDiskError(f"no widget, because of {error}: {pip_install('taichi-disk[notebook]')}") from None

if TYPE_CHECKING:
    from taichi_disk.window.audience import Visitor
    from taichi_disk.window.sandbox import Result

_MODULES = (*DRAWING, "message.js", "graphs.js", "controls.js", "sandbox.js", "widget.js")


class Sandbox(AnyWidget):
    """A scene to play with, as on the page of `taichi-disk view`.

        from taichi_disk.notebook import Sandbox
        Sandbox("exponential_wall", ["material.eta_star=30"])

    It moves while no cell runs, and while it is seen.
    """

    height = traitlets.Int(760).tag(sync=True)

    def __init__(self, scene: str | Path | Scene, overrides: Sequence[str] = (), height: int = 760) -> None:
        """`height` in pixels; the width is the cell's. Raises InputError for a bad scene."""
        runtime.start()
        from taichi_disk.simulation.simulation import KernelCache
        from taichi_disk.window.app import presets
        from taichi_disk.window.audience import Audience
        from taichi_disk.window.session import Session

        first = scene if isinstance(scene, Scene) else load_scene(scene, overrides)
        with runtime.alone():
            self._session = Session(presets(first), KernelCache())
        self._audience = Audience(self._session, all_play=True)
        self._views: dict[float, Visitor] = {}
        page = re.search(r"<main.*</main>", source("index.html"), re.DOTALL)
        assert page
        constants = f"const PAGE = {json.dumps(page[0])}, STYLE = {json.dumps(source('style.css'))};\n"
        super().__init__(_esm=constants + bundle(*_MODULES), height=height)
        self.on_msg(self._hear)

    def _hear(self, _: Any, message: Any, buffers: list[bytes]) -> None:
        """A view opens, closes, or says what a page says."""
        from taichi_disk.window.audience import Visitor

        name = message.pop("visitor")

        async def send(content: str | bytes) -> None:
            text = isinstance(content, str)
            self.send({"to": name} | ({"text": content} if text else {}), [] if text else [content])

        if message["do"] == "open":
            self._views[name] = Visitor(send)
            self._audience.join(self._views[name])
        elif message["do"] == "close":
            self._audience.leave(self._views.pop(name))
        elif name in self._views:
            self._audience.hear(self._views[name], json.dumps(message))

    def close(self) -> None:
        """Let go of everything."""
        for one in self._views.values():
            self._audience.leave(one)
        self._views.clear()
        super().close()

    @property
    def scene(self) -> Scene:
        """As it would be saved now: it can be given to `run`."""
        return self._session.sandbox.scene

    @property
    def results(self) -> list[Result]:
        """Of the last experiments that came to their end, the newest last: each with its `value`."""
        return self._session.sandbox.results
