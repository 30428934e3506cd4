"""The implicit dashpot: one sparse symmetric solve a step, with a Cholesky factor held in Taichi fields.

With v_ the velocities half a step ago and F the springs' and walls' forces at this step, the velocity u at
this step, centred between v_ and v_+ = 2 u - v_, obeys

    (1 + h/2 (eta/m) L) u = v_ + h/2 F/m,      L = graph Laplacian of the springs,

which is leapfrog with the dashpot trapezoidal: order 2, and stable up to the undamped limit whatever eta is.
"""

import taichi as ti


class ImplicitDashpot:
    """The solve; part of `World`."""

    @ti.func
    def solve_dashpot(self):
        """Solve the matrix with the right-hand side in `z` (elimination order); the result is left in `z`."""
        y = ti.static(self.components - 1)
        for k in range(self.n_free):
            zk = self.z[k]
            for e in range(self.column[k], self.column[k + 1]):
                c = self.factor[e]
                for w in ti.static(range(self.lanes)):
                    self.z[self.row[e]][0, w] -= c[0] * zk[0, w]
                    self.z[self.row[e]][1, w] -= c[y] * zk[1, w]
        for back in range(self.n_free):
            k = self.n_free - 1 - back
            d = self.inverse_diagonal[k]
            zk = self.z[k]
            for w in ti.static(range(self.lanes)):
                zk[0, w] *= d[0]
                zk[1, w] *= d[y]
            for e in range(self.column[k], self.column[k + 1]):
                c = self.factor[e]
                other = self.z[self.row[e]]
                for w in ti.static(range(self.lanes)):
                    zk[0, w] -= c[0] * other[0, w]
                    zk[1, w] -= c[y] * other[1, w]
            self.z[k] = zk
