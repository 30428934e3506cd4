"""One lattice (in one or more replicas) in Taichi fields, and the kernels that move it.

How a step is made is in `integrators`. Between steps a world holds x_k, f_k and the velocity before its last kick,
v_k - closing f_k (in leapfrog: v_{k-1/2}). All steps between two looks run inside one kernel.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.model import runtime
from taichi_disk.model.chebyshev import Iteration, iteration, largest_rate, solver_for
from taichi_disk.model.chunks import STAGES, Chunks
from taichi_disk.model.factor import Factor, factorise
from taichi_disk.model.integrators import SPLITTINGS
from taichi_disk.model.integrators.sweeps import Sweeps
from taichi_disk.model.integrators.trapezoidal import ImplicitDashpot
from taichi_disk.model.observables import COLUMNS, Observables
from taichi_disk.model.ordering import Arrangement, arrange
from taichi_disk.model.parameters import Sizes, parameters
from taichi_disk.model.physics import Physics
from taichi_disk.model.runtime import precision
from taichi_disk.model.springs import Springs
from taichi_disk.model.state import make_fields, room_for
from taichi_disk.model.stepping import Stepping
from taichi_disk.model.storage import State, Storage
from taichi_disk.model.sums import SHIFT, SPEED, SUMS
from taichi_disk.model.vectors import parts_of
from taichi_disk.model.walls import Walls


def features(physics: Physics) -> tuple[Any, ...]:
    """All of the physics that kernels are compiled for. (Of the lattice it is only the room that it takes.)"""
    present = (physics.cubic, physics.dissipates, physics.load != 0.0, physics.pulled)
    return (physics.wall, physics.boundary, physics.integrator, *present)


@ti.data_oriented
class World(Stepping, Chunks, Springs, Walls, ImplicitDashpot, Sweeps, Observables, Storage):
    """`lanes` replicas of one lattice, each with its own initial velocities, dashpot constant and load.

    Args:
        lattice: points and springs, already in scene coordinates.
        physics: what acts on them; decides which fields exist and which branches are compiled.
        velocities: (lanes, n, 2) at t = 0 [c].
        dt: time step [R/c].
        eta, load: per lane; by default those of `physics`. Raises ValueError where lanes that share an
            implicit dashpot differ in eta.
        positions: (lanes, n, 2) at t = 0 [R]; by default the lattice's own in every lane.
    """

    def __init__(
        self,
        lattice: Lattice,
        physics: Physics,
        velocities: NDArray[np.float64],
        dt: float,
        eta: Sequence[float] | None = None,
        load: Sequence[float] | None = None,
        positions: NDArray[np.float64] | None = None,
    ) -> None:
        self.lanes = len(velocities)
        self.single = precision() == "f32"
        self.real = ti.f32 if self.single else ti.f64
        self.compiled: set[str] = set()
        self.splitting = SPLITTINGS[physics.integrator]
        self.steps_per_launch = max(1, STAGES // self.splitting.forces)
        self.components = 2 if physics.boundary == "dashpot" else 1
        springs = arrange(lattice.bonds, len(lattice.positions), self.lanes)
        self.block, self.chunks = springs.block, springs.chunks
        self.physics = physics
        etas = np.full(self.lanes, physics.eta) if eta is None else np.asarray(eta, float)
        solver = _solver(lattice, physics, dt, etas)
        self.sweeps, self.most_neighbours = _sweeps_of(solver)
        self._room = room_for(len(lattice.positions), springs, _factor_of(solver), self.lanes)
        self.fields, self._tree = make_fields(
            physics, springs, self._room, self.lanes, self.sweeps, self.most_neighbours, self.real
        )
        for name, field in self.fields.items():
            setattr(self, name, parts_of(field))
        self._start(lattice, physics, dt, springs, solver, velocities, etas, load, positions)

    def restart(
        self,
        lattice: Lattice,
        physics: Physics,
        velocities: NDArray[np.float64],
        dt: float,
        eta: Sequence[float] | None = None,
        load: Sequence[float] | None = None,
        positions: NDArray[np.float64] | None = None,
    ) -> bool:
        """Become the world that these arguments would make, without compiling anew.

        False, with nothing changed, where that cannot be: more points, springs or entries of the factor than there is
        room for, another number of lanes, or another set of features.
        """
        if len(velocities) != self.lanes or features(physics) != features(self.physics):
            return False
        springs = self._springs
        if lattice.bonds is not self.lattice.bonds:
            springs = arrange(lattice.bonds, len(lattice.positions), self.lanes)
            if springs.chunks != self.chunks:
                return False
        etas = np.full(self.lanes, physics.eta) if eta is None else np.asarray(eta, float)
        solver = _solver(lattice, physics, dt, etas)
        if _sweeps_of(solver) != (self.sweeps, self.most_neighbours):
            return False
        if not self._room.holds(len(lattice.positions), springs, _factor_of(solver)):
            return False
        self._start(lattice, physics, dt, springs, solver, velocities, etas, load, positions)
        return True

    def _start(
        self,
        lattice: Lattice,
        physics: Physics,
        dt: float,
        springs: Arrangement,
        solver: Factor | Iteration | None,
        velocities: NDArray[np.float64],
        eta: NDArray[np.float64],
        load: Sequence[float] | None,
        positions: NDArray[np.float64] | None,
    ) -> None:
        n, n_boundary = len(lattice.positions), len(lattice.wall_boundary) if physics.boundary != "none" else 0
        if velocities.shape != (self.lanes, n, 2):
            raise ValueError(f"velocities have shape {velocities.shape}, not (lanes, {n}, 2)")
        self.lattice, self.physics, self.dt, self.mass = lattice, physics, dt, float(lattice.masses[0])
        self._springs, self.step_number = springs, 0
        sizes = Sizes(
            n=n,
            n_disk=lattice.disk_points,
            n_disk_surface=len(lattice.disk_surface),
            n_wall_surface=len(lattice.wall_surface),
            n_boundary=n_boundary,
            n_free=n - n_boundary if physics.boundary == "pinned" else n,
            blocks=springs.blocks,
            chunk_points=springs.chunk_points,
        )
        self._fill(solver, eta, np.full(self.lanes, self.physics.load) if load is None else np.asarray(load, float))
        self._parameters = parameters(self.physics, self.mass, self.dt, sizes)
        if self.physics.pulled:
            self._take_hold(self._parameters, -1, 0.0, 0.0, 0.0, 0.0)
        vectors, sums = self._no_vectors(), np.zeros((SUMS, self.lanes))
        vectors[0] = self.lattice.positions[:, :, None] if positions is None else np.moveaxis(positions, 0, 2)
        vectors[1] = np.moveaxis(velocities, 0, 2)
        if self.single:
            vectors[0] -= self.lattice.positions[:, :, None]
            for k, row in ((0, SHIFT), (1, SPEED)):
                sums[row] = vectors[k, 0, 1]  # a frame that moves with one point serves as well as any
                vectors[k, : lattice.disk_points, 1] -= sums[row]
        self._copy_state(vectors, sums, True)
        rows = np.zeros((1, len(COLUMNS), self.lanes))
        with runtime.whole_vectors():
            self._initialise(self._parameters, rows)
        self.first_row: NDArray[np.float64] = rows[0]

    def uses(self, feature: str) -> bool:
        """Whether the physics has `feature`; noted, so that one can see what the kernels were compiled with."""
        physics = self.physics
        used = {
            "cubic": physics.cubic,
            "explicit dashpot": physics.explicit_dashpot,
            "implicit dashpot": physics.implicit_dashpot,
            "rigid wall": physics.wall == "rigid",
            "elastic wall": physics.wall == "elastic",
            "load": physics.load != 0.0,
            "pull of a hand": physics.pulled,
            "reset boundary": physics.boundary == "reset",
            "pinned boundary": physics.boundary == "pinned",
            "dashpot boundary": physics.boundary == "dashpot",
        }[feature]
        if used:
            self.compiled.add(feature)
        return used

    def _fill(self, solver: Factor | Iteration | None, eta: NDArray[np.float64], load: NDArray[np.float64]) -> None:
        springs, lattice = self._springs, self.lattice
        filler = springs.source < 0
        rest = np.where(filler, 1.0, lattice.rest_lengths[springs.source])
        self._fill_springs(len(lattice.positions), springs.ends, rest)
        if self.chunks > 1:
            self._fill_chunks(springs.chunk_ends)
        if self.single:
            span = (
                lattice.positions[lattice.bonds[springs.source, 0]]
                - lattice.positions[lattice.bonds[springs.source, 1]]
            )
            span[filler] = 1.0, 0.0
            if np.abs(np.hypot(*span.T) - rest).max() > 1e-9:
                raise ValueError("single precision needs a lattice whose springs have their rest lengths at the start")
            self._fill_base(lattice.positions, span)
        if self.physics.dissipates or self.physics.load != 0.0:
            self._fill_lanes(eta, load)
        if self.physics.wall == "elastic":
            self._fill_surfaces(self.lattice.disk_surface, self.lattice.wall_surface)
        if self.physics.boundary != "none":
            self._fill_boundary(self.lattice.wall_boundary, self.physics.impedance)
        if isinstance(solver, Factor):
            self._fill_factor(solver.order, solver.column, solver.row, solver.values, solver.inverse_diagonal)
        elif isinstance(solver, Iteration):
            self._fill_sweeps(solver.neighbours, solver.numbers, solver.outer)

    def advance(self, samples: int, stride: int = 1) -> NDArray[np.float64]:
        """Make `samples` times `stride` steps; returns the observables (samples, len(COLUMNS), lanes).

        None at all (`samples` 0) compiles the step.
        """
        rows = np.zeros((samples, len(COLUMNS), self.lanes))
        with runtime.whole_vectors():
            if self.chunks > 1:
                if samples == 0:
                    self._advance_chunks(self._parameters, self.step_number, 0)
                for s in range(samples):
                    for k in range(0, stride, self.steps_per_launch):
                        steps = min(stride - k, self.steps_per_launch)
                        self._advance_chunks(self._parameters, self.step_number + s * stride + k, steps)
                    self._look(self._parameters, s, rows)
            else:
                self._advance(self._parameters, self.step_number, samples, stride, rows)
        self.step_number += samples * stride
        return rows

    @property
    def time(self) -> float:
        return self.step_number * self.dt

    def _no_vectors(self) -> NDArray[np.float64]:
        return np.zeros((4 if self.physics.implicit_dashpot else 3, len(self.lattice.positions), 2, self.lanes))

    def export_state(self) -> State:
        vectors = self._no_vectors()
        sums = np.zeros((SUMS, self.lanes))
        self._copy_state(vectors, sums, False)
        return State(self.step_number, vectors, sums)

    def import_state(self, state: State) -> None:
        self._copy_state(state.vectors, state.sums, True)
        self.step_number = state.step

    def positions(self) -> NDArray[np.float64]:
        """(lanes, n, 2) now [R]."""
        return self.places(self.export_state())

    def velocities(self) -> NDArray[np.float64]:
        """(lanes, n, 2) now [c]."""
        state = self.export_state()
        v, f = state.vectors[1:3]
        v = v + self.splitting.kicks[-1] * self.dt / self.mass * f
        v[: self.lattice.disk_points, 1] += state.sums[SPEED]
        return np.moveaxis(v, 2, 0).copy()

    def places(self, state: State) -> NDArray[np.float64]:
        """(lanes, n, 2) positions in a state of this world [R]."""
        x = state.vectors[0].copy()
        if self.single:
            x += self.lattice.positions[:, :, None]
            x[: self.lattice.disk_points, 1] += state.sums[SHIFT]
        return np.moveaxis(x, 2, 0).copy()

    def forces(self) -> NDArray[np.float64]:
        """(lanes, n, 2) total force on every point now [M c^2/R]."""
        return np.moveaxis(self.export_state().vectors[2], 2, 0).copy()

    def take_hold(self, point: int, target: tuple[float, float], stiffness: float, strongest: float) -> float:
        """Pull `point` (-1: none any more) towards `target` [R] from now on, in every lane.

        With the force stiffness [M c^2/R^2] times the distance, but `strongest` [M c^2/R] at most. The pull has a
        potential, which the observable `load` includes; returns by how much that has jumped [M c^2]. Needs
        `Physics.pulled`.
        """
        return float(self._take_hold(self._parameters, point, *target, stiffness, strongest))

    def destroy(self) -> None:
        """Give the fields' memory back; the world cannot be used afterwards."""
        self._tree.destroy()


