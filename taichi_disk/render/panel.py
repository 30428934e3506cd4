"""A panel of curves beside the disk that grow with time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_DOT = 4.0  # radius in pixels of the dot at a curve's end, in a picture of 720


@dataclass(frozen=True)
class Curve:
    """Where a curve lies in the panel: pixels (k,) from the upper left corner, columns ascending."""

    columns: NDArray[np.float64]
    rows: NDArray[np.float64]
    colour: tuple[int, int, int]


@dataclass(frozen=True)
class Panel:
    """The panel is drawn twice beforehand; a frame takes what is past from the one and what is to come from the other.

    Attributes:
        empty, full: (rows, columns, 3) uint8, without curves and with them whole.
        times: the first and the last time on the axis [R/c].
        edges: the columns of those, in pixels from the left.
        result: rows and columns of a text that is not to come letter by letter.
        curves: of which the end is marked.
    """

    empty: NDArray[np.uint8]
    full: NDArray[np.uint8]
    times: tuple[float, float]
    edges: tuple[float, float]
    result: tuple[slice, slice]
    curves: tuple[Curve, ...]

    def column(self, t: float) -> float:
        """Where `t` [R/c] is on the axis; what lies outside is at its end."""
        return float(np.interp(t, self.times, self.edges))

    def draw(self, picture: NDArray[np.uint8], t: float) -> None:
        """Show the curves until `t` in `picture` (rows, columns, 4)."""
        at = self.column(t)
        now = round(at)
        picture[:, :now, :3] = self.full[:, :now]
        picture[:, now:, :3] = self.empty[:, now:]
        told = now > (self.result[1].start + self.result[1].stop) / 2
        picture[..., :3][self.result] = (self.full if told else self.empty)[self.result]
        for curve in self.curves:
            self._mark(picture, at, float(np.interp(at, curve.columns, curve.rows)), curve.colour)

    def _mark(self, picture: NDArray[np.uint8], column: float, row: float, colour: tuple[int, int, int]) -> None:
        """A smooth dot about (column, row); a pixel k covers k to k + 1."""
        radius = _DOT * len(self.empty) / 720
        top, left = int(row - radius) - 1, int(column - radius) - 1
        size = int(2 * radius) + 4
        part = picture[max(top, 0) : top + size, max(left, 0) : left + size, :3]
        rows, columns = np.arange(part.shape[0]) + max(top, 0) + 0.5, np.arange(part.shape[1]) + max(left, 0) + 0.5
        distance = np.hypot(rows[:, None] - row, columns - column)
        cover = np.clip(radius + 0.5 - distance, 0.0, 1.0)[..., None]
        part[:] = np.rint(part + cover * (np.array(colour) - part))
