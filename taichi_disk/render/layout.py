"""What surrounds the stage: title above on the left, changing text above on the right, colour bar below."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from taichi_disk.render import text
from taichi_disk.render.arrows import ARROW
from taichi_disk.render.camera import Camera
from taichi_disk.render.colouring import QUANTITIES
from taichi_disk.render.colours import CONTACT, FAINT_INK, GROUND, INK, Colour, amount_colours, strain_colours
from taichi_disk.render.picture import Subject

# Sizes in pixels of a picture of 720; a picture of another size scales them all.
_MARGIN = 20.0
_HEADING, _SMALL = 17.0, 13.0
_LEADING = 20.0  # from baseline to baseline
_FOOTER = 66.0
_BAR_WIDTH, _BAR_HEIGHT = 300.0, 10.0
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def _bytes(colour: Colour) -> tuple[int, int, int]:
    red, green, blue = (round(255 * c) for c in colour)
    return red, green, blue


class Layout:
    """The still parts of a picture of `size` x `size` pixels, and the place of the parts that move.

    `still` (size, size, 3) uint8 holds title and colour bar; `camera` says where the stage is.
    """

    def __init__(self, subject: Subject, size: int, lines: int) -> None:
        self.unit = size / 720
        self._size = size
        rows = max(len(subject.title), lines)
        header = self._even((_MARGIN + _HEADING + _LEADING * max(rows - 1, 0) + 12.0) * self.unit)
        footer = self._even(_FOOTER * self.unit)
        self.header = header
        self.camera = Camera.fit(subject.view, 0, header, size, size - header - footer, 14.0 * self.unit)
        image = Image.new("RGB", (size, size), _bytes(GROUND))
        draw = ImageDraw.Draw(image)
        self._draw_title(draw, subject.title)
        self._draw_bar(image, draw, subject)
        self.still: NDArray[np.uint8] = np.array(image)
        self._drawn: tuple[str, ...] = ()
        self._column = 0  # the widest changing text so far

    @staticmethod
    def _even(pixels: float) -> int:
        return 2 * math.ceil(pixels / 2)

    def _draw_title(self, draw: ImageDraw.ImageDraw, title: tuple[str, ...]) -> None:
        room = 0.68 * self._size
        for k, line in enumerate(title):
            bold = k == 0
            size = (_HEADING if bold else _SMALL) * self.unit
            size *= min(1.0, room / text.width(line, size, bold)) if line else 1.0
            at = (_MARGIN * self.unit, self._baseline(k))
            text.draw_line(draw, at, line, size, _bytes(INK if bold else FAINT_INK), bold)

    def _baseline(self, k: int) -> float:
        return (_MARGIN + _HEADING - 3.0 + _LEADING * k) * self.unit

    def _draw_bar(self, image: Image.Image, draw: ImageDraw.ImageDraw, subject: Subject) -> None:
        u, limit, quantity = self.unit, subject.limit, QUANTITIES[subject.colouring]
        least = -limit if quantity.signed else 0.0
        width, height = round(_BAR_WIDTH * u), max(round(_BAR_HEIGHT * u), 1)
        left, top = (self._size - width) // 2, round(self._size - (_FOOTER - 12.0) * u)
        values = np.linspace(least, limit, width)
        colours = (strain_colours if quantity.signed else amount_colours)(values, limit)
        strip = np.broadcast_to(np.rint(255 * colours).astype(np.uint8), (height, width, 3))
        image.paste(Image.fromarray(np.ascontiguousarray(strip)), (left, top))
        # Pointed ends: values beyond the limit have the colour of the limit.
        tips = ((left - 1, left - 1 - 0.8 * height, 0), (left + width, left + width + 0.8 * height, -1))
        for edge, tip, at in tips if quantity.signed else tips[1:]:
            corners = [(edge, top), (edge, top + height - 1), (tip, top + (height - 1) / 2)]
            draw.polygon(corners, fill=_bytes(tuple(colours[at])))
        size = _SMALL * u
        for tick in _ticks(limit):
            if tick < least:
                continue
            x = left + (width - 1) * (tick - least) / (limit - least)
            draw.line([(x, top + height), (x, top + height + 3 * u)], fill=_bytes(FAINT_INK), width=max(round(u), 1))
            label = _label(tick, subject.colouring == "strain", quantity.signed)
            at_x = x - text.width(label.removesuffix(" %"), size * 0.92) / 2
            text.draw_line(draw, (at_x, top + height + 15 * u), label, size * 0.92, _bytes(FAINT_INK))
        x = (self._size - text.width(quantity.label, size)) / 2
        text.draw_line(draw, (x, top + height + 33 * u), quantity.label, size, _bytes(FAINT_INK))
        if subject.full_force:
            self._draw_arrow(draw, subject.full_force, top + height + 33 * u)
        y = top + height - 1
        for label, colour, x in (
            (quantity.ends[0], colours[0], left - 18 * u - text.width(quantity.ends[0], size)),
            (quantity.ends[1], colours[-1], left + width + 18 * u),
        ):
            ink = tuple(colour) if quantity.signed or label == quantity.ends[1] else FAINT_INK
            text.draw_line(draw, (x, y), label, size, _bytes(ink))

    def _draw_arrow(self, draw: ImageDraw.ImageDraw, full_force: float, y: float) -> None:
        """How long an arrow of the wall's force on a point is: one of 0.4 of the full force, and what it means."""
        u, size = self.unit, 0.92 * _SMALL * self.unit
        x0, middle, ink = _MARGIN * u, y - 0.35 * size, _bytes(CONTACT)
        x1 = x0 + 0.4 * ARROW * self.camera.scale
        for start in ((x0, middle), (x1 - 5 * u, middle - 3 * u), (x1 - 5 * u, middle + 3 * u)):
            draw.line([start, (x1, middle)], fill=ink, width=max(round(1.8 * u), 1))
        text.draw_line(draw, (x0, y - 18 * u), "wall pushes a point", size, _bytes(FAINT_INK))
        label = f"{_label(0.4 * full_force, False, False)} Mc²/R"
        text.draw_line(draw, (x1 + 6 * u, y), label, size, _bytes(FAINT_INK))

    def write(self, picture: NDArray[np.uint8], lines: tuple[str, ...]) -> None:
        """Set the changing lines in the upper right of a picture (size, size, 4) that began as `still`."""
        if lines == self._drawn:
            return
        size = 14.0 * self.unit
        widest = max((text.width(line, size) for line in lines), default=0.0)
        # The column never narrows, so that the text does not tremble as digits come and go.
        self._column = max(self._column, math.ceil(widest + _MARGIN * self.unit))
        patch = Image.new("RGB", (self._column, self.header), _bytes(GROUND))
        draw = ImageDraw.Draw(patch)
        for k, line in enumerate(lines):
            text.draw_line(draw, (0.0, self._baseline(k)), line, size, _bytes(INK))
        picture[: self.header, -self._column :, :3] = np.asarray(patch)
        self._drawn = lines


def _label(value: float, percent: bool, signed: bool) -> str:
    """A tick's value, as `+5 %`, `0.02` or `2·10⁻⁷`."""
    if not value:
        return "0"
    text = f"{100 * value if percent else value:{'+' if signed else ''}.6g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        text = f"{mantissa}·10" + str(int(exponent)).translate(_RAISED)
    return text.replace("-", "−") + (" %" if percent else "")


def _ticks(limit: float) -> list[float]:
    """Round values from -limit to limit, two or three on either side of zero."""
    rough = limit / 2.0
    power = 10.0 ** math.floor(math.log10(rough))
    step = max(s for s in (power, 2 * power, 2.5 * power, 5 * power) if s <= rough * (1 + 1e-9))
    count = math.floor(limit / step * (1 + 1e-9))
    return [k * step for k in range(-count, count + 1)]
