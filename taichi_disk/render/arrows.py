"""Arrows for the wall's push on points, as lines."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ARROW = 0.35  # length of the arrow of the full force [R]
LINES = 4  # of one arrow: the bar that it stands on, the shaft, two of the head
_HEAD, _ANGLE = 0.035, 0.5  # length of a head [R], angle between it and the shaft
_WEAK = 0.01  # of the full force: less is not shown
FAR = -1e3  # [R] where no camera looks


def arrow_lines(
    positions: NDArray[np.float64],
    points: NDArray[np.intp],
    forces: NDArray[np.float64],
    spacing: float,
    most: int,
) -> NDArray[np.float64]:
    """The ends (most, LINES, 2, 2) [R] of the lines of an arrow on each of the `points` (k,), the strongest first.

    Args:
        positions: (n, 2) [R].
        forces: (k, 2), full at length 1.
        spacing: of the points: arrows that stand close together have narrow heads [R].
        most: how many arrows there is room for; what is not needed lies where no camera looks.
    """
    size = np.hypot(forces[:, 0], forces[:, 1])
    strongest = np.argsort(-size, kind="stable")[:most]
    strongest = strongest[size[strongest] > _WEAK]
    k, foot, size = len(strongest), positions[points[strongest]], size[strongest, None]
    along = forces[strongest] / size
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    tip = foot + ARROW * size * along
    head = np.minimum(min(_HEAD, 0.8 * spacing), 0.5 * ARROW * size)
    c, s = head * np.cos(_ANGLE), head * np.sin(_ANGLE)
    bar = min(0.25 * spacing, 0.05) * across
    ends = np.full((most, LINES, 2, 2), FAR)
    ends[:, :, 1, 1] -= 1.0  # a line has a length
    ends[:k, 0] = np.stack([foot - bar, foot + bar], axis=1)
    ends[:k, 1] = np.stack([foot, tip], axis=1)
    ends[:k, 2] = np.stack([tip, tip - c * along + s * across], axis=1)
    ends[:k, 3] = np.stack([tip, tip - c * along - s * across], axis=1)
    return ends
