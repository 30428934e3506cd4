"""Average the samples that GGUI drew into the pixels of a picture.

The kernel takes NumPy arrays, so it is compiled once for all lattices. Its loops are
serial, because waking a second thread costs more than these light iterations.
"""

import numpy as np
from numpy.typing import NDArray

from taichi_disk.engine import ti

# length of a GGUI vertex: position (3), normal (3), texture (2), colour (4)
VERTEX = 12

_Sample = ti.types.vector(4, ti.f32)


def weights(samples: int) -> NDArray[np.float64]:
    """Return the fractions (2, samples) of two adjacent pixels that each of the samples
    across both covers."""
    edges = np.arange(samples + 1) * 2.0 / samples
    return np.array([np.diff(np.clip(edges, pixel, pixel + 1)) for pixel in (0, 1)])


@ti.kernel
def shrink(
    drawn: ti.types.ndarray(dtype=_Sample, ndim=2),
    picture: ti.types.ndarray(ti.u8, ndim=3),
    left: ti.i32,
    bottom: ti.i32,
    beside: ti.i32,
    samples: ti.template(),
):
    """Shrink the image `drawn` [x, y upwards] into `picture` [row downwards, column,
    colour].

    Each block of `samples` x `samples` pixels becomes 2 x 2 pixels. The shrunk image
    ends above row `bottom`. Columns from `left` on show it; its first and last column
    are repeated over `beside` further columns.
    """
    ti.loop_config(serialize=True)
    for x in range(drawn.shape[0] // samples):
        for y in range(drawn.shape[1] // samples):
            i, j = samples * x, samples * y
            row, column = bottom - 1 - 2 * y, left + 2 * x
            for a in ti.static(range(2)):
                for b in ti.static(range(2)):
                    mean = _Sample(0.5)
                    for k in ti.static(range(samples)):
                        for m in ti.static(range(samples)):
                            weight = ti.static(
                                255.0
                                * float(weights(samples)[a, k] * weights(samples)[b, m])
                            )
                            if ti.static(weight > 0.0):
                                mean += ti.cast(weight, ti.f32) * drawn[i + k, j + m]
                    for c in ti.static(range(3)):
                        picture[row - b, column + a, c] = ti.cast(mean[c], ti.u8)
    right = left + 2 * (drawn.shape[0] // samples)
    ti.loop_config(serialize=True)
    for up in range(2 * (drawn.shape[1] // samples)):
        row = bottom - 1 - up
        for column in range(beside):
            for c in ti.static(range(3)):
                picture[row, left - 1 - column, c] = picture[row, left, c]
                picture[row, right + column, c] = picture[row, right - 1, c]
