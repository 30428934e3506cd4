"""The window: keeps the clock, hands keys and mouse on to the controls, shows drawing and panel."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Generator, Iterator
from pathlib import Path
from time import perf_counter

import numpy as np
import taichi as ti

from taichi_disk.errors import TaichiDiskError
from taichi_disk.output import prepare_output
from taichi_disk.render.colours import GROUND
from taichi_disk.scene import Scene
from taichi_disk.view.controls import Controls
from taichi_disk.view.drawing import SMALLEST, Drawing
from taichi_disk.view.keys import Keys
from taichi_disk.view.panel import WIDTH, Panel
from taichi_disk.view.readings import readings
from taichi_disk.view.sandbox import PATIENCE, Sandbox
from taichi_disk.view.shots import Shots

TITLE = "taichi-disk view"
SIZE = (1180, 860)
_LONGEST = 0.1  # a picture that took longer does not make the next step longer [s]
_PICTURE = 1.0 / 32.0  # what computing and drawing may take together [s]
_NAMES = {
    ti.ui.SPACE: "space",
    ti.ui.UP: "Up",
    ti.ui.DOWN: "Down",
    ti.ui.LEFT: "Left",
    ti.ui.RIGHT: "Right",
    ti.ui.ESCAPE: "Escape",
}


class Viewer:
    """Holds the one window that may be alive; `run` returns when it has been closed.

    Attributes:
        sandbox, controls: what is in it, from the first picture on.
    """

    def __init__(self, scene: Scene, out: Path) -> None:
        """Files go into `out`. Raises InputError if it cannot be written, TaichiDiskError if there is no window."""
        prepare_output(out)
        self._scene, self._out = scene, out.resolve()
        try:
            self._window = ti.ui.Window(TITLE, SIZE, show_window=True)
        except RuntimeError as error:
            raise TaichiDiskError(f"no window: {error}") from error
        self._ready = False

    def run(self) -> None:
        """Until the window is closed. Raises TaichiDiskError for a scene that cannot be built."""
        for _ in self.pictures():
            pass

    def pictures(self) -> Generator[tuple[float, int], None, None]:
        """`run`, picture by picture: seconds of the clock since the one before, steps made for it."""
        with _elsewhere():  # GGUI leaves an imgui.ini in the current folder
            try:
                self._set_up()
                yield from self._loop()
            finally:
                if self._ready:
                    self._shots.stop()
                self._window.destroy()

    def _set_up(self) -> None:
        self.sandbox = Sandbox(self._scene, self._one_moment)
        self.controls = Controls(self.sandbox, self._out)
        self._keys = Keys(self.controls)
        self._panel = Panel(self._window.get_gui(), self.controls, self._keys)
        self._drawing = Drawing(self._window.get_canvas(), self.controls)
        self._shots = Shots(self.controls, self._window.get_image_buffer_as_numpy)
        self._ready = True

    def _loop(self) -> Generator[tuple[float, int], None, None]:
        rates, frames, steps, since = "", 0, 0, perf_counter()
        last, drawing = since, 0.0
        while self._window.running and not self.controls.closing:
            now = perf_counter()
            elapsed, last, made = now - last, now, 0
            if not self.controls.mouse.turning:
                patience = min(max(_PICTURE - drawing, 0.25 * PATIENCE), PATIENCE)
                made = self.sandbox.advance(min(elapsed, _LONGEST), patience)
            frames, steps = frames + 1, steps + made
            if now - since > 0.5:
                rates = f"{frames / (now - since):.0f} frames/s, {steps / (now - since):,.0f} steps/s"
                frames, steps, since = 0, 0, now
            began = perf_counter()
            self._drawing.draw(self._size)
            self._panel.show(self._size[0], self.sandbox.message, [*readings(self.sandbox), rates])
            self._shots.take(elapsed, self._drawing.camera)
            self._window.show()
            drawing = 0.9 * drawing + 0.1 * (perf_counter() - began)
            self._listen()
            yield elapsed, made

    def _one_moment(self) -> None:
        """Between two pictures: say why the next one takes a second."""
        gui = self._window.get_gui()
        for _ in range(2):  # ImGui shows nothing in its first picture
            if self._ready:
                self._drawing.again()
                self._panel.show(self._size[0], self.sandbox.message, readings(self.sandbox))
            else:
                self._window.get_canvas().set_background_color(GROUND)
            with gui.sub_window("One moment", WIDTH / self._size[0] + 0.02, 0.02, 0.4, 0.08):
                gui.text("Compiling for this scene...")
            self._window.show()

    @property
    def _size(self) -> tuple[int, int]:
        # A window put away as an icon has no size.
        width, height = (max(pixels, SMALLEST) for pixels in self._window.get_window_shape())
        return width, height

    # ---- keys and mouse

    def _listen(self) -> None:
        for event in self._window.get_events(ti.ui.PRESS):
            if event.key != ti.ui.LMB:
                self._keys.press(_NAMES.get(event.key, event.key))
            elif self._window.get_cursor_pos()[0] * self._size[0] > WIDTH:
                self.controls.mouse.press(*self._pointed())
        held, mouse = self._window.is_pressed(ti.ui.LMB), self.controls.mouse
        self._panel.carry_out()
        if not held:
            self.controls.build()
        if mouse.holding:
            if held:
                mouse.move(*self._pointed())
            else:
                mouse.release()

    def _pointed(self) -> tuple[float, float]:
        """Where the mouse is in the scene [R]."""
        factor, shift = self._drawing.camera.canvas_map()
        x, y = (np.array(self._window.get_cursor_pos()) - shift) / factor
        return float(x), float(y)


@contextlib.contextmanager
def _elsewhere() -> Iterator[None]:
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(here)
