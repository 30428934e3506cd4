"""The panel at the left: sliders, buttons and read-outs in the look of the legends, drawn as they are."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import log
from typing import Any

import numpy as np

from taichi_disk.render.legend import Ink, draw_line, ink, label, text_width
from taichi_disk.render.painter import draw_triangles
from taichi_disk.render.palette import Theme
from taichi_disk.scenes.impact import ImpactScenario
from taichi_disk.simulation.observables import INDEX
from taichi_disk.window.controls import RANGES, Action, Button, Controls, Slider
from taichi_disk.window.overlay import Box, Overlay, Pixel
from taichi_disk.window.sandbox import push_of
from taichi_disk.window.scene_view import PANEL

SECTIONS = ("Experiment", "Time", "Look")
LARGE = 5000  # points, from which on a new start takes longer than a picture may
_MARGIN, _GAP = 12, 4  # around the panel, between controls [px]
_HEAD, _LINE, _LINES = 24, 17, 7  # heights of a title and of a line of text [px]; lines below, at the least
_ROW = (32, 44)  # the least and the largest height of a control [px]: fingers need 40
_SMALL = 11.0  # size of letters [px]
_FINE, _WARNING = (0, 130, 70), (205, 95, 0)  # are read on either ground
_SIGNS = {"space": "␣", "Left": "←", "Right": "→", "Return": "↵", "BackSpace": "⌫", "Tab": "⇥"}
# Columns of the table: where they begin (0) or end (1) [px].
_COLUMNS = (12, 0), (70, 1), (124, 1), (176, 1), (212, 1), (218, 0)
Group = tuple[str, int, int, Sequence[Button | Slider]]  # title, at most how many side by side, the gap between, they


class Panel:
    """Draws `controls`, and acts on them. What a hand moves is done by `carry_out`, between two pictures.

    Attributes:
        areas: where the controls of the last picture are.
    """

    def __init__(self, controls: Controls) -> None:
        self._controls, self._sandbox = controls, controls.sandbox
        self.areas: list[tuple[Box, Button | Slider]] = []
        self._held: tuple[Box, Slider] | None = None
        self._pending: dict[str, tuple[float, Action]] = {}  # by key or slider: the value that it is to have, and how
        self._look: Any = None  # of what is kept
        self._kept = np.empty((0, 0), np.float32)
        self._bottom = 0.0  # of the controls [px]

    # ---- the pointer

    def press(self, at: Pixel) -> None:
        """Push the button that is there, or take hold of the slider."""
        for (left, top, right, bottom), one in self.areas:
            if left <= at[0] < right and top <= at[1] < bottom:
                if isinstance(one, Slider):
                    self._held = (left, top, right, bottom), one
                    self.move(at)
                else:
                    self._pending[one.key] = 0.0, partial(self._controls.press, one.key)

    def move(self, at: Pixel) -> None:
        """Lead the slider that is held."""
        if self._held:
            (left, _, right, _), one = self._held
            value = _value(one, min(max((at[0] - left) / (right - left), 0.0), 1.0))
            self._pending[one.label] = value, partial(one.change, value)

    def release(self) -> None:
        self._held = None

    def carry_out(self, pressed: bool) -> None:
        """Do what is pending. What takes long to build waits until no button of the mouse is `pressed`."""
        sandbox = self._sandbox
        slow = sandbox.at_start and (sandbox.scene.lattice.points > LARGE or not sandbox.is_impact)
        if not (pressed and (slow or RANGES["lattice.points"][0] in self._pending)):
            pending, self._pending = self._pending, {}
            for _, act in pending.values():
                act()

    # ---- drawing

    def draw(self, canvas: Any, size: tuple[int, int], theme: Theme) -> None:
        """Cover the left of a `ti.ui.Canvas` of `size` (width, height) [px]."""
        controls = self._controls
        groups: list[Group] = []
        for name in SECTIONS:
            groups += (name, 2, 16, controls.sliders(name)), ("", 3, _GAP, controls.buttons(name))
        shown = [(*one[:4], self._pending.get(one.label)) for *_, some in groups for one in some]
        look = size, theme.ground, shown, controls.number, controls.keys_shown
        if look != self._look:
            self._look, overlay = look, Overlay(ink(theme.ground))
            self._lay_out(overlay, size[1], theme, groups)
            if controls.keys_shown:
                self._write_keys(overlay, theme)
            self._kept = overlay.vertices(*size)
        overlay = Overlay(ink(theme.ground))
        self._write_numbers(overlay, size[1], theme)
        draw_triangles(canvas, np.concatenate([self._kept, overlay.vertices(*size)]))

    def _lay_out(self, overlay: Overlay, height: int, theme: Theme, groups: list[Group]) -> None:
        """Sliders stand in two columns, buttons in three; rows are as high as there is room."""
        overlay.rectangle((0, 0, PANEL - 1, height), ink(theme.ground))
        overlay.rectangle((PANEL - 1, 0, PANEL - 1, height), ink(theme.rule))
        place = f"{self._controls.number + 1} of {len(self._controls.playlist)}"
        _write(overlay, PANEL - _MARGIN, 21, place, ink(theme.faint), 1.0)
        self.areas, top = [], 4
        free = height - top - len(SECTIONS) * _HEAD - _LINES * _LINE
        row = min(max(free // sum(-(-len(some) // most) for _, most, _, some in groups) - _GAP, _ROW[0]), _ROW[1])
        for name, most, gap, some in groups:
            if name:
                draw_line(overlay, (_MARGIN, top + 17), name, 12.0, ink(theme.ink), True)
                top += _HEAD
            columns = min(most, len(some))
            for k, one in enumerate(some):
                wide = (PANEL - 2 * _MARGIN + gap) / columns
                left, upper = _MARGIN + round(k % columns * wide), top + k // columns * (row + _GAP)
                box: Box = left, upper, left + round(wide) - gap, upper + row
                self.areas.append((box, one))
                (self._draw_slider if isinstance(one, Slider) else self._draw_button)(overlay, box, one, theme)
            top += -(-len(some) // most) * (row + _GAP)
        self._bottom = top

    def _draw_button(self, overlay: Overlay, box: Box, one: Any, theme: Theme) -> None:
        left, top, right, bottom = box
        frame, middle = ink(theme.ink if one.on else theme.rule), (top + bottom) / 2
        overlay.rectangle((left, top, right - 1, bottom - 1), outline=frame)
        if one.on:
            overlay.rectangle((left + 1, top + 1, right - 2, top + 2), frame)
        below = f"{one.value}  {_SIGNS.get(one.key, one.key)}".strip()
        _write(overlay, (left + right) / 2, middle - 2, one.label, ink(theme.ink), 0.5)
        _write(overlay, (left + right) / 2, middle + 11, below, ink(theme.faint), 0.5)

    def _draw_slider(self, overlay: Overlay, box: Box, one: Any, theme: Theme) -> None:
        left, top, right, bottom = box
        value, row, middle = self._shown(one), (top + bottom) // 2 + 9, (top + bottom) / 2 - 2
        x = left + 3 + _part(one, value) * (right - left - 7)
        overlay.rectangle((left, row - 1, right - 1, row + 1), ink(theme.rule))
        overlay.rectangle((left, row - 1, x, row + 1), ink(theme.faint))
        overlay.rectangle((x - 3, row - 5, x + 3, row + 5), ink(theme.ink))
        wide = _write(overlay, left, middle, one.label, ink(theme.ink))
        _write(overlay, left + wide + 7, middle, one.keys, ink(theme.faint))
        number = f"{value:,}" if isinstance(value, int) else label(float(f"{value:.3g}"))
        _write(overlay, right, middle, number, ink(theme.ink), 1.0, True)

    def _shown(self, one: Slider) -> float:
        """What it stands at: what it is led to, before that is done."""
        return self._pending.get(one.label, (one.value,))[0]

    def _write_keys(self, overlay: Overlay, theme: Theme) -> None:
        left, top, reference = PANEL + 24, 24, self._controls.reference
        overlay.rectangle((left, top, left + 330, top + 18 + 18 * len(reference)), outline=ink(theme.faint))
        for k, (keys, what) in enumerate(reference):
            _write(overlay, left + 14, top + 22 + 18 * k, keys, ink(theme.ink), bold=True)
            _write(overlay, left + 114, top + 22 + 18 * k, what, ink(theme.ink))

    def _write_numbers(self, overlay: Overlay, height: int, theme: Theme) -> None:
        """What is known of what is seen, and the results, the newest first."""
        sandbox, key = self._sandbox, self._controls.dashpot_key
        step, row = sandbox.segment.step, sandbox.seen.row
        state, tone = "this is what run computes", _FINE
        if sandbox.time.behind or sandbox.seen.by_hand:
            state, tone = "computing again..." if sandbox.time.behind else "changed by hand: r to start again", _WARNING
        dark, faint, top = ink(theme.ink), ink(theme.faint), self._bottom + 12.0
        lines: list[tuple[tuple[str, ...], Ink]] = [
            ((f"v {row[INDEX['com_vy']]:+.5f} c,  force {row[INDEX['wall_force']]:.3g} Mc²/R",), dark),
            ((f"energy imbalance {sandbox.imbalance:+.1e}",), dark),
            ((f"{step.integrator.name}, step {step.dt:.3g} R/c",), faint),
            ((state,), tone),
        ]
        lines += [(("", "result", "v, P", RANGES[key][0], "a"), faint)] * bool(sandbox.results)
        for one in reversed(sandbox.results):
            scene, points = one.scenario.scene, one.scenario.lattice.disk_points
            eta = scene.material.eta(points) * (points if key == "material.eta_star" else 1.0)
            numbers = f"{one.value:.5f}", f"{push_of(scene):.3g}", f"{eta:.3g}", f"{scene.wall.a:.4g}"
            lines.append((("e" if isinstance(one.scenario, ImpactScenario) else "ξ", *numbers, one.label), dark))
        for cells, colour in lines:
            for cell, (column, align) in zip(cells, _COLUMNS, strict=False):
                if top < height - 3:
                    _write(overlay, column, top, cell.replace("-", "−"), colour, align)
            top += _LINE


def _write(sheet: Overlay, x: float, row: float, line: str, ink: Ink, align: float = 0.0, bold: bool = False) -> float:
    """Set a line that begins at the column `x`, ends (`align` 1) or has its middle there; returns its width."""
    width = text_width(line, _SMALL, bold)
    draw_line(sheet, (x - align * width, row), line, _SMALL, ink, bold)
    return width


def _part(one: Slider, value: float) -> float:
    """Where a value is on a slider, 0 to 1: by its logarithm, where there is no zero."""
    if one.low > 0.0:
        return log(value / one.low) / log(one.high / one.low)
    return (value - one.low) / (one.high - one.low)


def _value(one: Slider, part: float) -> float:
    value = one.low * (one.high / one.low) ** part if one.low > 0.0 else one.low + part * (one.high - one.low)
    return round(value) if isinstance(one.value, int) else value