def _solver(lattice: Lattice, physics: Physics, dt: float, eta: NDArray[np.float64]) -> Factor | Iteration | None:
    """For the matrix that the implicit dashpots of this physics have, if it has them."""
    if not physics.implicit_dashpot:
        return None
    if np.ptp(eta) > 0.0:
        raise ValueError("lanes that share an implicit dashpot must have the same eta")
    n = len(lattice.positions)
    free = np.arange(n, dtype=np.int32)
    if physics.boundary == "pinned":
        free = np.setdiff1d(free, lattice.wall_boundary)
    extra = np.zeros((n, 2 if physics.boundary == "dashpot" else 1))
    half = 0.5 * dt / float(lattice.masses[0])
    if physics.boundary == "dashpot":
        extra[lattice.wall_boundary] = half * physics.impedance
    coupling = half * float(eta[0])
    kappa = 1.0 + coupling * largest_rate(lattice.bonds, n) + float(extra.max())
    if solver_for(n, kappa)[0]:
        return iteration(lattice.bonds, coupling, kappa, free, extra)
    return factorise(lattice.bonds, coupling, free, extra)


def _sweeps_of(solver: Factor | Iteration | None) -> tuple[int, int]:
    """The number of sweeps, and of neighbours that they look at, that kernels are compiled for; 0 without sweeps."""
    return (len(solver.numbers) - 2, solver.neighbours.shape[1]) if isinstance(solver, Iteration) else (0, 0)


def _factor_of(solver: Factor | Iteration | None) -> Factor | None:
    return solver if isinstance(solver, Factor) else None
