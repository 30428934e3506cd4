"""The panel of sliders, buttons and read-outs. It decides nothing: it says what a hand has moved.

It stands at the window's left: ImGui keeps its place there when the window is resized.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache, partial
from textwrap import wrap
from typing import Any

from taichi_disk.render.colouring import COLOURINGS, QUANTITIES
from taichi_disk.render.colours import Colour
from taichi_disk.view.controls import LEAST_LOG_ETA, MOST_LOG_ETA, POINTS, SCENE_NAMES, Controls
from taichi_disk.view.graph import CURVES
from taichi_disk.view.keys import Keys

WIDTH = 330  # pixels
_COLUMNS, _LINES = 44, 5  # of a message: ImGui does not break lines
Wish = Callable[[], None]


class Panel:
    """Rows from the top; the first slider is that of eta*.

    What a hand moves is done by `carry_out`, between two pictures: it may take a second.
    """

    def __init__(self, gui: Any, controls: Controls, keys: Keys) -> None:
        self._gui, self._controls, self._keys = gui, controls, keys
        self._wishes: list[Wish] = []

    def show(self, width: int, message: str, lines: Iterable[str]) -> None:
        """`width`: of the window in pixels; `lines`: read-outs."""
        with self._gui.sub_window("taichi-disk", 0.0, 0.0, WIDTH / width, 1.0):
            self._sliders()
            for key, label in self._keys.buttons():
                if self._gui.button(f"{label}  [{key}]"):
                    self._wishes.append(partial(self._keys.press, key))
            arrows = f"arrows: wall's push, longest {self._controls.push_scale.limit:g} M c^2/R"
            for line in [*_broken(message), *lines, arrows]:
                self._gui.text(line)
            for name, colour in CURVES:
                self._gui.text(f"-- {name}", _on_dark(colour))

    def carry_out(self) -> None:
        """Do what was wished for."""
        wishes, self._wishes = self._wishes, []
        for wish in wishes:
            wish()

    def _sliders(self) -> None:
        c = self._controls
        scene, eta = c.sandbox.scene, c.sandbox.scene.material.eta_star
        low, high = LEAST_LOG_ETA, MOST_LOG_ETA
        self._number(f"eta* = {eta:g}  [e d], leftmost: 0", "log10 eta*", c.log_eta, low, high, c.set_log_eta)
        low, high = c.push_range
        symbol, value = c.push_symbol, c.push
        self._number(f"{symbol} = {value:g}  [up down]", f"log10 {symbol}", c.log_push, low, high, c.set_log_push)
        hardness = f"hardness of the wall a = {scene.wall.a:g}/R  [a z]"
        self._number(hardness, "log10 a", c.log_hardness, 1.0, 4.0, c.set_log_hardness)
        speed = f"speed of time {c.sandbox.speed:g} R/c per s  [left right]"
        self._number(speed, "log10 speed", c.log_speed, -2.0, 2.0, c.set_log_speed)
        self._choice(f"scene  [t y u]: {SCENE_NAMES[c.scene_number]}", "scene", c.scene_number, 2, c.set_scene_number)
        last = len(POINTS) - 1
        self._choice(f"points of the disk  [k n]: {c.points}", "points", c.points_number, last, c.set_points_number)
        colouring = COLOURINGS[c.colouring_number]
        unit = f"{c.scale.limit:g} {QUANTITIES[colouring].unit}".strip()
        label = f"colour  [c]: {colouring}, full at {unit}"
        self._choice(label, "colour", c.colouring_number, len(COLOURINGS) - 1, c.set_colouring_number)

    def _number(
        self, heading: str, label: str, value: float, low: float, high: float, change: Callable[[float], None]
    ) -> None:
        self._gui.text(heading)
        new = self._gui.slider_float(label, value, low, high)
        # The slider works in single precision.
        if abs(new - value) > 1e-5:
            self._wishes.append(partial(change, new))

    def _choice(self, heading: str, label: str, value: int, last: int, change: Callable[[int], None]) -> None:
        # The label names the slider for ImGui: it may not change while it is dragged.
        self._gui.text(heading)
        new = self._gui.slider_int(label, value, 0, last)
        if new != value:
            self._wishes.append(partial(change, new))


def _on_dark(colour: Colour) -> Colour:
    red, green, blue = (0.45 + 0.55 * part for part in colour)
    return red, green, blue


@lru_cache(maxsize=8)
def _broken(message: str) -> tuple[str, ...]:
    return tuple(wrap(message, _COLUMNS)[:_LINES])
