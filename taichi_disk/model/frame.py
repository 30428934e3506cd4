"""Single precision without losing the strain: displacements in a frame that moves with the disk.

Of a coordinate of order R, f32 keeps 6e-8 R: as much as a slow impact stretches a spring. So in f32 a point's place is
kept as base + (0, SHIFT) + x: `base` the unloaded lattice, SHIFT how far the disk's frame has moved up (f64, per lane;
none for the wall's points), x the displacement that is left, small and therefore fine. The frame is pushed by PUSH, the
mean of the forces from outside on a point of the disk, with the disk's own kicks and moves: a change of variables, no
approximation. A spring's extension comes without cancellation from its vector d in `base`:

    s = |d + x_i - x_j| - L = (2 d.(x_i - x_j) + |x_i - x_j|^2)/(r + L),    L = |d|.

In f64 the frame rests: x are the places themselves.
"""

import taichi as ti

from taichi_disk.model.sums import PUSH, SHIFT, SPEED


class Frame:
    """Where points are and how fast, whatever the variables; part of `World`."""

    @ti.func
    def place(self, p: ti.template(), i, c: ti.template(), w: ti.template(), sums):
        """Coordinate c of point i in lane w [R]."""
        value = self.x[c][w][i]
        if ti.static(self.single):
            value += self.base[c][i]
            if ti.static(c == 1):
                if i < p.n_disk:
                    value += ti.cast(sums[SHIFT, w], self.real)
        return value

    @ti.func
    def last_place(self, p: ti.template(), i, c: ti.template(), w: ti.template(), move, sums):
        """Coordinate c of point i in lane w before the last move by `move` times the velocity [R]."""
        v = self.v[c][w][i]
        if ti.static(self.single and c == 1):
            if i < p.n_disk:
                v += ti.cast(sums[SPEED, w], self.real)
        return self.place(p, i, c, w, sums) - move * v

    @ti.func
    def frame_kick(self, p: ti.template(), i, kick, sums):
        """What a kick gives the frame of point i, per lane [c]."""
        gain = ti.Vector.zero(self.real, self.lanes)
        if i < p.n_disk:
            for w in ti.static(range(self.lanes)):
                gain[w] = kick * ti.cast(sums[PUSH, w], self.real)
        return gain

    @ti.func
    def move_frame(self, kick, move, sums):
        """Kick and move the frames; returns `sums`."""
        result = sums
        for w in ti.static(range(self.lanes)):
            speed = sums[SPEED, w] + ti.cast(kick, ti.f64) * sums[PUSH, w]
            result[SPEED, w] = speed
            result[SHIFT, w] += ti.cast(move, ti.f64) * speed
        return result

    @ti.func
    def push_frame(self, p: ti.template(), total, sums):
        """Note the force of the wall, `total` per lane, and the load for the next kick; returns `sums`."""
        result = sums
        for w in ti.static(range(self.lanes)):
            force = ti.cast(total[w], ti.f64)
            if ti.static(self.physics.load != 0.0):
                force -= ti.cast(self.load[w][None], ti.f64)
            result[PUSH, w] = force / p.n_disk
        return result
