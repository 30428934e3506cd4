"""The curves beside the disk in a film: grey where they are still to come."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from taichi_disk.output.artist import Artist
from taichi_disk.output.panel import ON_DARK, PanelScene, draw_panel, factored
from taichi_disk.output.plot import axis_labels, curves, last_motion
from taichi_disk.render.letters import Letters
from taichi_disk.render.moments import Run, contact_of
from taichi_disk.render.palette import THEMES, ink

_WIDTH = 7 / 9  # over the height: with one disk, a film is 16 : 9
_BESIDE_CONTACT = 0.32  # shown before and after a contact, over its duration
_COMING = {"light": "#B8B8B7", "dark": "#54575E"}
# Sizes are [px] in a picture of 720 pixels.
_LETTER = 20.0
_CURSOR = 2.0


def panel_scene(run: Run, letters: Letters, theme: str) -> PanelScene:
    columns = run.series
    size = 2 * round(letters.height * _WIDTH / 2), letters.height
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
    return PanelScene(
        t=times,
        curves=shown,
        labels=labels,
        time_label=run.scenario.words.time,
        size=size,
        letter=letters.size(_LETTER),
        colours=vars(THEMES[theme]) | {"coming": _COMING[theme]},
    )


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

    def __init__(self, artist: Artist, scene: PanelScene) -> None:
        """Let `artist` begin to draw the curves of `scene`."""
        self.width, height = scene.size
        self._times = scene.t
        self._drawn = lru_cache(artist.begin(draw_panel, scene))
        self._cursor = max(round(_CURSOR * height / 720), 1)
        self._ink = ink(scene.colours["faint"])
        # first and last column that must be drawn again whatever the next time is: at
        # first all, then those of the line
        self._stale = 0, self.width

    def draw(self, picture: NDArray[np.uint8], t: float) -> None:
        """Draw the curves up to `t` [R/c] and a line there into `picture` (height,
        width, 4), which holds what was drawn before."""
        drawn = self._drawn()
        left, right, _, _ = drawn.boxes[0]
        start, *_, end = self._times
        column = left + round((right - left - 1) * (t - start) / (end - start))
        past = max(column, 0)
        if column >= right:
            past = self.width
        first = min(self._stale[0], past)
        last = max(self._stale[1], past)
        picture[:, first:past] = drawn.past[:, first:past]
        picture[:, past:last] = drawn.coming[:, past:last]
        self._stale = past, past + self._cursor
        if left <= column < right:
            for _, _, top, bottom in drawn.boxes:
                picture[top:bottom, column : column + self._cursor, :3] = self._ink
