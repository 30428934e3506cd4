"""The implicit dashpots of large lattices, solved by Chebyshev iteration (see `model.chebyshev`).

A sweep gathers the velocities of each point's neighbours: any number of cores may share the points.
"""

import taichi as ti

from taichi_disk.model.vectors import get, put

AFTER_STOP = 4  # rounds of sweeps after the boundary has been stopped, each as many as in a step


class Sweeps:
    """Solves for the velocities at a step without a factor; part of `World`.

    `z` holds two iterates, at 0 and at n; the iterate before the last is overwritten by the next. `iteration` holds c,
    1/theta, w_0, w_1 ...
    """

    @ti.func
    def swept(self, p: ti.template(), i, k):
        """The velocity of point i after sweep k; the right-hand side is v + h/2 f/m."""
        slot = (k % 2) * p.n
        u = get(self.z, slot + i)
        before = u
        if k > 0:
            before = get(self.z, p.n - slot + i)
        nearby = get(self.z, slot + self.neighbours[0][i])
        for e in ti.static(range(1, self.most_neighbours)):
            nearby = nearby + get(self.z, slot + self.neighbours[e][i])
        lost = self.most_neighbours * u - nearby
        rest = get(self.v, i) + 0.5 * p.g * get(self.f, i) - u - self.iteration[0] * lost
        if ti.static(self.physics.boundary == "dashpot"):
            outer = get(self.outer, i)
            for w in ti.static(range(self.lanes)):
                for c in ti.static(range(2)):
                    rest[c, w] -= outer[c] * u[c, w]
        return before + self.iteration[2 + k] * (u + self.iteration[1] * rest - before)

    @ti.func
    def sweep(self, p: ti.template(), k, first, last):
        """Sweep k over the points first..last."""
        other = (1 - k % 2) * p.n
        for i in range(first, last):
            put(self.z, other + i, self.swept(p, i, k))

    @ti.func
    def sweep_to_end(self, p: ti.template(), first, last):
        """The last sweep: leaves the velocity in `u`, and the force that it implies in `f`.

        A reset boundary needs the force without dashpots a little longer. Returns per lane what `solve_velocities`
        does, of these points: two powers.
        """
        half = 0.5 * p.g
        power = ti.Vector.zero(self.real, self.lanes)
        cross = ti.Vector.zero(self.real, self.lanes)
        for i in range(first, last):
            u, before = self.swept(p, i, self.sweeps - 1), get(self.u, i)
            v, f = get(self.v, i), get(self.f, i)
            kick = u - v
            loss = f - kick / half
            for w in ti.static(range(self.lanes)):
                power[w] += u[0, w] * loss[0, w] + u[1, w] * loss[1, w]
                cross[w] += before[0, w] * loss[0, w] + before[1, w] * loss[1, w]
            put(self.u, i, u)
            if ti.static(self.physics.boundary != "reset"):
                put(self.f, i, kick / half)
        return power, cross

    @ti.func
    def sweep_after_stop(self, p: ti.template()):
        """Solve into `z` with the right-hand side u + h/2 f/m, from a guess that is worse than at other steps."""
        for i in range(p.n):
            put(self.v, i, get(self.u, i))
            put(self.z, i, get(self.u, i))
        for _ in range(AFTER_STOP):
            for k in range(self.sweeps):
                self.sweep(p, k, 0, p.n)
            if ti.static(self.sweeps % 2 == 1):
                for i in range(p.n):
                    put(self.z, i, get(self.z, p.n + i))
