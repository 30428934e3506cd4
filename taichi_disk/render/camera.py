"""Where a point of the scene falls in the picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Camera:
    """A fixed view with equal scales in x and y, filling a rectangle (the stage) of the picture."""

    left: int  # the stage in the picture, in pixels from the picture's upper left corner
    top: int
    width: int
    height: int
    scale: float  # pixels per R
    centre: tuple[float, float]  # the point of the scene in the middle of the stage [R]

    @classmethod
    def fit(
        cls,
        view: tuple[float, float, float, float],
        left: int,
        top: int,
        width: int,
        height: int,
        margin: float,
    ) -> Camera:
        """The largest scale at which `view` (xmin, xmax, ymin, ymax), with a margin in pixels, fits a rectangle.

        The stage is then as much of the rectangle as the view needs, in its middle: what is not drawn need
        not be read back from the graphics device.
        """
        xmin, xmax, ymin, ymax = view
        scale = min((width - 2 * margin) / (xmax - xmin), (height - 2 * margin) / (ymax - ymin))
        wide = min(2 * math.ceil((scale * (xmax - xmin) + 2 * margin) / 2), width)
        high = min(2 * math.ceil((scale * (ymax - ymin) + 2 * margin) / 2), height)
        centre = ((xmin + xmax) / 2, (ymin + ymax) / 2)
        return cls(left + (width - wide) // 2, top + (height - high) // 2, wide, high, scale, centre)

    def to_pixels(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Points (..., 2) [R] to (column, row) in the picture, row downwards; pixel k covers k to k + 1."""
        offset = (np.asarray(xy, dtype=np.float64) - self.centre) * self.scale
        return np.stack(
            [self.left + self.width / 2 + offset[..., 0], self.top + self.height / 2 - offset[..., 1]],
            axis=-1,
        )

    def canvas_map(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Factor and shift (2,): canvas coordinates (0..1 over the stage, y up) are factor * xy + shift."""
        factor = self.scale / np.array([self.width, self.height])
        return factor, 0.5 - factor * np.asarray(self.centre)
