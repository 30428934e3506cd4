"""The curves beside the disk in a film: grey where they are still to come."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from taichi_disk.output.artist import Artist
from taichi_disk.output.panel import (
    ON_DARK,
    PanelPictures,
    PanelScene,
    draw_panel,
    factored,
)
from taichi_disk.output.plot import axis_labels, curves, last_motion
from taichi_disk.render.moments import Run, contact_of
from taichi_disk.render.palette import THEMES

Picture = NDArray[np.uint8]

_BESIDE_CONTACT = 0.32  # shown before and after a contact, over its duration
_COMING = {"light": "#B8B8B7", "dark": "#54575E"}
# radius of a dot, and width of the rim around it, in a picture of 720 pixels [px]
_DOT = 5.0
_RIM = 1.2


def begin_panel(
    artist: Artist, run: Run, size: tuple[int, int], letter: float, theme: str
) -> Panel:
    """Let `artist` begin to draw the panel, and return it. `size`: (width, height)
    [px]; `letter`: size of the titles' letters [px]."""
    columns = run.series
    # Twice as many samples as columns are enough, and quick to send.
    times = np.linspace(*_span(run), 2 * size[0])
    shown = []
    labels = []
    for panel, label in enumerate(axis_labels(run.scenario.words)):
        group = [one for one in curves(run.scenario, columns) if one.panel == panel]
        largest = max(float(np.abs(one.values).max()) for one in group)
        text, unit = factored(label, largest)
        labels.append(text)
        for one in group:
            # before t = 0 a curve is constant
            values = np.interp(times, columns["t"], one.values / unit)
            colour = ON_DARK[one.colour] if theme == "dark" else one.colour
            shown.append(replace(one, values=values.astype(np.float32), colour=colour))
    names = ("ground", "ink", "faint", "rule")
    colours = {name: getattr(THEMES[theme], name) for name in names}
    scene = PanelScene(
        t=times,
        curves=shown,
        labels=labels,
        time_label=run.scenario.words.time,
        size=size,
        letter=letter,
        colours=colours | {"coming": _COMING[theme]},
    )
    return Panel(artist.begin(draw_panel, scene), scene)


def _span(run: Run) -> tuple[float, float]:
    """Return the first and last time of the curves [R/c]."""
    t = run.series["t"]
    if not run.scenario.is_thrown:
        return float(t[0]), last_motion(run.series)
    start, end = contact_of(run)
    beside = _BESIDE_CONTACT * (end - start)
    return start - beside, min(end + beside, float(t[-1]))


class Panel:
    """Repaints what changes from one picture to the next. `width` [px]."""

    def __init__(self, drawn: Callable[[], PanelPictures], scene: PanelScene) -> None:
        self.width, height = scene.size
        unit = height / 720
        self._span = scene.t[[0, -1]]
        self._drawn = lru_cache(drawn)
        self._cursor = np.rint(255.0 * np.array([*scene.colours["faint"], 1.0]))
        self._cursor_width = max(round(2.0 * unit), 1)
        # Each dot covers a square of pixels, by parts from 0 to 1.
        self._reach = round(_DOT * unit) + 4
        places = np.arange(-self._reach, self._reach + 1)
        distances = np.hypot(places[:, None], places)[..., None]
        radius = max(_DOT * unit, 2.5)
        disc = np.clip(radius + 0.5 - distances, 0.0, 1.0)
        rimmed = np.clip(radius + _RIM + 0.5 - distances, 0.0, 1.0)
        ground = 255.0 * np.asarray(scene.colours["ground"])
        inks = [np.array([*bytes.fromhex(one.colour[1:])]) for one in scene.curves]
        self._free = 1.0 - rimmed
        self._dots = [(rimmed - disc) * ground + disc * ink for ink in inks]

    def draw(self, picture: Picture, t: float) -> None:
        """Draw the curves up to `t` [R/c] into `picture` (height, width, 4)."""
        pictures = self._drawn()
        left, right, _, _ = pictures.boxes[0]
        start, end = self._span
        column = left + round((right - left - 1) * (t - start) / (end - start))
        is_visible = left <= column < right
        past = slice(max(column, 0))
        if column >= right:
            past = slice(None)
        # four bytes at a time, which is several times faster
        pixels = picture.view(np.uint32)
        pixels[...] = pictures.coming.view(np.uint32)
        pixels[:, past] = pictures.past.view(np.uint32)[:, past]
        if is_visible:
            self._draw_cursor(picture, pictures, column)
            self._draw_dots(picture, pictures, column)

    def _draw_cursor(
        self, picture: Picture, pictures: PanelPictures, column: int
    ) -> None:
        """Draw the line of the present moment behind the names of curves."""
        columns = slice(column, column + self._cursor_width)
        for _, _, top, bottom in pictures.boxes:
            picture[top:bottom, columns] = self._cursor
        for first, last, top, bottom in pictures.names:
            overlaps = first <= columns.stop and columns.start <= last
            if overlaps:
                picture[top:bottom, columns] = pictures.past[top:bottom, columns]

    def _draw_dots(
        self, picture: Picture, pictures: PanelPictures, column: int
    ) -> None:
        """Draw a dot at the present value of each curve."""
        left = pictures.boxes[0][0]
        for rows, dot in zip(pictures.rows, self._dots, strict=True):
            top = round(float(rows[column - left])) - self._reach
            first = column - self._reach
            size = len(dot)
            patch = picture[top : top + size, first : first + size, :3]
            patch[...] = np.rint(self._free * patch + dot)
