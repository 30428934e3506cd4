"""The curves beside the disk in a film: grey where they are still to come."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Array
from taichi_disk.output.artist import Artist
from taichi_disk.output.panel import PanelLook, PanelPictures, PanelScene, draw_panel
from taichi_disk.output.plot import Curve, axis_labels, curves
from taichi_disk.render.moments import Run, contact_of
from taichi_disk.render.palette import THEMES

Picture = NDArray[np.uint8]

_BESIDE_CONTACT = 0.32  # shown before and after a contact, over its duration
_COMING = {"light": "#B8B8B7", "dark": "#54575E"}
_DOT = 5.0  # radius of a dot in a picture of 720 pixels [px]


def begin_panel(
    artist: Artist, run: Run, size: tuple[int, int], letter: float, theme_name: str
) -> Callable[[], Panel]:
    """Let `artist` begin to draw the panel, and return a function that waits for it.
    `size`: (width, height) [px]; `letter`: size of the titles' letters [px]."""
    theme = THEMES[theme_name]
    look = PanelLook(
        size=size,
        letter=letter,
        ground=theme.ground,
        ink=theme.ink,
        faint=theme.faint,
        rule=theme.rule,
        coming=_COMING[theme_name],
        is_dark=theme_name == "dark",
    )
    scene = _scene(run, size[0])
    drawn = artist.begin(draw_panel, scene, look)
    return lambda: Panel(drawn(), scene, look)


def _scene(run: Run, width: int) -> PanelScene:
    scenario = run.scenario
    columns = run.columns
    t = columns["t"]
    span = float(t[0]), scenario.last_motion(columns)
    known = span[1]
    if scenario.is_thrown:
        start, known = contact_of(run)
        beside = _BESIDE_CONTACT * (known - start)
        span = start - beside, min(known + beside, float(t[-1]))
    # Twice as many samples as columns are enough, and quick to send.
    inside = np.linspace(max(span[0], float(t[0])), span[1], 2 * width)
    shown = [
        Curve(one.panel, _sampled(inside, t, one.values), one.name, one.colour)
        for one in curves(scenario, columns)
    ]
    return PanelScene(
        t=inside,
        curves=shown,
        labels=axis_labels(scenario, columns),
        time_label=scenario.time_label,
        span=span,
        result=scenario.marks(columns)[0],
        result_time=known,
    )


def _sampled(times: Array, t: Array, values: Array) -> Array:
    return np.asarray(np.interp(times, t, values), dtype=np.float32)


class Panel:
    """Repaints what changes from one picture to the next."""

    def __init__(
        self, pictures: PanelPictures, scene: PanelScene, look: PanelLook
    ) -> None:
        unit = look.size[1] / 720
        self._span = scene.span
        self._result_time = scene.result_time
        self._pictures = pictures
        self._ground = 255.0 * np.asarray(look.ground)
        self._cursor = np.rint(255.0 * np.asarray(look.faint))
        self._cursor_width = max(round(2.0 * unit), 1)
        self._radius = max(_DOT * unit, 2.5)
        self._last: int | None = None  # column up to which curves are coloured
        self._is_ended = False

    def draw(self, picture: Picture, t: float) -> None:
        """Draw the curves up to `t` [R/c] into `picture` (height, width, 3), which is
        the same at each call."""
        left, right, _, _ = self._pictures.boxes[0]
        start, end = self._span
        now = left + round((right - left - 1) * (t - start) / (end - start))
        is_inside = left <= now < right
        now = min(max(now, left), right)
        is_ended = t >= self._result_time
        if self._last is None or is_ended != self._is_ended:
            changed = slice(0, picture.shape[1])
        else:
            beside = int(self._radius) + 4
            first = max(min(self._last, now) - beside, 0)
            changed = slice(first, max(self._last, now) + beside)
        self._last = now
        self._is_ended = is_ended
        past = self._pictures.ended if is_ended else self._pictures.past
        picture[:, changed] = self._pictures.coming[:, changed]
        known = slice(changed.start, min(now, changed.stop))
        if not is_inside and now == right:
            known = changed
        picture[:, known] = past[:, known]
        # The result stands at the right end, beyond the time at which it is known.
        if is_ended:
            self._reveal_result(picture, changed)
        if is_inside:
            self._draw_cursor(picture, now)

    def _reveal_result(self, picture: Picture, changed: slice) -> None:
        ended = self._pictures.ended[:, changed]
        past = self._pictures.past[:, changed]
        is_text = (ended != past).any(axis=2)
        picture[:, changed][is_text] = ended[is_text]

    def _draw_cursor(self, picture: Picture, now: int) -> None:
        left = self._pictures.boxes[0][0]
        columns = slice(now, now + self._cursor_width)
        for _, _, top, bottom in self._pictures.boxes:
            picture[top:bottom, columns] = self._cursor
        for first, last, top, bottom in self._pictures.names:
            if first <= columns.stop and columns.start <= last:
                picture[top:bottom, columns] = self._pictures.past[top:bottom, columns]
        middle = now + 0.5 * (self._cursor_width - 1)
        for rows, ink in zip(self._pictures.rows, self._pictures.inks, strict=True):
            row = float(rows[now - left])
            _draw_disc(picture, (middle, row), self._radius + 1.2, self._ground)
            _draw_disc(picture, (middle, row), self._radius, np.asarray(ink, float))


def _draw_disc(
    picture: Picture, centre: tuple[float, float], radius: float, ink: Array
) -> None:
    column, row = centre
    reach = int(radius) + 2
    top = max(int(row) - reach, 0)
    left = max(int(column) - reach, 0)
    patch = picture[top : int(row) + reach + 1, left : int(column) + reach + 1]
    rows = np.arange(top, top + patch.shape[0])[:, None]
    columns = np.arange(left, left + patch.shape[1])
    covered = np.clip(radius + 0.5 - np.hypot(rows - row, columns - column), 0.0, 1.0)
    mixed = patch + covered[..., None] * (ink - patch)
    patch[...] = np.rint(mixed).astype(np.uint8)
