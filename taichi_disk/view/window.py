"""The window: draws the sandbox, hands keys, mouse and panel on to the controls, keeps the clock."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.errors import TaichiDiskError
from taichi_disk.output import prepare_output
from taichi_disk.render.camera import Camera
from taichi_disk.render.colouring import COLOURINGS, QUANTITIES, spring_values
from taichi_disk.render.painter import Painter
from taichi_disk.render.picture import Subject
from taichi_disk.view.controls import SHOWS, Controls
from taichi_disk.view.graph import Graph
from taichi_disk.view.panel import WIDTH, Panel
from taichi_disk.view.recorder import Recorder, write_picture
from taichi_disk.view.sandbox import Sandbox

TITLE = "taichi-disk view"
SIZE = (1180, 800)
_GRAPH = 110  # height of the running graph [px]
_MARGIN = 16  # [px]
_SMALLEST = 40  # what is left for the disk in a window however small [px]
_LONGEST = 0.1  # a picture that took longer does not make the next step longer [s]
_NAMES = {
    ti.ui.SPACE: "space",
    ti.ui.UP: "Up",
    ti.ui.DOWN: "Down",
    ti.ui.LEFT: "Left",
    ti.ui.RIGHT: "Right",
    ti.ui.ESCAPE: "Escape",
}


class Viewer:
    """Holds the one window that may be alive; `run` returns when it has been closed."""

    def __init__(self, sandbox: Sandbox, out: Path) -> None:
        """Files go into `out`. Raises InputError if it cannot be written, TaichiDiskError if there is no window."""
        prepare_output(out)
        self.sandbox, self.controls = sandbox, Controls(sandbox, out.resolve())
        try:
            self._window = ti.ui.Window(TITLE, SIZE, show_window=True)
        except RuntimeError as error:
            raise TaichiDiskError(f"no window: {error}") from error
        self._canvas = self._window.get_canvas()
        self._panel = Panel(self._window.get_gui(), self.controls)
        self._graph = Graph()
        self._tie = ti.Vector.field(2, ti.f32, 2)
        self._painter: Painter | None = None
        self._drawn: tuple[Any, ...] = ()
        self._shape = (0, 0)
        self._recorder: Recorder | None = None

    def run(self) -> None:
        """Until the window is closed."""
        with _elsewhere():  # GGUI leaves an imgui.ini in the current folder
            try:
                self._loop()
            finally:
                self._stop_recording()
                self._window.destroy()

    def _loop(self) -> None:
        rates, frames, steps, since = "", 0, 0, perf_counter()
        last = since
        while self._window.running:
            now = perf_counter()
            elapsed, last = now - last, now
            self._listen()
            if not self.controls.mouse.turning:
                steps += self.sandbox.advance(min(elapsed, _LONGEST))
            frames += 1
            if now - since > 0.5:
                rates = f"{frames / (now - since):.0f} frames/s, {steps / (now - since):,.0f} steps/s"
                frames, steps, since = 0, 0, now
            self._draw()
            self._panel.show(self._shape[0], rates)
            self._take_pictures(elapsed)
            self._window.show()

    # ---- drawing

    def _draw(self) -> None:
        # A window put away as an icon has no size.
        width, height = (max(pixels, _SMALLEST) for pixels in self._window.get_window_shape())
        motion = self.sandbox.motion
        setup, view = motion.setup, motion.setup.view
        # Whatever one of these changes, the camera sees; another lattice needs another painter.
        if self._painter is None or self._drawn[0] is not setup.lattice.bonds:
            if self._painter:
                self._painter.destroy()
            subject = Subject(setup.lattice, setup.physics.wall == "rigid", (), 1.0, view)
            self.camera = self._look(view, width, height)
            self._painter = Painter(subject, self.camera, self._unit(height))
        elif (width, height, view) != self._drawn[1:]:
            self.camera = self._look(view, width, height)
            self._painter.aim(self.camera, self._unit(height))
        self._shape, self._drawn = (width, height), (setup.lattice.bonds, width, height, view)
        colouring, x, v = COLOURINGS[self.controls.colouring_number], motion.positions, motion.velocities
        values = self.controls.scale.places(spring_values(setup.lattice, motion.world.physics, x, v, colouring))
        signed = QUANTITIES[colouring].signed
        self._painter.paint(self._canvas, x, values, SHOWS[self.controls.show_number], signed)
        tie = self.controls.mouse.tie
        if tie is not None:
            self._tie.from_numpy(self._on_canvas(tie).astype(np.float32))
            self._canvas.lines(self._tie, width=2.0 / height, color=(0.85, 0.45, 0.0))
        box = ((WIDTH + _MARGIN) / width, 1.0 - _MARGIN / width, _MARGIN / height, _GRAPH / height)
        self._graph.paint(self._canvas, self.sandbox, box, 1.5 / height)

    @staticmethod
    def _unit(height: int) -> float:
        return max(height, _SMALLEST) / 720

    @staticmethod
    def _look(view: tuple[float, float, float, float], width: int, height: int) -> Camera:
        """A camera whose stage is the whole window, with `view` in the part that panel and graph leave free."""
        wide, high = max(width - WIDTH, _SMALLEST), max(height - _GRAPH, _SMALLEST)
        fitted = Camera.fit(view, 0, 0, wide, high, min(_MARGIN, wide // 4, high // 4))
        x, y = fitted.centre
        scale = fitted.scale
        # The middle of what is left free, at the right and above, shows the middle of the view.
        centre = (x - (width / 2 - wide / 2) / scale, y - (height / 2 - high / 2) / scale)
        return Camera(0, 0, width, height, scale, centre)

    def _on_canvas(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        factor, shift = self.camera.canvas_map()
        return np.asarray(factor * xy + shift)

    # ---- keys and mouse

    def _listen(self) -> None:
        for event in self._window.get_events(ti.ui.PRESS):
            key = _NAMES.get(event.key, event.key)
            if key == "q":
                self._window.running = False
            elif event.key != ti.ui.LMB:
                self.controls.press(key)
            elif self._painter and self._window.get_cursor_pos()[0] * self._shape[0] > WIDTH:
                self.controls.mouse.press(*self._pointed())
        mouse = self.controls.mouse
        if not mouse.holding:
            return
        if self._window.is_pressed(ti.ui.LMB):
            mouse.move(*self._pointed())
        else:
            mouse.release()

    def _pointed(self) -> tuple[float, float]:
        """Where the mouse is in the scene [R]."""
        factor, shift = self.camera.canvas_map()
        x, y = (np.array(self._window.get_cursor_pos()) - shift) / factor
        return float(x), float(y)

    # ---- pictures

    def _take_pictures(self, elapsed: float) -> None:
        controls = self.controls
        if not controls.recording:
            self._stop_recording()
        if not (controls.recording or controls.picture_wanted):
            return
        picture = self._read()
        try:
            if controls.picture_wanted:
                controls.picture_wanted = False
                path = controls.next_file(".png")
                write_picture(path, picture, self._facts())
                self.sandbox.message = f"wrote {path}"
            if controls.recording:
                if self._recorder and not self._recorder.fits(picture):
                    self._stop_recording()
                if not self._recorder:
                    self._recorder = Recorder(controls.next_file(".mp4"), picture)
                    self.sandbox.message = f"recording {self._recorder.path}"
                self._recorder.add(picture, elapsed)
        except TaichiDiskError as error:
            controls.recording, self._recorder, self.sandbox.message = False, None, str(error)

    def _read(self) -> NDArray[np.uint8]:
        """What is seen beside the panel, (height, width, 3), rows downwards."""
        samples = self._window.get_image_buffer_as_numpy()
        stage = samples[min(WIDTH, len(samples) - _SMALLEST) :, :, :3]
        return np.ascontiguousarray((255.0 * stage + 0.5).astype(np.uint8).transpose(1, 0, 2)[::-1])

    def _facts(self) -> dict[str, str]:
        sandbox = self.sandbox
        row = sandbox.motion.ledger.now()
        com = self.camera.to_pixels(np.array([row["com_x"], row["com_y"]]))
        facts = {
            "scene": sandbox.saved_scene().to_yaml(),
            "changed by hand": str(sandbox.motion.changed),
            "t": repr(sandbox.motion.ledger.t),
            "pixels": f"centre of mass at {com[0] - WIDTH:.2f} {com[1]:.2f}, {self.camera.scale:.4f} per R",
        }
        return facts | {name: repr(value) for name, value in row.items()}

    def _stop_recording(self) -> None:
        if not self._recorder:
            return
        recorder, self._recorder = self._recorder, None
        try:
            recorder.close()
            self.sandbox.message = f"wrote {recorder.path}"
        except TaichiDiskError as error:
            self.sandbox.message = str(error)


@contextlib.contextmanager
def _elsewhere() -> Iterator[None]:
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(here)
