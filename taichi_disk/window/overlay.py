"""Text, lines and areas beside the disk, as coloured quadrangles: one draw call for all of them; and the two graphs.

A picture that covers the window (`canvas.set_image`) would cost 17 ms of processor time in each frame, and another 50
whenever it changes. Letters are set by Pillow once and drawn as boxes of equal coverage, about 11 for each.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

from taichi_disk.lattice import Array
from taichi_disk.output.plot import LINE
from taichi_disk.render.geometry import NOTHING, Shape, joined, outline, quads
from taichi_disk.render.kernels import VERTEX
from taichi_disk.render.legend import Ink, draw_line, ink, label, text_width, ticks_to
from taichi_disk.render.palette import Theme, round_near
from taichi_disk.simulation.observables import BY_NAME, INDEX, of_kind
from taichi_disk.window.history import Segment
from taichi_disk.window.sandbox import Sandbox, push_of

Pixel = tuple[float, float]  # column and row from the window's upper left corner
Box = tuple[float, float, float, float]  # left, top, right, bottom [px]

_PIECES = re.compile(r"[-−+.\d]|[^-−+.\d]+")  # numbers that change are set of letters that are known
_LEVELS = 3  # shades of a letter: with six, which look the same, it takes half as many boxes again

_POINTS = 140  # of a curve
_SMALL, _HEADING = 11.0, 12.0  # sizes of letters [px]


class Overlay:
    """A stand-in for Pillow's ImageDraw; columns and rows of pixels count from the window's upper left corner.

    Attributes:
        left: the column in the window that counts as column 0; it may be changed.
    """

    def __init__(self, ground: Ink) -> None:
        """`ground`: what letters and curves fade to."""
        self._ground, self.left = ground, 0
        self._shapes: list[Shape] = [NOTHING]

    def _add(self, shape: Shape) -> None:
        corners, colours = shape
        self._shapes.append((corners + (self.left, 0.0), colours / 255.0))

    def polygon(self, corners: Sequence[Pixel], fill: Ink) -> None:
        """A filled triangle or quadrangle."""
        four = [*corners, corners[-1]][:4]
        self._add(quads(*np.array(four, dtype=float)[:, None], *[np.array(fill)] * 4))

    def rectangle(self, box: Sequence[float], fill: Ink | None = None, outline: Ink | None = None) -> None:
        """(left, top, right, bottom), with the last column and row; an outline is a pixel wide."""
        left, top, right, bottom = box
        if outline:
            self.rectangle(box, outline)
            self.rectangle((left + 1, top + 1, right - 1, bottom - 1), fill or self._ground)
        elif fill:
            self.polygon([(left, top), (right + 1, top), (right + 1, bottom + 1), (left, bottom + 1)], fill)

    def line(self, ends: Sequence[Pixel], fill: Ink, width: int = 1) -> None:
        """Along a row or a column."""
        (left, top), (right, bottom) = sorted((round(x), round(y)) for x, y in ends)
        before, after = (width - 1) // 2, width // 2
        if left == right:
            self.rectangle((left - before, top, right + after, bottom), fill)
        else:
            self.rectangle((left, top - before, right, bottom + after), fill)

    def curve(self, x: ArrayLike, y: ArrayLike, half: float, ink: Ink) -> None:
        """A line through the points (k,), that fades to the ground at either side within `half` a pixel and more."""
        points, ground = np.stack([x, y], axis=-1).astype(float), np.array(self._ground)
        inside = np.broadcast_to(ground, (len(points) - 1, 2, 3))
        self._add(outline(points[:-1], points[1:], half, inside, ink, ground))

    def text(self, at: Pixel, line: str, fill: Ink, font: ImageFont.FreeTypeFont, anchor: str = "ls") -> None:
        """Set a line with the left end of its baseline at `at`."""
        x, baseline = at
        for piece in _PIECES.findall(line):
            corners, colours, length = _letters(piece, font, fill, self._ground)
            self._shapes.append((corners + (self.left + round(x), round(baseline)), colours))
            x += length

    def vertices(self, width: int, height: int) -> NDArray[np.float32]:
        """(3 k, VERTEX) of triangles, for a window of so many pixels."""
        corners, colours = joined(*self._shapes)
        vertices = np.zeros((len(corners), VERTEX), dtype=np.float32)
        vertices[:, 0], vertices[:, 1] = corners[:, 0] / width, 1.0 - corners[:, 1] / height
        vertices[:, 8:11], vertices[:, 11] = colours, 1.0
        return vertices


@lru_cache(maxsize=2048)
def _letters(line: str, font: ImageFont.FreeTypeFont, fill: Ink, ground: Ink) -> tuple[Array, Array, float]:
    """Corners and colours of triangles from the left end of the baseline, and how far the next letter is [px]."""
    boxes, cover = _boxes(line, font)
    corners = (boxes[:, corner] for corner in ([0, 1], [2, 1], [2, 3], [0, 3]))
    points, colours = quads(*corners, *[ground + cover[:, None] * (np.array(fill) - ground)] * 4)
    return points, colours / 255.0, font.getlength(line)


def _boxes(line: str, font: ImageFont.FreeTypeFont) -> tuple[Array, Array]:
    """Boxes (k, 4) (left, top, right, bottom) from the left end of the baseline, and their coverage (k,)."""
    left, top, right, bottom = (round(edge) for edge in font.getbbox(line, anchor="ls"))
    picture = Image.new("L", (max(right - left, 0) + 2, max(bottom - top, 0) + 2))
    ImageDraw.Draw(picture).text((1 - left, 1 - top), line, fill=255, font=font, anchor="ls")
    cover = np.rint(np.asarray(picture) / 255.0 * (_LEVELS - 1)).astype(int)
    rows, ends = np.nonzero(np.diff(cover, axis=1))  # a run begins or ends after this column
    level = cover[rows, ends + 1]
    starts = np.flatnonzero(level)
    runs = np.stack([ends[starts], ends[starts + 1], level[starts], rows[starts]], axis=1)
    runs = runs[np.lexsort(runs.T[::-1])]
    # Runs that stand below each other are one box.
    continues = (np.diff(runs, axis=0, prepend=-1) == (0, 0, 0, 1)).all(axis=1)
    continued = np.append(continues[1:], False)[: len(runs)]
    (begin, end, level, first), last = runs[~continues].T, runs[~continued, 3]
    boxes = np.stack([begin, first - 1, end, last], axis=1) + np.array([left, top, left, top])
    return boxes.astype(float), level / (_LEVELS - 1.0)


# ---- graphs


class Curve(NamedTuple):
    """In which graph, what is full scale, the name in the legend, the colour, the values (rows,)."""

    graph: int
    scale: str
    name: str
    colour: str
    values: Array

    @property
    def ink(self) -> Ink:
        red, green, blue = bytes.fromhex(self.colour[1:])
        return red, green, blue


class Graphs:
    """Where the energy is, and what the wall and the centre of mass do, in the hit that is seen.

    Their scales grow, and begin again with each hit.

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
        scene = self._sandbox.seen.segment.scenario.scene
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
        """Of what is seen, since the hit began [R/c]."""
        return self._sandbox.seen.t - self._segments[0].began

    @property
    def _segments(self) -> list[Segment]:
        return self._sandbox.time.of_hit(self._sandbox.seen.segment.hit)

    def _rows(self) -> tuple[Array, Array]:
        """Times since the hit began, and the rows; what was lost adds up over all changes by hand."""
        lost = [INDEX[name] for name in of_kind("loss")]
        times, rows = [], []
        before: Array = np.zeros(len(lost))
        for one in self._segments:
            part = np.vstack([one.rows, one.row])
            part[:, lost] += before
            before = part[-1, lost]
            times.append(np.append(one.began + np.arange(one.count) * one.interval, one.now))
            rows.append(part)
        return np.concatenate(times) - self._segments[0].began, np.concatenate(rows)

    def _curves(self, rows: Array) -> list[Curve]:
        def of(*names: str) -> Array:
            return np.asarray(rows[:, [INDEX[name] for name in names]].sum(axis=1))

        height, flight = of("com_y") - of("lowest_y"), 0.5 * (of("com_vx") ** 2 + of("com_vy") ** 2)
        motion, force = (label(self.full[scale]) for scale in ("motion", "force"))
        moved = (f"v / {motion} c", of("com_vy")) if self._low else (f"ξ / {motion} R", height[0] - height)
        return [
            Curve(0, "energy", "flight", BY_NAME["translation"].colour, flight),
            Curve(0, "energy", "vibration, spin", BY_NAME["vibration"].colour, of("kinetic") - flight),
            Curve(0, "energy", "elastic, wall", BY_NAME["elastic"].colour, of("elastic", "wall")),
            Curve(0, "energy", "lost", BY_NAME["dissipated"].colour, of(*of_kind("loss"))),
            Curve(1, "force", f"wall's force / {force} Mc²/R", BY_NAME["absorbed"].colour, of("wall_force")),
            Curve(1, "motion", moved[0], LINE, moved[1]),
        ]

    @property
    def _low(self) -> float:
        """Where the second graph begins, in parts of the full scale; the first begins at 0."""
        return -1.0 if self._sandbox.is_impact else 0.0

    # ---- drawing

    def draw_frames(self, overlay: Overlay, theme: Theme) -> None:
        """Titles, legends, rules and numbers."""
        faint, curves = ink(theme.faint), self._curves(self._rows()[1])
        titles = f"energy / {label(self.full['energy'])} Mc²", "wall and centre of mass"

        def write(x: float, row: float, line: str, align: float = 0.0) -> float:
            width = text_width(line, _SMALL)
            draw_line(overlay, (x - align * width, row), line, _SMALL, faint)
            return width

        for k, (left, top, right, bottom) in enumerate(self.boxes):
            low, named = k * self._low, [curve for curve in curves if curve.graph == k]
            wide = sum(32.0 + text_width(curve.name, _SMALL) for curve in named) - 14.0
            narrow = wide > right - left + (50.0, 20.0)[k]
            if not narrow:
                draw_line(overlay, (left, top - 28.0), titles[k], _HEADING, ink(theme.ink), True)
            x, row = left, top - 9.0 - 17.0 * narrow * (len(named) - 1)
            for curve in named:
                overlay.rectangle((x, row - 6.0, x + 13.0, row - 4.0), curve.ink)
                wide = 32.0 + write(x + 18.0, row, curve.name)
                x, row = (x, row + 17.0) if narrow else (x + wide, row)
            for value in (low, 0.5 + 0.5 * low, 1.0):
                row = bottom - (bottom - top) * (value - low) / (1.0 - low)
                overlay.line([(left, row), (right, row)], ink(theme.rule))
                write(left - 6.0, row + 4.0, label(value), 1.0)
            *ticks, last = ticks_to(self.full["t"], False)
            free = right - write(right, bottom + 16.0, f"t = {label(last)} R/c", 1.0) - 14.0
            for tick in (*ticks, last):
                x = left + (right - left) * tick / last
                overlay.line([(x, bottom), (x, bottom + 3.0)], faint)
                if x < free:
                    write(x, bottom + 16.0, label(tick), 0.5)

    def draw_curves(self, overlay: Overlay) -> None:
        t, rows = self._rows()
        at = np.unique(np.linspace(0, len(t) - 1, _POINTS).astype(int))
        for curve in self._curves(rows[at]):
            (left, top, right, bottom), low = self.boxes[curve.graph], curve.graph * self._low
            heights = (np.clip(curve.values / self.full[curve.scale], low, 1.05) - low) / (1.0 - low)
            columns = left + (right - left) * t[at] / self.full["t"]
            overlay.curve(columns, bottom - (bottom - top) * heights, 1.4, curve.ink)

    def draw_cursor(self, overlay: Overlay, theme: Theme) -> None:
        for left, top, right, bottom in self.boxes:
            x = left + (right - left) * min(max(self.t / self.full["t"], 0.0), 1.0)
            overlay.line([(x, top), (x, bottom)], ink(theme.ink))

    def time_at(self, column: float, row: float) -> float | None:
        """The sandbox's time at a pixel of a graph or some pixels beside it [R/c]; None elsewhere."""
        for left, top, right, bottom in self.boxes:
            if left - 12.0 <= column <= right + 12.0 and top - 12.0 <= row <= bottom + 24.0:
                part = min(max((column - left) / (right - left), 0.0), 1.0)
                return self._segments[0].began + part * self.full["t"]
        return None
