"""What is seen in the window, as files: a film while it is recorded, and single pictures."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from taichi_disk.errors import SimulationError
from taichi_disk.output import atomic_write, remove
from taichi_disk.render.video import Video

FPS = 30


class Recorder:
    """A film that grows with the clock; `close` makes it a file. All pictures have the size of the first."""

    def __init__(self, free: Callable[[], Path], picture: NDArray[np.uint8]) -> None:
        """`picture` (height, width, 3), rows downwards; an odd last row or column is left out.

        `free` names a file that is not there; `close` asks again, for another window may have taken that `path`.
        """
        path = free()
        self.path, self._free = path, free
        self._shape = picture.shape
        self._beside = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
        self._height, self._width = picture.shape[0] // 2 * 2, picture.shape[1] // 2 * 2
        self._video = Video(self._beside, self._width, self._height, FPS)
        self._seconds, self._frames = 0.0, 0

    def fits(self, picture: NDArray[np.uint8]) -> bool:
        """Whether the picture has the film's size: not after the window was resized."""
        return picture.shape == self._shape

    def add(self, picture: NDArray[np.uint8], seconds: float) -> None:
        """Show `picture`, `seconds` of the clock after the one before, for as many frames as are due."""
        self._seconds += seconds
        due = int(self._seconds * FPS) + 1 - self._frames
        if due > 0:
            padded = np.zeros((self._height, self._width, 4), dtype=np.uint8)
            padded[..., :3] = picture[: self._height, : self._width]
            for _ in range(due):
                self._video.write(padded)
            self._frames += due

    def close(self) -> None:
        """Complete the film. Raises SimulationError if it could not be written; then there is none."""
        try:
            self._video.__exit__(None, None, None)
            self.path = self._free()
            os.replace(self._beside, self.path)
        except OSError as error:
            raise SimulationError(f"cannot write {self.path}: {error.strerror}") from error
        finally:
            remove(self._beside)


def write_picture(path: Path, picture: NDArray[np.uint8], facts: dict[str, str]) -> None:
    """A PNG that carries `facts` as its text."""
    info = PngInfo()
    for name, value in facts.items():
        info.add_text(name, value)

    def write(beside: Path) -> None:
        Image.fromarray(picture).save(beside, pnginfo=info)

    atomic_write(path, write)
