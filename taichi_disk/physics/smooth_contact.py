"""Smooth contact with the elastic wall: a V0 exp(-a l) from a curve along the wall's
surface points.

The paper's contact (`elastic_wall`) jumps when a point passes from one spring of the
wall to the next. This contact has a continuous force. The surface is a quadratic
B-spline with the wall's surface points as control points: between the middles of two
springs it is the parabola

    S = sum_i B_i(t) P_i,   B = (1 - t)^2/2, 1/2 + t - t^2, t^2/2,   i the spring ends
    left, middle, right.

At the height l = y - S(x) above the curve the potential is V0 exp(-a l). A point is
pushed along (-S'(x), 1), and the three control points take the fractions B_i of the
reaction. The forces add up to zero and are the gradient of the
potential, but a torque remains: l times the horizontal force. There is no wall beyond
the middles of the outermost springs.
"""

import numpy as np

from taichi_disk.engine import ti
from taichi_disk.lattice import Array
from taichi_disk.physics.elastic_wall import ElasticWall
from taichi_disk.physics.law import get


@ti.data_oriented
class SmoothElasticWall(ElasticWall):
    """The contact law between the disk's surface points and a smooth curve along the
    wall's surface points."""

    has_jumps = False
    carriers = 3
    steepness = 1.0

    @ti.func
    def contact(self, state: ti.template(), i, k):
        height, direction, shares = (
            self.threshold_now[None],
            ti.Vector([0.0, 0.0]),
            ti.Vector([0.0, 0.0, 0.0]),
        )
        x, first = get(state.x, i), k - 1
        p, q = (
            get(state.x, self.wall_surface[k]),
            get(state.x, self.wall_surface[k + 1]),
        )
        if 2.0 * x[0] >= p[0] + q[0]:
            first += 1
        if first >= 0 and first < self.count[1] - 2:
            before, middle, after = [
                get(state.x, self.wall_surface[first + c]) for c in range(3)
            ]
            p, q = middle - before, after - middle
            start = before + 0.5 * p
            # Solve start + p t + (q - p) t^2/2 = x for t in 0..1, for either sign of
            # the curvature.
            ahead = x[0] - start[0]
            t = (
                2.0
                * ahead
                / (
                    p[0]
                    + ti.sqrt(ti.max(p[0] * p[0] + 2.0 * (q[0] - p[0]) * ahead, 0.0))
                )
            )
            height = x[1] - (start[1] + t * (p[1] + 0.5 * t * (q[1] - p[1])))
            slope = (p[1] + t * (q[1] - p[1])) / (p[0] + t * (q[0] - p[0]))
            direction = ti.Vector([-slope, 1.0])
            shares = ti.Vector(
                [0.5 * (1.0 - t) * (1.0 - t), 0.5 + t - t * t, 0.5 * t * t]
            )
        return height, direction, first, shares

    # ---- in NumPy

    def pieces(self, chain: Array) -> tuple[Array, Array]:
        p, q = np.diff(chain, axis=0)[:-1], np.diff(chain, axis=0)[1:]
        return chain[:-2] + 0.5 * p, chain[2:] - 0.5 * q

    def geometry(self, x: Array, ends: Array) -> tuple[Array, Array, Array]:
        p, q = ends[:, 1] - ends[:, 0], ends[:, 2] - ends[:, 1]
        start = ends[:, 0] + 0.5 * p
        ahead, bend = x[:, 0] - start[:, 0], q - p
        t = (
            2.0
            * ahead
            / (
                p[:, 0]
                + np.sqrt(np.maximum(p[:, 0] ** 2 + 2.0 * bend[:, 0] * ahead, 0.0))
            )
        )
        height = x[:, 1] - (start[:, 1] + t * (p[:, 1] + 0.5 * t * bend[:, 1]))
        slope = (p[:, 1] + t * bend[:, 1]) / (p[:, 0] + t * bend[:, 0])
        shares = np.stack([0.5 * (1.0 - t) ** 2, 0.5 + t - t * t, 0.5 * t * t], axis=1)
        return height, np.stack([-slope, 1.0 + 0.0 * t], axis=1), shares
