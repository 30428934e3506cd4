"""The panel of sliders, buttons and read-outs. It decides nothing: it calls the controls.

It stands at the window's left: ImGui keeps its place there when the window is resized.
"""

from __future__ import annotations

from collections.abc import Callable
from textwrap import wrap
from typing import Any

from taichi_disk.render.colouring import COLOURINGS, QUANTITIES
from taichi_disk.view.controls import BOUNDARIES, SCENE_NAMES, SHOWS, Controls
from taichi_disk.view.graph import CURVES

WIDTH = 330  # pixels
_COLUMNS, _LINES = 44, 5  # of a message: ImGui does not break lines


class Panel:
    """Rows from the top; the first slider is that of eta*."""

    def __init__(self, gui: Any, controls: Controls) -> None:
        self._gui, self._controls = gui, controls

    def show(self, width: int, rates: str) -> None:
        """`width`: of the window in pixels; `rates`: frames and steps per second."""
        with self._gui.sub_window("taichi-disk", 0.0, 0.0, WIDTH / width, 1.0):
            self._sliders()
            self._buttons()
            message = self._controls.sandbox.message
            for line in [*wrap(message, _COLUMNS)[:_LINES], *self._controls.readings()]:
                self._gui.text(line)
            self._gui.text(rates)
            for name, colour in CURVES:
                self._gui.text(f"-- {name}", colour)

    def _sliders(self) -> None:
        c = self._controls
        scene, eta = c.sandbox.scene, c.sandbox.scene.material.eta_star
        self._number(f"eta* = {eta:g}  [e d], leftmost: 0", "log10 eta*", c.log_eta, -1.0, 3.0, c.set_log_eta)
        low, high = c.push_range
        symbol, value = c.push_symbol, c.push
        self._number(f"{symbol} = {value:g}  [up down]", f"log10 {symbol}", c.log_push, low, high, c.set_log_push)
        hardness = f"hardness of the wall a = {scene.wall.a:g}/R  [a z]"
        self._number(hardness, "log10 a", c.log_hardness, 1.0, 4.0, c.set_log_hardness)
        speed = f"speed of time {c.sandbox.speed:g} R/c per s  [left right]"
        self._number(speed, "log10 speed", c.log_speed, -2.0, 2.0, c.set_log_speed)
        self._choice(f"scene  [1 2 3]: {SCENE_NAMES[c.scene_number]}", "scene", c.scene_number, 2, c.set_scene_number)
        if c.boundary_number is not None:
            now = BOUNDARIES[c.boundary_number]
            self._choice(f"boundary  [b]: {now}", "boundary", c.boundary_number, 2, c.set_boundary_number)
        colouring = COLOURINGS[c.colouring_number]
        unit = f"{c.scale.limit:g} {QUANTITIES[colouring].unit}".strip()
        label = f"colour  [c]: {colouring}, full at {unit}"
        self._choice(label, "colour", c.colouring_number, len(COLOURINGS) - 1, c.set_colouring_number)
        self._choice(f"draw  [x]: {SHOWS[c.show_number]}", "draw", c.show_number, 2, c.set_show_number)

    def _number(
        self, heading: str, label: str, value: float, low: float, high: float, change: Callable[[float], None]
    ) -> None:
        self._gui.text(heading)
        new = self._gui.slider_float(label, value, low, high)
        # The slider works in single precision.
        if abs(new - value) > 1e-5:
            change(new)

    def _choice(self, heading: str, label: str, value: int, last: int, change: Callable[[int], None]) -> None:
        # The label names the slider for ImGui: it may not change while it is dragged.
        self._gui.text(heading)
        new = self._gui.slider_int(label, value, 0, last)
        if new != value:
            change(new)

    def _buttons(self) -> None:
        c = self._controls
        for key, label in c.labels():
            if self._gui.button(f"{label}  [{key}]"):
                c.press(key)
        self._gui.text("close the window  [q]")
