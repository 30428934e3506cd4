"""Where a point of the scene falls on the canvas, and back. A value: zooming and panning make new cameras."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from taichi_disk.lattice import Array

View = tuple[float, float, float, float]


@dataclass(frozen=True)
class Camera:
    """A view with equal scales in x and y. Pixels count from the canvas's upper left corner, rows downwards.

    Attributes:
        width, height: of the canvas [px].
        scale: pixels per R.
        look_at: a point of the scene [R] ...
        middle: ... and where it is seen (column, row) [px].
        stage: (left, right, top, bottom) [px], the part of the canvas that is for the scene.
    """

    width: int
    height: int
    scale: float
    look_at: tuple[float, float]
    middle: tuple[float, float]
    stage: View

    @classmethod
    def fit(cls, view: View, width: int, height: int, margin: float = 0.0, stage: View | None = None) -> Camera:
        """The largest scale at which `view` (xmin, xmax, ymin, ymax) [R] fits, in the middle of the stage.

        Args:
            margin: around the view [px].
            stage: the part of the canvas to fill; by default all of it.
        """
        xmin, xmax, ymin, ymax = view
        left, right, top, bottom = stage = stage or (0.0, float(width), 0.0, float(height))
        room = right - left - 2.0 * margin, bottom - top - 2.0 * margin
        scale = max(min(room[0] / (xmax - xmin), room[1] / (ymax - ymin)), 1e-3)
        middle = (left + right) / 2.0, (top + bottom) / 2.0
        return cls(width, height, scale, ((xmin + xmax) / 2.0, (ymin + ymax) / 2.0), middle, stage)

    def to_pixels(self, xy: ArrayLike) -> Array:
        """Points (..., 2) [R] to (column, row) [px]; pixel k covers k to k + 1."""
        offset = (np.asarray(xy, dtype=np.float64) - self.look_at) * self.scale
        return np.stack([self.middle[0] + offset[..., 0], self.middle[1] - offset[..., 1]], axis=-1)

    def to_scene(self, pixels: ArrayLike) -> Array:
        """(column, row) (..., 2) [px] to points of the scene [R]."""
        offset = (np.asarray(pixels, dtype=np.float64) - self.middle) / self.scale
        return np.stack([self.look_at[0] + offset[..., 0], self.look_at[1] - offset[..., 1]], axis=-1)

    def zoomed(self, factor: float, at: tuple[float, float]) -> Camera:
        """`factor` times as large, with what is at `at` (column, row) staying there."""
        (x, y), (column, row) = self.middle, at
        middle = column + factor * (x - column), row + factor * (y - row)
        return replace(self, scale=self.scale * factor, middle=middle)

    def panned(self, columns: float, rows: float) -> Camera:
        """With everything moved by so many pixels."""
        return replace(self, middle=(self.middle[0] + columns, self.middle[1] + rows))

    def following(self, point: tuple[float, float]) -> Camera:
        """With `point` [R] where `look_at` was."""
        return replace(self, look_at=point)

    @property
    def seen(self) -> View:
        """(xmin, xmax, ymin, ymax) [R] of the stage."""
        left, right, top, bottom = self.stage
        (xmin, ymin), (xmax, ymax) = self.to_scene([(left, bottom), (right, top)])
        return float(xmin), float(xmax), float(ymin), float(ymax)

    def canvas_map(self) -> tuple[Array, Array]:
        """Factor and shift (2,): GGUI's coordinates (0 to 1 over the canvas, y upwards) are factor * xy + shift."""
        size = np.array([self.width, self.height])
        factor = self.scale / size
        origin = np.array([self.middle[0], self.height - self.middle[1]]) / size
        return factor, origin - factor * np.asarray(self.look_at)
