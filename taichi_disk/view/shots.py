"""Pictures and films of what is seen beside the panel."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import TaichiDiskError
from taichi_disk.render.camera import Camera
from taichi_disk.view.controls import Controls
from taichi_disk.view.drawing import SMALLEST
from taichi_disk.view.panel import WIDTH
from taichi_disk.view.recorder import Recorder, write_picture

Read = Callable[[], NDArray[np.float32]]


class Shots:
    """Does what `controls` wish: writes single pictures, and a film while they say so."""

    def __init__(self, controls: Controls, read: Read) -> None:
        """`read` gives what was drawn, (width, height, 4) from 0 to 1, rows upwards."""
        self._controls, self._read = controls, read
        self._recorder: Recorder | None = None

    def take(self, seconds: float, camera: Camera) -> None:
        """After each drawing, `seconds` of the clock after the one before; `camera` is what it was drawn through."""
        controls, sandbox = self._controls, self._controls.sandbox
        if not controls.recording:
            self.stop()
        if not (controls.recording or controls.picture_wanted):
            return
        picture = self._picture()
        try:
            if controls.picture_wanted:
                controls.picture_wanted = False
                path = controls.next_file(".png")
                write_picture(path, picture, self._facts(camera))
                sandbox.message = f"wrote {path}"
            if controls.recording:
                if self._recorder and not self._recorder.fits(picture):
                    self.stop()
                if not self._recorder:
                    self._recorder = Recorder(partial(controls.next_file, ".mp4"), picture)
                    sandbox.message = f"recording {self._recorder.path}"
                self._recorder.add(picture, seconds)
        except TaichiDiskError as error:
            controls.recording = False
            self.stop()  # a film goes to its end where only a picture could not be written
            sandbox.message = str(error)

    def stop(self) -> None:
        """Complete the film, if there is one."""
        if not self._recorder:
            return
        recorder, self._recorder = self._recorder, None
        try:
            recorder.close()
            self._controls.sandbox.message = f"wrote {recorder.path}"
        except TaichiDiskError as error:
            self._controls.sandbox.message = str(error)

    def _picture(self) -> NDArray[np.uint8]:
        """(height, width, 3), rows downwards."""
        samples = self._read()
        stage = samples[min(WIDTH, len(samples) - SMALLEST) :, :, :3]
        return np.ascontiguousarray((255.0 * stage + 0.5).astype(np.uint8).transpose(1, 0, 2)[::-1])

    def _facts(self, camera: Camera) -> dict[str, str]:
        sandbox = self._controls.sandbox
        row = sandbox.motion.ledger.now()
        com = camera.to_pixels(np.array([row["com_x"], row["com_y"]]))
        facts = {
            "scene": sandbox.saved_scene().to_yaml(),
            "changed by hand": str(sandbox.motion.changed),
            "t": repr(sandbox.motion.ledger.t),
            "pixels": f"centre of mass at {com[0] - WIDTH:.2f} {com[1]:.2f}, {camera.scale:.4f} per R",
        }
        return facts | {name: repr(value) for name, value in row.items()}
