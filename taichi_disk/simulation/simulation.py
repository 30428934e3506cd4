"""A lattice, its laws and an integrator, combined into kernels that move the
lattice."""

from __future__ import annotations

from copy import deepcopy
from functools import lru_cache
from math import inf
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from taichi_disk import engine
from taichi_disk.engine import owner, ti
from taichi_disk.engine.internals import field_builder
from taichi_disk.errors import TaichiDiskError
from taichi_disk.integrators import LARGEST_FACTORISED, Integrator
from taichi_disk.integrators.conjugate_gradients import (
    Diagonal,
    IterativeSolver,
    diagonal,
)
from taichi_disk.integrators.trapezoidal import DashpotSolver, Factor, factorise
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics import Model
from taichi_disk.physics.law import Capacity
from taichi_disk.physics.ordering import (
    BLOCK,
    PARALLEL_FROM,
    Arrangement,
    arrange,
)
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.simulation.kernels import Kernels, SubdomainKernels
from taichi_disk.simulation.observables import INDEX, bounds_array
from taichi_disk.simulation.stepping import (
    PEAK_POINT_FORCE,
    PointFields,
    Snapshot,
    Written,
)

# Smallest capacity, so that all lattices of usual size can share compiled kernels:
# 12,000 points, each with 3 springs (a triangulation has fewer) and 27 entries of the
# dashpots' factor.
MIN_CAPACITY = Capacity(12_000, 3 * 12_000 // BLOCK, 27 * 12_000)
NEVER = 2**30  # number of successive rows that no run reaches
MAX_STEPS = 2**31 - 1  # kernels count the steps of a run in 32 bits
# time difference for the rate of change of forces at t = 0 [R/c]
DIFFERENCE_TIME = 1e-4
# potential of a point at which contact begins, over the kinetic energy of the flight
CONTACT_ENERGY = 1e-3

Dashpots = Factor | Diagonal | None  # matrix of implicit dashpots


class Load(NamedTuple):
    """What a simulation moves: a lattice with its laws, and what was written into the
    fields at t = 0, so that `Simulation.write_again` can write it once more."""

    lattice: Lattice
    model: Model
    dt: float
    arrangement: Arrangement
    written: Written


class Simulation:
    """Moves one lattice by (a copy of) a model's laws, from `velocities` (n, 2) [c] at
    t = 0, in steps of `dt` [R/c].

    Attributes:
        step_number: number of steps made since t = 0.
        first_row, now: (columns,) observables at t = 0, and after the last step.
        generation: number of restarts at t = 0; if it changes, another user has
            restarted the simulation.
        subdomains: number of subdomains of the lattice, 1 unless it is large.
    """

    def __init__(
        self,
        lattice: Lattice,
        model: Model,
        integrator: Integrator,
        velocities: Array,
        dt: float,
    ) -> None:
        self.integrator = integrator
        self.model = deepcopy(model)
        self.generation = 0
        self._program = engine.program()
        self.features = compiled_for(lattice, model, integrator)
        self.model.springs.prepare_for(lattice)
        arrangement = arrange(lattice.bonds, len(lattice.positions))
        factor = self._factor(lattice, model, dt)
        self.subdomains = arrangement.subdomains
        self._capacity = Capacity(
            *map(_doubled, _needed(lattice, arrangement, factor), MIN_CAPACITY)
        )
        # The user's own laws make fields, too, and may fail.
        with field_builder(ti) as builder:
            self._make_fields(builder, factor)
            self._tree = owner.call(builder.finalize)
            self._start(lattice, model, velocities, dt, arrangement, factor)

    def _make_fields(self, builder: Any, factor: Dashpots) -> None:
        for law in self.model.laws:
            law.make_fields(builder, self._capacity)
        self.state = PointFields(
            builder,
            self._capacity,
            self.subdomains,
            self.model,
            self.integrator.correction != 0.0,
        )
        components = 1
        if self.model.impedance is not None:
            components = 2
        solver: DashpotSolver | None = None
        if isinstance(factor, Diagonal):
            solver = IterativeSolver(
                builder,
                self._capacity,
                components,
                self.state.fillers,
                self.model.springs,
            )
            self.state.vectors += solver.previous
        elif factor is not None:
            solver = DashpotSolver(builder, self._capacity, components)
        parts = self.state, self.model, self.integrator, solver
        self.kernels: Kernels
        if self.subdomains > 1:
            self.kernels = SubdomainKernels(*parts, builder, self.subdomains)
        else:
            self.kernels = Kernels(*parts)

    def restart(
        self,
        lattice: Lattice,
        model: Model,
        integrator: Integrator,
        velocities: Array,
        dt: float,
    ) -> bool:
        """Become the simulation that these arguments would make, without a compilation.

        Returns False and changes nothing if the laws are of other kinds or the lattice
        is too large.
        """
        if (
            integrator is not self.integrator
            or compiled_for(lattice, model, integrator) != self.features
        ):
            return False
        arrangement = self._arrangement
        if lattice.bonds is not self.lattice.bonds:
            arrangement = arrange(lattice.bonds, len(lattice.positions))
        factor = self._factor(lattice, model, dt)
        needed = _needed(lattice, arrangement, factor)
        has_room = all(
            count <= most for count, most in zip(needed, self._capacity, strict=True)
        )
        if not has_room or arrangement.subdomains != self.subdomains:
            return False
        self._start(lattice, model, velocities, dt, arrangement, factor)
        return True

    def _factor(self, lattice: Lattice, model: Model, dt: float) -> Dashpots:
        if not (model.springs.damped and self.integrator.dashpots == "implicit"):
            return None
        if iterates(lattice, model, self.integrator):
            return diagonal(lattice, model, dt)
        return factorise(lattice, model, dt)

    def _start(
        self,
        lattice: Lattice,
        model: Model,
        v: Array,
        dt: float,
        arrangement: Arrangement,
        factor: Dashpots,
    ) -> None:
        self._take(lattice, model, dt, arrangement)
        state = self.state
        numbers: list[tuple[Any, float]] = [
            (state.h, dt),
            (state.closing, self.integrator.kicks[-1] * dt),
            (state.observed, self.integrator.observed_kick * dt),
            (state.contact, _contact_force(lattice, model, v)),
            (state.n, len(lattice.positions)),
            (state.n_disk, lattice.disk_points),
            (state.triangles, len(lattice.triangles)),
            (state.blocks, len(arrangement.ends) // BLOCK),
            (state.subdomain_points, arrangement.subdomain_points),
            (state.reset_steps, max(1, round(model.reset_interval / dt))),
        ]
        contents = state.contents(
            lattice, arrangement, self._vectors(lattice, model, v)
        )
        for law in self.model.laws:
            numbers += law.numbers()
            contents += law.contents(lattice, arrangement)
        if self.kernels.solver is not None:
            contents += self.kernels.solver.contents(factor)
        written = owner.call(state.begin, numbers, contents)
        self.load = Load(lattice, model, dt, arrangement, written)
        rows = np.empty((1, len(INDEX)))
        counts = np.array([NEVER, 0, 0, 0], np.int32)
        owner.call(self.kernels.advance, -1, 1, 1, rows, bounds_array({}), counts)
        self.first_row = self.now = rows[0]

    def write_again(self, load: Load, snapshot: Snapshot) -> None:
        """Take up a lattice that this simulation moved before another one, in a later
        state."""
        self._take(load.lattice, load.model, load.dt, load.arrangement)
        self.load = load
        self._write_state(load.written, snapshot)
        owner.call(self.state.begin_again, load.written)
        self.step_number = snapshot.step

    def _write_state(self, written: Written, snapshot: Snapshot) -> None:
        """Put a state into what was written, in place of the first state."""
        _, (masses, points, sums, *_), values = written
        first = 2 * masses
        end = first + snapshot.vectors[:, 0].size * points
        vectors = values[first:end].reshape(points, -1, 2)
        # pairs of numbers, which NumPy copies as one
        vectors.view(complex)[:masses, :, 0] = snapshot.vectors.view(complex)[..., 0].T
        values[end : end + sums] = snapshot.sums

    def _take(
        self, lattice: Lattice, model: Model, dt: float, arrangement: Arrangement
    ) -> None:
        for law, new in zip(self.model.laws, model.laws, strict=True):
            law.take_values(new)
        self.lattice = lattice
        self.dt = dt
        self._arrangement = arrangement
        self.step_number = 0
        self.generation += 1

    def _vectors(self, lattice: Lattice, model: Model, v: Array) -> list[Array]:
        """Return the vectors (n, 2) of the state at t = 0, as `Snapshot` lists them."""
        x = lattice.positions
        zero = np.zeros_like(x)
        if not self.state.corrected:
            return [x, v, zero, v][: len(self.state.vectors)]

        def acceleration(t: float) -> Array:
            forces = model.forces_moving(lattice, x + t * v, zero)
            return forces / lattice.masses[:, None]

        c = self.integrator.correction * self.dt**2
        a = acceleration(0.0)
        change = acceleration(DIFFERENCE_TIME) - acceleration(-DIFFERENCE_TIME)
        v_corrected = v + 0.5 * c / DIFFERENCE_TIME * change
        observed = v - self.integrator.observed_kick * self.dt * a
        return [x, v_corrected, zero, observed, x - c * a]

    # ---- time

    def advance(
        self,
        steps: int,
        stride: int = 1,
        bounds: Array | None = None,
        needed: int = NEVER,
        settled: int = 0,
    ) -> tuple[Array, int]:
        """Make `steps` steps, or fewer if the scene's end is reached.

        A row of observables is returned for every step whose number is a multiple of
        `stride`. `bounds` (2, columns): smallest and largest value of every column at
        the end. `needed`: number of successive rows within the bounds that ends the
        scene. `settled`: number of such rows so far. Returns the rows (rows, columns)
        and the new value of `settled`.
        """
        raise_if_interrupted()
        if not self.is_alive:
            raise TaichiDiskError(
                "a later ti.init or ti.reset has deleted the fields of this simulation:"
                " make another"
            )
        steps_since_row = self.step_number % stride
        max_rows = (steps_since_row + steps) // stride + 1
        rows = np.empty((max_rows, self.now.size))
        if bounds is None:
            bounds = bounds_array({})
        counts = np.array([needed, settled, 0, 0], np.int32)
        limits = rows, bounds, counts
        owner.call(self.kernels.advance, self.step_number, steps, stride, *limits)
        _, settled, made, count = counts.tolist()
        self.step_number += made
        if steps:
            # The kernel writes the state after the last step behind the rows, unless it
            # is the last row.
            present = count
            if self.step_number % stride == 0:
                present = count - 1
            self.now = rows[present]
        return rows[:count], settled

    @property
    def time(self) -> float:
        return self.step_number * self.dt

    # ---- states

    def snapshot(self) -> Snapshot:
        """Return a copy of the state, from which `restore` continues bitwise."""
        n = len(self.lattice.positions)
        return owner.call(self.state.export, n, self.step_number)

    def restore(self, snapshot: Snapshot) -> None:
        owner.call(self.state.restore, snapshot)
        self.step_number = snapshot.step

    def positions(self, snapshot: Snapshot | None = None) -> Array:
        """Return the positions (n, 2) [R], now or in a snapshot of this simulation."""
        return (snapshot or self.snapshot()).vectors[0].copy()

    def velocities(self, snapshot: Snapshot | None = None) -> Array:
        """Return the velocities (n, 2) [c], now or in a snapshot of this simulation."""
        return (snapshot or self.snapshot()).velocities(
            self.integrator, self.dt, self.lattice
        )

    def peak_point_force(self, snapshot: Snapshot | None = None) -> float:
        """Return the largest force of the wall on one point since t = 0 [M c^2/R]."""
        return float((snapshot or self.snapshot()).sums[PEAK_POINT_FORCE])

    def set_mouse_target(
        self, point: int, target: tuple[float, float] = (0.0, 0.0)
    ) -> float:
        """Tie `point` (-1: none) to the mouse at `target` [R], and return the jump of
        `load` [M c^2]."""
        return float(owner.call(self.kernels.set_mouse_target, point, *target))

    @property
    def is_alive(self) -> bool:
        """Whether the fields still exist: a `ti.init` or `ti.reset` by the user deletes
        them."""
        return engine.program() is self._program

    def destroy(self) -> None:
        self.generation = -1
        owner.call(self._tree.destroy)


class KernelCache:
    """Reuses compiled simulations, because a compilation takes seconds.

    `compile_seconds`: wall-clock time that simulations have taken until t = 0 [s].
    """

    def __init__(self) -> None:
        self.compile_seconds = 0.0
        self._known: dict[Any, Simulation] = {}

    def __reduce__(self) -> Any:
        # a pickled cache is empty: another process compiles its own kernels
        return KernelCache, ()

    def simulation(
        self,
        lattice: Lattice,
        model: Model,
        integrator: Integrator,
        velocities: Array,
        dt: float,
    ) -> Simulation:
        """Return a simulation reset to t = 0, reusing a compiled one if possible, which
        invalidates earlier returns."""
        began = perf_counter()
        # a small lattice and one for several cores keep a simulation each
        is_parallel = len(lattice.positions) >= PARALLEL_FROM
        key = (
            compiled_for(lattice, model, integrator),
            integrator.name,
            is_parallel,
        )
        known = self._known.get(key)
        arguments = lattice, model, integrator, velocities, dt
        if known is None or not known.is_alive or not known.restart(*arguments):
            raise_if_interrupted()
            if known is not None and known.is_alive:
                known.destroy()
            known = self._known[key] = Simulation(*arguments)
        self.compile_seconds += perf_counter() - began
        return known


@lru_cache(maxsize=1)
def _kernels_of(program: Any) -> KernelCache:
    return KernelCache()


def shared_kernels() -> KernelCache:
    """Return the cache of compiled simulations. A process has one, because it has one
    Taichi."""
    return _kernels_of(engine.program())


def compiled_for(
    lattice: Lattice, model: Model, integrator: Integrator
) -> tuple[Any, ...]:
    return (
        model.signature(),
        lattice.stiffness is None,
        iterates(lattice, model, integrator),
    )


def iterates(lattice: Lattice, model: Model, integrator: Integrator) -> bool:
    """Whether conjugate gradients solve for implicit dashpots, because the lattice is
    too large for a factor."""
    is_large = len(lattice.positions) > LARGEST_FACTORISED
    return is_large and model.springs.damped and integrator.dashpots == "implicit"


def _contact_force(lattice: Lattice, model: Model, v: Array) -> float:
    """Return the force of the wall on one point [M c^2/R] above which the disk is in
    contact; inf without a wall."""
    if model.wall is None:
        return inf
    speed = float(lattice.mean(v[:, 1]))  # towards the wall
    kinetic_energy = 0.5 * speed**2
    # where the wall's potential energy is U, its force is a U
    a = model.wall.added_stiffness(1.0)
    return CONTACT_ENERGY * kinetic_energy * a


def _needed(lattice: Lattice, arrangement: Arrangement, factor: Dashpots) -> Capacity:
    entries = 0
    if isinstance(factor, Factor):
        entries = len(factor.row)
    return Capacity(len(lattice.positions), len(arrangement.ends) // BLOCK, entries)


def _doubled(needed: int, least: int) -> int:
    while least < needed:
        least *= 2
    return least
