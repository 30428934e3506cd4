"""The sandbox as a widget of a notebook: JupyterLab, VS Code, marimo. Needs the extra
`notebook`."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from taichi_disk import runtime
from taichi_disk.errors import TaichiDiskError, install_extra
from taichi_disk.scenes import Scene, load_scene
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.web.drawing import SANDBOX, bundle, source
from taichi_disk.window.app import list_presets
from taichi_disk.window.page import Message, Page
from taichi_disk.window.sandbox import Experiment
from taichi_disk.window.session import Session

try:
    import traitlets
    from anywidget import AnyWidget
except ImportError as error:
    raise TaichiDiskError(
        f"no widget, because of {error}: {install_extra('notebook')}"
    ) from None


class Sandbox(AnyWidget):
    """A scene to play with, as on the page of `taichi-disk view`.

        from taichi_disk.notebook import Sandbox
        Sandbox("exponential_wall", ["material.eta_star=30"])

    The disk moves only while no cell runs and the widget is visible.
    """

    height = traitlets.Int(900).tag(sync=True)

    def __init__(
        self,
        scene: str | Path | Scene,
        overrides: Sequence[str] = (),
        height: int = 900,
    ) -> None:
        """`height` in pixels; the width is the cell's.

        Raises InputError for a bad scene, RuntimeError if no event loop runs.
        """
        # `close` is called even if the scene is refused
        self._views: dict[float, Page] = {}
        runtime.start()
        self._loop = asyncio.get_running_loop()
        first = scene if isinstance(scene, Scene) else load_scene(scene, overrides)
        with runtime.alone():
            self._session = Session(list_presets(first), KernelCache())
        (page,) = re.findall(r"<main.*</main>", source("index.html"), re.DOTALL)
        constants = (
            f"const PAGE = {json.dumps(page)}, STYLE ="
            f" {json.dumps(source('style.css'))};\n"
        )
        super().__init__(_esm=constants + bundle(*SANDBOX, "widget.js"), height=height)
        # JupyterLab delivers messages in a second thread, where an event that is set
        # does not wake up the loop.
        self.on_msg(
            lambda _, message, buffers: self._loop.call_soon_threadsafe(
                self._hear, message
            )
        )

    def _hear(self, message: Any) -> None:
        """Handle a message from a view: it opens or closes, or sends a command as a
        page does."""
        name = message.pop("visitor")
        view = self._views.get(name)
        if message["do"] == "open":
            self._views[name] = Page(self._session, partial(self._show, name))
        elif view and message["do"] == "close":
            self._views.pop(name).leave()
        elif view:
            view.hear(json.dumps(message))

    def _show(self, name: float, message: Message) -> None:
        """Send a text or a state to one view."""
        if isinstance(message, str):
            self.send({"to": name, "text": message}, [])
        else:
            self.send({"to": name}, [message])

    def close(self) -> None:
        """End the sandbox in all its views."""
        while self._views:
            self._views.popitem()[1].leave()
        super().close()

    @property
    def scene(self) -> Scene:
        """The present scene as it would be saved, for example for `run`."""
        return self._session.sandbox.scene

    @property
    def results(self) -> list[Experiment]:
        """The rows of the table of results, the newest last; `value` is e or ξ [R]."""
        return self._session.sandbox.results
