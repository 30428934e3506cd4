"""What is seen without the panel, as files: films and pictures."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import ExitStack

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from taichi_disk.errors import TaichiDiskError
from taichi_disk.output.files import atomic_write, hidden, origin, reason, remove
from taichi_disk.render import kernels
from taichi_disk.render.video import Picture, video
from taichi_disk.window.controls import Controls

FPS = 30  # of a film


class Recorder:
    """Writes a film while `controls` say so, and single pictures."""

    def __init__(self, controls: Controls) -> None:
        self._controls = controls
        self._open = ExitStack()
        self._write: Callable[[Callable[[], Picture]], None] | None = None
        self._seconds, self._frames = 0.0, 0

    def take(self, seconds: float, read: Callable[[], NDArray[np.float32]], panel: float) -> None:
        """After each drawing, `seconds` of the clock after the one before.

        `read` gives what was drawn, (width, height, 4) from 0 to 1, rows upwards; `panel`: what part of its width is
        left out at the left.
        """
        controls = self._controls
        if not controls.recording:
            self.stop()
        if self._write:
            self._seconds += seconds
        due = int(self._seconds * FPS) + 1 - self._frames
        if not (controls.picture_wanted or (controls.recording and due > 0)):
            return
        picture = picture_of(read(), panel)
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
        path, info, sandbox = self._controls.next_file(".png"), PngInfo(), self._controls.sandbox
        seen = sandbox.seen
        facts = {"scene": sandbox.scene.to_yaml(), "changed by hand": str(seen.by_hand), "t": repr(seen.t)}
        for name, text in (facts | {name: repr(value) for name, value in seen.values.items()}).items():
            info.add_text(name, text)
        atomic_write(path, lambda new: Image.fromarray(picture).save(new, pnginfo=info))
        self._controls.picture_wanted, sandbox.message = False, f"wrote {path}"

    def _film(self, picture: Picture, count: int) -> None:
        """Let `count` frames of the film show a picture; it ends where the window gets another size."""
        if self._write is None:
            self._new, self._shape = hidden(self._controls.next_file(".mp4")), picture.shape
            told = origin(self._controls.sandbox.scene)
            film = video(self._new, ".mp4", picture.shape[1], picture.shape[0], FPS, told)
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
            self._write, self._seconds, self._frames = None, 0.0, 0
            try:
                self._open.close()
                path = self._controls.next_file(".mp4")
                os.replace(self._new, path)
                self._controls.sandbox.message = f"wrote {path}"
            except (OSError, TaichiDiskError) as error:
                self._controls.sandbox.message = f"cannot write the film: {reason(error)}"
            finally:
                remove(self._new)


def picture_of(drawn: NDArray[np.float32], panel: float = 0.0) -> Picture:
    """(rows, columns, 3) without the `panel`, rows downwards; an odd last row or column is left out."""
    view = drawn[round(panel * len(drawn)) :]
    width, height = (pixels // 2 * 2 for pixels in view.shape[:2])
    picture = np.empty((height, width, 3), np.uint8)
    kernels.shrink(np.ascontiguousarray(view), picture, 0, height, 0, 2)
    return picture
