"""What is seen in the window, as files: a film while it is recorded, and single pictures. The panels are left out."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import ExitStack

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from taichi_disk.errors import TaichiDiskError
from taichi_disk.output.files import atomic_write, beside, reason, remove
from taichi_disk.render import kernels
from taichi_disk.render.video import Picture, video
from taichi_disk.window.controls import Controls
from taichi_disk.window.stage import PANEL

FPS = 30


class Recorder:
    """Does what `controls` wish; `read` gives what was drawn, (width, height, 4) from 0 to 1, rows upwards."""

    def __init__(self, controls: Controls, read: Callable[[], NDArray[np.float32]]) -> None:
        self._controls, self._read = controls, read
        self._open = ExitStack()
        self._write: Callable[[Callable[[], Picture]], None] | None = None
        self._seconds, self._frames = 0.0, 0

    def take(self, seconds: float) -> None:
        """After each drawing, `seconds` of the clock after the one before."""
        controls = self._controls
        if not controls.recording:
            self.stop()
        self._seconds = self._seconds + seconds if self._write else 0.0
        due = int(self._seconds * FPS) + 1 - (self._frames if self._write else 0)
        if not (controls.picture_wanted or (controls.recording and due > 0)):
            return
        picture = picture_of(self._read())
        try:
            if controls.picture_wanted:
                self._keep(picture)
            if controls.recording:
                self._film(picture, due)
        except (OSError, TaichiDiskError) as error:
            controls.recording = controls.picture_wanted = False
            self.stop()
            controls.sandbox.message = f"cannot write: {reason(error)}"

    def _keep(self, picture: Picture) -> None:
        """A PNG that carries its numbers as text."""
        path, info = self._controls.next_file(".png"), PngInfo()
        for name, value in self._facts().items():
            info.add_text(name, value)
        atomic_write(path, lambda new: Image.fromarray(picture).save(new, pnginfo=info))
        self._controls.picture_wanted, self._controls.sandbox.message = False, f"wrote {path}"

    def _film(self, picture: Picture, count: int) -> None:
        """Let `count` frames of the film show a picture; it ends where the window gets another size."""
        if self._write is None:
            self._new, self._shape, self._frames = beside(self._controls.next_file(".mp4")), picture.shape, 0
            film = video(self._new, ".mp4", picture.shape[1], picture.shape[0], FPS)
            self._write = self._open.enter_context(film)
        elif picture.shape != self._shape:
            self._controls.recording = False
            return
        for _ in range(count):
            self._write(lambda: picture)
        self._frames += count

    def stop(self) -> None:
        """Complete the film, if there is one."""
        if self._write:
            self._write = None
            try:
                self._open.close()
                path = self._controls.next_file(".mp4")
                os.replace(self._new, path)
                self._controls.sandbox.message = f"wrote {path}"
            except (OSError, TaichiDiskError) as error:
                self._controls.sandbox.message = f"cannot write the film: {reason(error)}"
            finally:
                remove(self._new)

    def _facts(self) -> dict[str, str]:
        sandbox, moment = self._controls.sandbox, self._controls.sandbox.moment
        facts = {"scene": sandbox.scene.to_yaml(), "changed by hand": str(moment.by_hand), "t": repr(moment.t)}
        return facts | {name: repr(value) for name, value in moment.values.items()}


def picture_of(drawn: NDArray[np.float32]) -> Picture:
    """(rows, columns, 3) without the panels, rows downwards; an odd last row or column is left out."""
    stage = drawn[min(PANEL, len(drawn) - 2) :]
    width, height = (pixels // 2 * 2 for pixels in stage.shape[:2])
    picture = np.empty((height, width, 3), np.uint8)
    kernels.shrink(np.ascontiguousarray(stage), picture, 0, height, 0, 2)
    return picture
