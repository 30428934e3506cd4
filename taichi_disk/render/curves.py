"""The curves beside the disk in a film: grey where they are still to come."""

from __future__ import annotations

from taichi_disk.output.panel import PanelPictures, PanelScene, Picture
from taichi_disk.render.palette import ink

_CURSOR = 2.0  # width of the line at the present time in a picture of 720 pixels [px]


class Curves:
    """Repaints what changes from one picture to the next."""

    def __init__(self, drawn: PanelPictures, scene: PanelScene) -> None:
        """`drawn`: the curves of `scene`."""
        self._width, height = scene.size
        self._times = scene.t
        self._drawn = drawn
        self._cursor = max(round(_CURSOR * height / 720), 1)
        self._ink = ink(scene.colours["faint"])
        # first and last column that must be drawn again whatever the next time is: at
        # first all, then those of the line
        self._stale = 0, self._width

    def draw(self, picture: Picture, t: float) -> None:
        """Draw the curves up to `t` [R/c] and a line there into `picture` (height,
        width, 4), which holds what was drawn before."""
        drawn = self._drawn
        left, right, _, _ = drawn.boxes[0]
        start, *_, end = self._times
        column = left + round((right - left - 1) * (t - start) / (end - start))
        past = max(column, 0)
        if column >= right:
            past = self._width
        first = min(self._stale[0], past)
        last = max(self._stale[1], past)
        picture[:, first:past] = drawn.past[:, first:past]
        picture[:, past:last] = drawn.coming[:, past:last]
        self._stale = past, past + self._cursor
        if left <= column < right:
            for _, _, top, bottom in drawn.boxes:
                picture[top:bottom, column : column + self._cursor, :3] = self._ink
