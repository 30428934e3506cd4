"""A lattice, its laws and an integrator, combined into kernels that move the
lattice."""

from __future__ import annotations

from copy import deepcopy
from functools import lru_cache
from math import inf
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk.base import engine
from taichi_disk.base.engine import owner, ti
from taichi_disk.base.engine.internals import field_builder
from taichi_disk.base.errors import TaichiDiskError
from taichi_disk.base.signals import raise_if_interrupted
from taichi_disk.mechanics.integrators import LARGEST_FACTORISED, Integrator
from taichi_disk.mechanics.integrators.conjugate_gradients import (
    Diagonal,
    IterativeSolver,
    diagonal,
)
from taichi_disk.mechanics.integrators.trapezoidal import (
    DashpotSolver,
    Factor,
    factorise,
)
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics import Model
from taichi_disk.mechanics.physics.law import Capacity
from taichi_disk.mechanics.physics.ordering import BLOCK, Arrangement, arrange
from taichi_disk.mechanics.simulation.kernels import Kernels, SubdomainKernels
from taichi_disk.mechanics.simulation.observables import INDEX, bounds_array
from taichi_disk.mechanics.simulation.stepping import (
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


class Program:
    """Compiled kernels and their fields, for all lattices with laws of the same kinds.

    Attributes:
        occupant: the simulation whose state is in the fields. Another one takes its
            place whenever it moves; each goes on bitwise as if it were alone.
        subdomains: number of subdomains of a lattice, 1 unless it is large.
    """

    def __init__(self, first: Simulation) -> None:
        model = first.model
        self.integrator = first.integrator
        self.model = deepcopy(model)
        self.model.springs.prepare_for(first.lattice)
        self.subdomains = first.arrangement.subdomains
        self.occupant: Simulation | None = None
        self._engine = engine.program()
        self._capacity = Capacity(*map(_doubled, first.needed, MIN_CAPACITY))
        # The user's own laws make fields, too, and may fail.
        with field_builder(ti) as builder:
            self._make_fields(builder, first.factor)
            owner.make_fields(builder)
            self.switch_to(first)

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
            self.kernels = SubdomainKernels(builder, self.subdomains, *parts)
        else:
            self.kernels = Kernels(*parts)

    def fits(self, simulation: Simulation) -> bool:
        """Whether the fields still exist (a `ti.init` or `ti.reset` by the user deletes
        them) and have room for a simulation."""
        room = zip(simulation.needed, self._capacity, strict=True)
        return self.is_alive and all(count <= most for count, most in room)

    @property
    def is_alive(self) -> bool:
        return engine.program() is self._engine

    def switch_to(self, simulation: Simulation) -> None:
        """Write the state of `simulation` into the fields, and save that of the
        occupant."""
        self.vacate()
        for law, new in zip(self.model.laws, simulation.model.laws, strict=True):
            law.take_values(new)
        saved = simulation.saved
        if saved is None:
            simulation.contents = self._begin(simulation)
        else:
            owner.call(self.state.write, *simulation.contents)
            if simulation.mouse_target:
                owner.call(self.kernels.set_mouse_target, *simulation.mouse_target)
            # the saved state contains the pull
            owner.call(self.state.restore, saved)
        self.occupant = simulation

    def vacate(self) -> None:
        """Save the state of the occupant, which loses the fields."""
        if self.occupant:
            self.occupant.saved = self.occupant.snapshot()
        self.occupant = None

    def _begin(self, simulation: Simulation) -> Written:
        """Write the state at t = 0."""
        lattice = simulation.lattice
        arrangement = simulation.arrangement
        dt = simulation.dt
        v = simulation.start_velocities
        state = self.state
        numbers: list[tuple[Any, float]] = [
            (state.h, dt),
            (state.closing, self.integrator.kicks[-1] * dt),
            (state.observed, self.integrator.observed_kick * dt),
            (state.contact, _contact_force(lattice, simulation.model, v)),
            (state.n, len(lattice.positions)),
            (state.n_disk, lattice.disk_points),
            (state.triangles, len(lattice.triangles)),
            (state.blocks, len(arrangement.ends) // BLOCK),
            (state.subdomain_points, arrangement.subdomain_points),
            (state.reset_steps, max(1, round(simulation.model.reset_interval / dt))),
        ]
        contents = state.contents(lattice, arrangement, self._vectors(simulation))
        for law in self.model.laws:
            numbers += law.numbers()
            contents += law.contents(lattice, arrangement)
        if self.kernels.solver is not None:
            contents += self.kernels.solver.contents(simulation.factor)
        return owner.call(state.begin, numbers, contents)

    def _vectors(self, simulation: Simulation) -> list[Array]:
        """Return the vectors (n, 2) of the state at t = 0, as `Snapshot` lists them."""
        lattice = simulation.lattice
        v = simulation.start_velocities
        dt = simulation.dt
        x = lattice.positions
        zero = np.zeros_like(x)
        if not self.state.corrected:
            return [x, v, zero, v][: len(self.state.vectors)]

        def acceleration(t: float) -> Array:
            forces = simulation.model.forces_moving(lattice, x + t * v, zero)
            return forces / lattice.masses[:, None]

        c = self.integrator.correction * dt**2
        a = acceleration(0.0)
        change = acceleration(DIFFERENCE_TIME) - acceleration(-DIFFERENCE_TIME)
        v_corrected = v + 0.5 * c / DIFFERENCE_TIME * change
        observed = v - self.integrator.observed_kick * dt * a
        return [x, v_corrected, zero, observed, x - c * a]


class Simulation:
    """Moves one lattice by a model's laws, from `velocities` (n, 2) [c] at t = 0, in
    steps of `dt` [R/c].

    Attributes:
        step_number: number of steps made since t = 0.
        first_row, now: (columns,) observables at t = 0, and after the last step.
        program: has this simulation in its fields, or had it last.
        saved: the state, if the program has another simulation in its fields.
        contents: what was last written into the fields.
        mouse_target: point that the mouse pulls, and where to [R].
        cache: makes programs; by default a cache of its own.
    """

    def __init__(
        self,
        lattice: Lattice,
        model: Model,
        integrator: Integrator,
        velocities: Array,
        dt: float,
        cache: KernelCache | None = None,
    ) -> None:
        self.lattice = lattice
        self.model = model
        self.integrator = integrator
        self.start_velocities = velocities
        self.dt = dt
        self.step_number = -1  # its end is t = 0
        self.saved: Snapshot | None = None
        self.contents: Any = None
        self.mouse_target: tuple[int, float, float] | None = None
        self.cache = cache or KernelCache()
        self.arrangement = self.cache.arrangement(lattice)
        self.factor = self._factor()
        self.program = self.cache.program(self)
        self.advance(steps=1)
        self.first_row = self.now

    def _factor(self) -> Dashpots:
        model = self.model
        if not (model.springs.damped and self.integrator.dashpots == "implicit"):
            return None
        if len(self.lattice.positions) > LARGEST_FACTORISED:
            return diagonal(self.lattice, model, self.dt)
        return factorise(self.lattice, model, self.dt)

    @property
    def needed(self) -> Capacity:
        entries = 0
        if isinstance(self.factor, Factor):
            entries = len(self.factor.row)
        blocks = len(self.arrangement.ends) // BLOCK
        return Capacity(len(self.lattice.positions), blocks, entries)

    def _in_fields(self) -> Program:
        """Return the program, after a switch to this simulation if necessary."""
        if self.program.occupant is not self:
            self.program = self.cache.program(self)
        elif not self.program.is_alive:
            raise TaichiDiskError(
                "a later ti.init or ti.reset has deleted the fields of this simulation:"
                " make another"
            )
        return self.program

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
        kernels = self._in_fields().kernels
        steps_since_row = self.step_number % stride
        max_rows = (steps_since_row + steps) // stride + 1
        rows = np.zeros((max_rows, len(INDEX)))
        if bounds is None:
            bounds = bounds_array({})
        counts = np.array([needed, settled, 0, 0], np.int32)
        limits = rows, bounds, counts
        owner.call(kernels.advance, self.step_number, steps, stride, *limits)
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
        return owner.call(self._in_fields().state.export, n, self.step_number)

    def restore(self, snapshot: Snapshot) -> None:
        owner.call(self._in_fields().state.restore, snapshot)
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
        pull = self._in_fields().kernels.set_mouse_target
        self.mouse_target = (point, *target)
        return owner.call(pull, *self.mouse_target)


class KernelCache:
    """Reuses compiled programs, because a compilation takes seconds.

    `compile_seconds`: wall-clock time that simulations have taken until t = 0 [s].
    """

    def __init__(self) -> None:
        self.compile_seconds = 0.0
        self._known: dict[Any, Program] = {}
        self._last: tuple[Any, Any] = None, None

    def simulation(
        self,
        lattice: Lattice,
        model: Model,
        integrator: Integrator,
        velocities: Array,
        dt: float,
    ) -> Simulation:
        began = perf_counter()
        made = Simulation(lattice, model, integrator, velocities, dt, self)
        self.compile_seconds += perf_counter() - began
        return made

    def arrangement(self, lattice: Lattice) -> Arrangement:
        """Return the arrangement of a lattice; it is computed again only for other
        springs than last time."""
        bonds, known = self._last
        if bonds is not lattice.bonds:
            known = arrange(lattice.bonds, len(lattice.positions))
            self._last = lattice.bonds, known
        return known

    def program(self, simulation: Simulation) -> Program:
        """Return a program with `simulation` in its fields, compiled only if
        necessary."""
        key = (
            simulation.model.signature(),
            simulation.integrator.name,
            type(simulation.factor),
            simulation.lattice.stiffness is None,
            simulation.arrangement.subdomains,
        )
        known = self._known.get(key)
        if known is not None and known.fits(simulation):
            known.switch_to(simulation)
            return known
        raise_if_interrupted()
        if known is not None and known.is_alive:
            # Its fields stay: Taichi 1.7.4 cannot delete those that one of its threads
            # does not know. Each new program has twice the room.
            known.vacate()
        known = self._known[key] = Program(simulation)
        return known


@lru_cache(maxsize=1)
def _kernels_of(program: Any) -> KernelCache:
    return KernelCache()


def shared_kernels() -> KernelCache:
    """Return the cache of compiled simulations. A process has one, because it has one
    Taichi."""
    return _kernels_of(engine.program())


def _contact_force(lattice: Lattice, model: Model, v: Array) -> float:
    """Return the force of the wall on one point [M c^2/R] above which the disk is in
    contact; inf without a wall."""
    if model.wall is None:
        return inf
    speed = lattice.mean(v[:, 1])  # towards the wall
    kinetic_energy = 0.5 * speed**2
    # where the wall's potential energy is U, its force is a U
    a = model.wall.added_stiffness(1.0)
    return CONTACT_ENERGY * kinetic_energy * a


def _doubled(needed: int, least: int) -> int:
    while least < needed:
        least *= 2
    return least
