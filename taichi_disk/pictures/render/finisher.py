"""Finish pictures and encode them: marks, words and curves above what GGUI has drawn.
Needs no Taichi, so that a second process can do it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from taichi_disk.base.processes.early import picture_of
from taichi_disk.pictures.panel import PanelPictures, PanelScene, Picture, draw_panel
from taichi_disk.pictures.render.letters import Line
from taichi_disk.pictures.render.marks import Mark, stamp
from taichi_disk.pictures.render.palette import Ink, ink
from taichi_disk.pictures.render.video import video

# place of GGUI's image in `Finisher.images`, and the marks above it
Drawn = tuple[int, list[Mark]]
# a line, and where its part of the picture begins at the left and at the top [px]
Placed = tuple[Line, float, float]

# width of the line at the present time of curves, in a picture of 720 pixels [px]
_CURSOR = 2.0


@dataclass
class Finisher:
    """Finishes the pictures of one film, and appends them to its file.

    Attributes:
        images: (k, width, height, 4) GGUI's images [x, y upwards, colour].
        still: (height, width, 4) what does not change.
        words: rows and columns of constant words above the disks.
        width, disks: of the picture of one disk, and of all disks [px].
        rows, columns: of the part that GGUI draws.
        supersample: GGUI's pixels across a pixel.
        ground: colour of the background.
        panel: curves at the right.
    """

    images: Picture
    still: Picture
    words: tuple[NDArray[np.intp], ...]
    width: int
    disks: int
    rows: slice
    columns: slice
    supersample: float
    ground: Ink
    panel: PanelScene | None

    def open(self, path: Path, form: str, fps: int, origin: str) -> None:
        """Begin the film. Arguments as for `video.video`."""
        height, width, _ = self.still.shape
        self._picture = self.still.copy()
        # The same memory as pixels of four bytes, and as Pillow's image.
        self._pixels = self._picture.view(np.uint32)[..., 0]
        self._still = self.still.view(np.uint32)[..., 0]
        self._image, self._draw = canvas(self._picture)
        if self.panel:
            self._curves = picture_of(draw_panel, self.panel)
        self._file = ExitStack()
        film = video(path, form, (width, height), fps, origin)
        self._append = self._file.enter_context(film)

    def write(self, drawn: Sequence[Drawn], lines: Sequence[Placed], t: float) -> None:
        """Append the picture with what was drawn of each disk, changing `lines`, and
        the curves up to the time `t` [R/c]."""
        self._pixels[:, : self.disks] = self._still[:, : self.disks]
        for k, (place, marks) in enumerate(drawn):
            columns = slice(k * self.width, (k + 1) * self.width)
            self._place(self._pixels[:, columns], self.images[place])
            for mark in marks:
                corners = mark.corners + [columns.start, 0.0]
                moved = mark._replace(corners=corners)
                stamp(self._image, moved, self.ground, columns)
        self._pixels[self.words] = self._still[self.words]
        for line, left, top in lines:
            line.draw(self._draw, left, top)
        if self.panel:
            part = self._picture[:, self.disks :]
            draw_curves(part, self._curves, self.panel, t)
        self._append(self._picture, True)

    def repeat(self) -> None:
        """Append the last picture again."""
        self._append(self._picture, False)

    def _place(self, part: NDArray[np.uint32], image: Picture) -> None:
        """Place GGUI's image into the picture of a disk. Columns beside it show only
        the background and a rigid wall, so they repeat the outermost ones."""
        # four bytes at a time, which is several times faster
        pixels = shrunk(image, self.supersample).view(np.uint32)[..., 0]
        rows = part[self.rows]
        rows[:, self.columns] = pixels.T[::-1]
        rows[:, : self.columns.start] = rows[:, self.columns.start, None]
        rows[:, self.columns.stop :] = rows[:, self.columns.stop - 1, None]

    def close(self) -> None:
        """Complete the film."""
        self._file.close()


def draw_curves(
    picture: Picture, drawn: PanelPictures, scene: PanelScene, t: float
) -> None:
    """Draw the curves of `scene` into `picture` (height, width, 4): in colour up to `t`
    [R/c], then a line, and grey where they are still to come."""
    left, right, _, _ = drawn.boxes[0]
    start, end = scene.t[[0, -1]]
    column = left + round((right - left - 1) * (t - start) / (end - start))
    past = max(column, 0)
    if column >= right:
        past, _ = scene.size
    picture[:, :past] = drawn.past[:, :past]
    picture[:, past:] = drawn.coming[:, past:]
    if left <= column < right:
        width = max(round(_CURSOR * len(picture) / 720), 1)
        for _, _, top, bottom in drawn.boxes:
            line = picture[top:bottom, column : column + width, :3]
            line[:] = ink(scene.colours["faint"])


def canvas(picture: Picture) -> tuple[Any, Any]:
    """Return Pillow's image of the memory of `picture` (height, width, 4), and its
    `ImageDraw`."""
    height, width, _ = picture.shape
    size = width, height
    image: Any = Image.frombuffer("RGBA", size, picture, "raw", "RGBA", 0, 1)
    image.readonly = 0
    return image, ImageDraw.Draw(image)


def shrunk(pixels: Picture, samples: float) -> Picture:
    """Return an image (k, l, 4) that is `samples` times smaller, by averages over the
    area of a pixel."""
    if samples == 1.0:
        return pixels
    rows, columns, _ = pixels.shape
    size = columns, rows
    image = Image.frombuffer("RGBX", size, pixels, "raw", "RGBX", 0, 1)
    # `reduce` takes whole numbers only, and `samples` may be 1.5.
    twice = image.resize((2 * columns, 2 * rows), Image.Resampling.NEAREST)
    return np.asarray(twice.reduce(round(2.0 * samples)))
