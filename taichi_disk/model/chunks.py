"""Large lattices: a step by several cores, chunk by chunk (see `ordering`), with the bytes of one core.

A step is two loops: move all chunks with the springs inside them, in parallel; then what concerns the whole lattice, on
one core: the springs across the seams, the sums (chunk by chunk, in their order), contact, boundary. Implicit dashpots
add a parallel loop for each sweep of their solver. To gather each point's springs instead, with no seams but every
spring computed twice, takes 1.5 times as long (100,000 points, one core).
"""

import taichi as ti

from taichi_disk.model.parameters import Parameters, rounded
from taichi_disk.model.vectors import get, put

GRAIN = 512  # iterations that Taichi 1.7.4 gives to a core at once, whatever block_dim says: a chunk each
STAGES = 2  # forces computed in one launch; more take long to compile


class Chunks:
    """Steps of a large lattice; part of `World`."""

    @ti.func
    def move_chunk(self, numbers, stage: ti.template(), c):
        """Drift and inner springs of chunk c."""
        p = rounded(numbers) if ti.static(self.single) else numbers
        kick, move = self.kick_of(p, stage), self.move_of(p, stage)
        sums = get(self.sums, 0)
        if ti.static(self.single):
            sums = self.move_frame(kick, move, sums)
        begin = 0
        if c > 0:
            begin = self.chunk_ends[c - 1]
        first = c * p.chunk_points
        total, highest = self.drift(p, kick, move, sums, first, ti.min(first + p.chunk_points, p.n))
        elastic, products = self.add_spring_forces(p, self.physics.explicit_dashpot, begin, self.chunk_ends[c])
        for w in ti.static(range(self.lanes)):
            self.chunk_sums[0][w][c] = total[w]
            self.chunk_sums[1][w][c] = highest[w]
            self.chunk_sums[2][w][c] = elastic[w]
            self.chunk_sums[3][w][c] = products[w]

    @ti.func
    def sweep_chunk(self, numbers, k: ti.template(), c):
        """Sweep k over the points of chunk c; the last one leaves its sums."""
        p = rounded(numbers) if ti.static(self.single) else numbers
        first = c * p.chunk_points
        last = ti.min(first + p.chunk_points, p.n)
        if ti.static(k < self.sweeps - 1):
            self.sweep(p, k, first, last)
        else:
            power, cross = self.sweep_to_end(p, first, last)
            for w in ti.static(range(self.lanes)):
                self.chunk_sums[0][w][c] = power[w]
                self.chunk_sums[1][w][c] = cross[w]

    @ti.func
    def end_sweeps(self, numbers, number):
        """The step's end, where dashpots had to be solved first."""
        p = rounded(numbers) if ti.static(self.single) else numbers
        put(self.sums, 0, self.account(p, number, get(self.sums, 0), ti.Vector.zero(self.real, self.lanes)))

    @ti.func
    def join_chunks(self, numbers, stage: ti.template(), last: ti.template(), number):
        """What concerns the whole lattice: seams, sums, contact; after the `last` stage the step's end."""
        p = rounded(numbers) if ti.static(self.single) else numbers
        move = self.move_of(p, stage)
        sums = get(self.sums, 0)
        if ti.static(self.single):
            sums = self.move_frame(self.kick_of(p, stage), move, sums)
        total = ti.Vector.zero(self.real, self.lanes)
        highest = ti.Vector.zero(self.real, self.lanes)
        elastic, products = self.add_spring_forces(
            p, self.physics.explicit_dashpot, self.chunk_ends[self.chunks - 1], p.blocks
        )
        for c in range(self.chunks):
            part = get(self.chunk_sums, c)
            for w in ti.static(range(self.lanes)):
                total[w] += part[0, w]
                highest[w] = ti.max(highest[w], part[1, w])
                elastic[w] += part[2, w]
                products[w] += part[3, w]
        sums, upward, potential = self.touch(p, move, sums, total, highest)
        if ti.static(last):
            sums = self.account(p, number, sums, products)
        put(self.sums, 0, sums)
        for w in ti.static(range(self.lanes)):
            self.latest[0][w][0] = elastic[w]
            self.latest[1][w][0] = upward[w]
            self.latest[2][w][0] = potential[w]

    @ti.func
    def kick_of(self, p: ti.template(), stage: ti.template()):
        return ti.static(self.splitting.joined_kicks[stage]) * p.g

    @ti.func
    def move_of(self, p: ti.template(), stage: ti.template()):
        return ti.static(self.splitting.moves[stage]) * p.h

    @ti.kernel
    def _advance_chunks(self, numbers: Parameters, number: ti.i32, steps: ti.i32):
        """Make `steps` steps after step `number`, at most `steps_per_launch`."""
        for k in ti.static(range(self.steps_per_launch)):
            for stage in ti.static(range(self.splitting.forces)):
                for q in range(GRAIN * self.chunks * ti.cast(k < steps, ti.i32)):
                    if q % GRAIN == 0:
                        self.move_chunk(numbers, stage, q // GRAIN)
                ti.loop_config(serialize=True)
                for _ in range(ti.cast(k < steps, ti.i32)):
                    last = ti.static(stage == self.splitting.forces - 1 and self.sweeps == 0)
                    self.join_chunks(numbers, stage, last, number + k + 1)
            for s in ti.static(range(self.sweeps)):
                for q in range(GRAIN * self.chunks * ti.cast(k < steps, ti.i32)):
                    if q % GRAIN == 0:
                        self.sweep_chunk(numbers, s, q // GRAIN)
            if ti.static(self.sweeps > 0):
                ti.loop_config(serialize=True)
                for _ in range(ti.cast(k < steps, ti.i32)):
                    self.end_sweeps(numbers, number + k + 1)

    @ti.kernel
    def _look(self, numbers: Parameters, s: ti.i32, rows: ti.types.ndarray(dtype=ti.f64, ndim=3)):
        """Fill row `s` with the observables now."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            p = rounded(numbers) if ti.static(self.single) else numbers
            latest = get(self.latest, 0)
            elastic = ti.Vector.zero(self.real, self.lanes)
            upward = ti.Vector.zero(self.real, self.lanes)
            potential = ti.Vector.zero(self.real, self.lanes)
            for w in ti.static(range(self.lanes)):
                elastic[w], upward[w], potential[w] = latest[0, w], latest[1, w], latest[2, w]
            self.observe(p, rows, s, get(self.sums, 0), elastic, upward, potential)
