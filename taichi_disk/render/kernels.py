"""What has to be fast of a picture: corners and colours of triangles, the smoothing of pixels.

Kernels take NumPy arrays alone, so that they are compiled once for all lattices. Loops are serial: two thousand light
iterations cost less than waking a second thread.
"""

import numpy as np
from numpy.typing import NDArray

from taichi_disk.engine import ti

VERTEX = 12  # numbers of a vertex as GGUI takes it: position (3), normal (3), texture (2), colour (4)

_Pair = ti.types.vector(2, ti.f64)
_Sample = ti.types.vector(4, ti.f32)


@ti.kernel
def fill(
    x: ti.types.ndarray(ti.f64, ndim=2),
    values: ti.types.ndarray(ti.f64, ndim=1),
    triangles: ti.types.ndarray(ti.i32, ndim=2),
    pattern: ti.types.ndarray(ti.f64, ndim=2),
    inset: ti.f64,
    colours: ti.types.ndarray(ti.f32, ndim=2),
    fringes: ti.i32,
    factor: _Pair,
    shift: _Pair,
    out: ti.types.ndarray(ti.f32, ndim=2),
):
    """Vertices (triangles * q, VERTEX) of triangles that are drawn with a pattern of q corners each.

    Args:
        values: (n,) in the map of colours, 0 to 1, or arguments of the fringes.
        pattern: (q, 3) weights of a triangle's three corners.
        inset: by how much the sides lie inside [R].
    """
    ti.loop_config(serialize=True)
    for t in range(triangles.shape[0]):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        p, q, r = ti.Vector([x[a, 0], x[a, 1]]), ti.Vector([x[b, 0], x[b, 1]]), ti.Vector([x[c, 0], x[c, 1]])
        # To move the sides in by d is to scale by 1 - d/radius about the centre of the inscribed circle.
        la, lb, lc = (q - r).norm(), (r - p).norm(), (p - q).norm()
        around = la + lb + lc + 1e-300
        centre, radius = (la * p + lb * q + lc * r) / around, ti.abs((q - p).cross(r - p)) / around + 1e-300
        size = ti.max(1.0 - inset / radius, 0.0)
        for k in range(pattern.shape[0]):
            u, v, w = pattern[k, 0], pattern[k, 1], pattern[k, 2]
            position = factor * (centre + size * (u * p + v * q + w * r - centre)) + shift
            value = u * values[a] + v * values[b] + w * values[c]
            if fringes:
                wave = ti.sin(3.141592653589793 * value)
                value = wave * wave
            level = ti.cast(ti.math.clamp(value, 0.0, 1.0) * (colours.shape[0] - 1) + 0.5, ti.i32)
            vertex = t * pattern.shape[0] + k
            for d in ti.static(range(2)):
                out[vertex, d] = ti.cast(position[d], ti.f32)
            for d in ti.static(range(3)):
                out[vertex, 8 + d] = colours[level, d]


def weights(samples: int) -> NDArray[np.float64]:
    """(2, samples): how much of each of two neighbouring pixels each of the samples across both covers."""
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
    """Average `samples` x `samples` samples [x, y upwards] over the 2 x 2 pixels that they cover.

    `picture` [row downwards, column, colour]: what was drawn gets its lower left corner at row `bottom` (not included)
    and column `left`. Its first and last column are repeated over `beside` more.
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
                            weight = ti.static(255.0 * float(weights(samples)[a, k] * weights(samples)[b, m]))
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
