"""Two graphs below the disk: where the energy is, and what the wall and the centre of mass do. They grow with time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from taichi_disk.lattice import Array
from taichi_disk.render.legend import Ink, draw_line, ink, label, text_width, ticks_to
from taichi_disk.render.palette import PALETTE, Theme, round_near
from taichi_disk.simulation.observables import INDEX
from taichi_disk.window.changes import push_of
from taichi_disk.window.history import Stretch
from taichi_disk.window.sandbox import Sandbox
from taichi_disk.window.sheet import Sheet

Box = tuple[float, float, float, float]  # left, top, right, bottom [px]

_POINTS = 140  # of a curve
_LOST = ("dissipated", "absorbed", "sliding")
_SMALL, _HEADING = 11.0, 12.0  # sizes of letters [px]


class Curve(NamedTuple):
    """In which graph, what is full scale, the name in the legend, the colour in PALETTE, the values (rows,)."""

    graph: int
    scale: str
    name: str
    colour: str
    values: Array

    @property
    def ink(self) -> Ink:
        red, green, blue = bytes.fromhex(PALETTE[self.colour][1:])
        return red, green, blue


class Graphs:
    """Both graphs of the hit that is seen. Their scales grow, and begin again with each hit.

    Attributes:
        boxes: where the curves of either graph lie.
        full: what is full scale: "t" [R/c], "energy" [M c^2], "force" [M c^2/R], "motion" [c or R].
    """

    def __init__(self, sandbox: Sandbox) -> None:
        self._sandbox = sandbox
        self.boxes: tuple[Box, ...] = ()
        self.full: dict[str, float] = {}

    def begin(self) -> None:
        """Scales for the hit that is seen."""
        scene = self._sandbox.moment.stretch.driver.scenario.scene
        push, k_a = push_of(scene), scene.material.k_a
        t, force = round_near(8.0 * k_a**-0.5), round_near(0.3 * push)
        soft = 1.0 / max(k_a, 1.0)
        self.full = {"t": t, "force": force, "energy": 0.5 * soft * push**2, "motion": soft * push}

    def grow(self) -> None:
        """Let the scales hold what has come to be."""
        t, rows = self._rows()
        reached = [("t", t[-1]), *((one.scale, np.abs(one.values).max()) for one in self._curves(rows))]
        for scale, value in reached:
            if value > 1.01 * self.full[scale]:
                self.full[scale] = round_near(1.25 * value)

    @property
    def t(self) -> float:
        """Of the moment that is seen, since the hit began [R/c]."""
        return self._sandbox.moment.t - self._stretches[0].began

    @property
    def _stretches(self) -> list[Stretch]:
        return self._sandbox.time.of_hit(self._sandbox.moment.stretch.hit)

    def _rows(self) -> tuple[Array, Array]:
        """Times since the hit began, and the rows; what was lost adds up over all changes by hand."""
        lost = [INDEX[name] for name in _LOST]
        times, rows = [], []
        before: Array = np.zeros(len(lost))
        for one in self._stretches:
            driver = one.driver
            part = np.vstack([driver.rows, driver.row])
            part[:, lost] += before
            before = part[-1, lost]
            times.append(np.append(one.began + np.arange(driver.count) * driver.interval, one.now))
            rows.append(part)
        return np.concatenate(times) - self._stretches[0].began, np.concatenate(rows)

    def _curves(self, rows: Array) -> list[Curve]:
        def of(*names: str) -> Array:
            return np.asarray(rows[:, [INDEX[name] for name in names]].sum(axis=1))

        height = of("com_y") - of("lowest_y")
        motion, force = (label(self.full[scale]) for scale in ("motion", "force"))
        moved = (f"v / {motion} c", of("com_vy")) if self._low else (f"ξ / {motion} R", height[0] - height)
        return [
            Curve(0, "energy", "kinetic", "kinetic", of("kinetic")),
            Curve(0, "energy", "elastic, wall", "elastic", of("elastic", "wall")),
            Curve(0, "energy", "lost", "dissipated", of(*_LOST)),
            Curve(1, "force", f"wall's force / {force} Mc²/R", "absorbed", of("wall_force")),
            Curve(1, "motion", moved[0], "line", moved[1]),
        ]

    @property
    def _low(self) -> float:
        """Where the second graph begins, in parts of the full scale; the first begins at 0."""
        return -1.0 if self._sandbox.is_impact else 0.0

    # ---- drawing

    def draw_frames(self, sheet: Sheet, theme: Theme) -> None:
        """Titles, legends, rules and numbers."""
        faint, curves = ink(theme.faint), self._curves(self._rows()[1])
        titles = f"energy / {label(self.full['energy'])} Mc²", "wall and centre of mass"

        def write(x: float, row: float, line: str, align: float = 0.0) -> float:
            width = text_width(line, _SMALL)
            draw_line(sheet, (x - align * width, row), line, _SMALL, faint)
            return width

        for k, (left, top, right, bottom) in enumerate(self.boxes):
            draw_line(sheet, (left, top - 28.0), titles[k], _HEADING, ink(theme.ink), True)
            x, low = left, k * self._low
            for curve in curves:
                if curve.graph == k:
                    sheet.rectangle((x, top - 15.0, x + 13.0, top - 13.0), curve.ink)
                    x += 32.0 + write(x + 18.0, top - 9.0, curve.name)
            for value in (low, 0.5 + 0.5 * low, 1.0):
                row = bottom - (bottom - top) * (value - low) / (1.0 - low)
                sheet.line([(left, row), (right, row)], ink(theme.rule))
                write(left - 6.0, row + 4.0, label(value), 1.0)
            *ticks, last = ticks_to(self.full["t"], False)
            for tick in (*ticks, last):
                x = left + (right - left) * tick / last
                sheet.line([(x, bottom), (x, bottom + 3.0)], faint)
                line, align = (f"t = {label(tick)} R/c", 1.0) if tick == last else (label(tick), 0.5)
                write(x, bottom + 16.0, line, align)

    def draw_curves(self, sheet: Sheet) -> None:
        t, rows = self._rows()
        at = np.unique(np.linspace(0, len(t) - 1, _POINTS).astype(int))
        for curve in self._curves(rows[at]):
            (left, top, right, bottom), low = self.boxes[curve.graph], curve.graph * self._low
            heights = (np.clip(curve.values / self.full[curve.scale], low, 1.05) - low) / (1.0 - low)
            columns = left + (right - left) * t[at] / self.full["t"]
            sheet.curve(columns, bottom - (bottom - top) * heights, 1.4, curve.ink)

    def draw_cursor(self, sheet: Sheet, theme: Theme) -> None:
        for left, top, right, bottom in self.boxes:
            x = left + (right - left) * min(max(self.t / self.full["t"], 0.0), 1.0)
            sheet.line([(x, top), (x, bottom)], ink(theme.ink))

    def time_at(self, column: float, row: float) -> float | None:
        """The sandbox's time at a pixel of a graph or some pixels beside it [R/c]; None elsewhere."""
        for left, top, right, bottom in self.boxes:
            if left - 12.0 <= column <= right + 12.0 and top - 12.0 <= row <= bottom + 24.0:
                share = min(max((column - left) / (right - left), 0.0), 1.0)
                return self._stretches[0].began + share * self.full["t"]
        return None
