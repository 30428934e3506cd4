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

from taichi_disk.base.engine import ti
from taichi_disk.mechanics.lattice import Array
from taichi_disk.mechanics.physics.elastic_wall import ElasticWall
from taichi_disk.mechanics.physics.law import get


@ti.data_oriented
class SmoothElasticWall(ElasticWall):
    """The contact law between the disk's surface points and a smooth curve along the
    wall's surface points."""

    has_jumps = False
    carriers = 3
    steepness = 1.0
    corner_depth = 0.01  # an eighth of the surface's second difference

    @ti.func
    def contact(self, state: ti.template(), i, k):
        height = self.threshold_now[None]
        direction = ti.Vector([0.0, 0.0])
        shares = ti.Vector([0.0, 0.0, 0.0])
        x = get(state.x, i)
        first = k - 1
        left = get(state.x, self.wall_surface[k])
        right = get(state.x, self.wall_surface[k + 1])
        if 2.0 * x[0] >= left[0] + right[0]:
            first += 1
        if first >= 0 and first < self.count[1] - 2:
            before, middle, after = [
                get(state.x, self.wall_surface[first + c]) for c in range(3)
            ]
            chord = middle - before
            bend = after - middle - chord
            start = before + 0.5 * chord
            # stable root of bend t^2/2 + chord t = distance, for either sign of bend
            distance = x[0] - start[0]
            discriminant = chord[0] * chord[0] + 2.0 * bend[0] * distance
            t = 2.0 * distance / (chord[0] + ti.sqrt(ti.max(discriminant, 0.0)))
            surface = start[1] + t * (chord[1] + 0.5 * t * bend[1])
            height = x[1] - surface
            slope = (chord[1] + t * bend[1]) / (chord[0] + t * bend[0])
            direction = ti.Vector([-slope, 1.0])
            shares = ti.Vector(
                [0.5 * (1.0 - t) * (1.0 - t), 0.5 + t - t * t, 0.5 * t * t]
            )
        return height, direction, first, shares

    # ---- in NumPy

    def pieces(self, chain: Array) -> tuple[Array, Array]:
        chords = np.diff(chain, axis=0)
        return chain[:-2] + 0.5 * chords[:-1], chain[2:] - 0.5 * chords[1:]

    def geometry(self, x: Array, ends: Array) -> tuple[Array, Array, Array]:
        before, middle, after = ends.swapaxes(0, 1)
        chord = middle - before
        bend = after - middle - chord
        start_x, start_y = (before + 0.5 * chord).T
        chord_x, chord_y = chord.T
        bend_x, bend_y = bend.T
        # stable root of bend t^2/2 + chord t = distance, for either sign of bend
        distance = x[:, 0] - start_x
        discriminant = chord_x**2 + 2.0 * bend_x * distance
        root = np.sqrt(np.maximum(discriminant, 0.0))
        t = 2.0 * distance / (chord_x + root)
        height = x[:, 1] - (start_y + t * (chord_y + 0.5 * t * bend_y))
        slope = (chord_y + t * bend_y) / (chord_x + t * bend_x)
        direction = np.stack([-slope, np.ones_like(t)], axis=1)
        shares = np.stack([0.5 * (1.0 - t) ** 2, 0.5 + t - t * t, 0.5 * t * t], axis=1)
        return height, direction, shares
