"""Contact with the elastic wall, smooth: a V0 exp(-a l) over a curve through the wall's surface points.

The paper's contact (`elastic_wall`) jumps where a point passes from one spring of the wall to the next. This one has a
continuous force. The surface is a quadratic B-spline with the wall's surface points as control points: between the
middles of two springs it is the parabola

    S = sum_i B_i(t) P_i,   B = (1 - t)^2/2, 1/2 + t - t^2, t^2/2,   i the spring ends left, middle, right.

At the height l = y - S(x) over it the potential is V0 exp(-a l). A point is pushed along (-S'(x), 1), and the three
control points take the reaction in the parts B_i: forces add up to zero, and are the gradient of the potential. The
torque that is left is l times the horizontal force. Beyond the middles of the outermost springs there is no wall.
"""

import numpy as np

from taichi_disk.engine import ti
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics.elastic_wall import Contacts, ElasticWall
from taichi_disk.physics.law import get, put


@ti.data_oriented
class SmoothElasticWall(ElasticWall):
    """The contact law between the disk's surface points and a smooth curve along the wall's."""

    has_jumps = False

    @ti.func
    def add(self, state: ti.template(), move):
        """Push every surface point of the disk off the curve below it.

        Returns the upward force on the disk [M c^2/R], the potential [M c^2], the largest force on one point, and 0:
        nothing is lost by sliding.
        """
        a, V0, threshold = self.a_now[None], self.V0_now[None], self.threshold_now[None]
        upward, potential, peak_point_force = 0.0, 0.0, 0.0
        last = self.count[1] - 1
        top, left = self.top_and_left(state)
        pitch = (state.x[0][self.wall_surface[last]] - left) / last
        for n in range(self.count[0]):
            i = self.disk_surface[n]
            place = get(state.x, i)
            if place[1] < top + threshold:
                guess = ti.max(0, ti.min(last - 1, ti.cast((place[0] - left) / pitch, ti.i32)))
                k = self.spring_below(state, i, guess, 0.0)
                p, q = get(state.x, self.wall_surface[k]), get(state.x, self.wall_surface[k + 1])
                if 2.0 * place[0] >= p[0] + q[0]:
                    k += 1
                if k > 0 and k < last:
                    before, middle, after = self.wall_surface[k - 1], self.wall_surface[k], self.wall_surface[k + 1]
                    p, q = get(state.x, middle) - get(state.x, before), get(state.x, after) - get(state.x, middle)
                    start = get(state.x, before) + 0.5 * p
                    # start + p t + (q - p) t^2/2 is at x: the root in 0..1, whichever way the parabola bends.
                    ahead = place[0] - start[0]
                    t = 2.0 * ahead / (p[0] + ti.sqrt(ti.max(p[0] * p[0] + 2.0 * (q[0] - p[0]) * ahead, 0.0)))
                    height = place[1] - (start[1] + t * (p[1] + 0.5 * t * (q[1] - p[1])))
                    if height < threshold:
                        slope = (p[1] + t * (q[1] - p[1])) / (p[0] + t * (q[0] - p[0]))
                        energy = V0 * ti.exp(-a * height)
                        point_force = (a * energy) * ti.Vector([-slope, 1.0])
                        put(state.f, i, get(state.f, i) + point_force)
                        put(state.f, before, get(state.f, before) - (0.5 * (1.0 - t) * (1.0 - t)) * point_force)
                        put(state.f, middle, get(state.f, middle) - (0.5 + t - t * t) * point_force)
                        put(state.f, after, get(state.f, after) - (0.5 * t * t) * point_force)
                        upward += point_force[1]
                        potential += energy - self.shift_now[None]
                        peak_point_force = ti.max(peak_point_force, point_force.norm())
        return upward, potential, peak_point_force, 0.0

    # ---- in NumPy

    def contacts(self, lattice: Lattice, x: Array) -> Contacts:
        chain = x[lattice.wall_surface]
        p, q = np.diff(chain, axis=0)[:-1], np.diff(chain, axis=0)[1:]
        start, end = chain[:-2] + 0.5 * p, chain[2:] - 0.5 * q
        px = x[lattice.disk_surface, 0][:, None]
        over = (start[:, 0] <= px) & (px < end[:, 0])
        rows = np.flatnonzero(over.any(axis=1))
        points, middle = lattice.disk_surface[rows].astype(np.intp), over[rows].argmax(axis=1)
        p, q, start = p[middle], q[middle], start[middle]
        ahead, bend = x[points, 0] - start[:, 0], q - p
        t = 2.0 * ahead / (p[:, 0] + np.sqrt(np.maximum(p[:, 0] ** 2 + 2.0 * bend[:, 0] * ahead, 0.0)))
        height = x[points, 1] - (start[:, 1] + t * (p[:, 1] + 0.5 * t * bend[:, 1]))
        slope = (p[:, 1] + t * bend[:, 1]) / (p[:, 0] + t * bend[:, 0])
        weights = np.stack([0.5 * (1.0 - t) ** 2, 0.5 + t - t * t, 0.5 * t * t], axis=1)
        return self._contacts(
            points, middle[:, None] + np.arange(3), weights, height, np.stack([-slope, 1.0 + 0.0 * t], axis=1)
        )
