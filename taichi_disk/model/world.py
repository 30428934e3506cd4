"""One lattice (in one or more replicas) in Taichi fields, and the kernels that move it.

Time step (leapfrog form of velocity Verlet, order 2; Hairer, Lubich & Wanner, Acta Numerica 2003):

    v_{k+1/2} = v_{k-1/2} + h f_k/m,    x_{k+1} = x_k + h v_{k+1/2},    v_k = v_{k-1/2} + h/2 f_k/m.

Forces that depend on velocity need v_k before it is known. `velocity_verlet` predicts it,
u_k = v_{k-1/2} + h/2 f_{k-1}/m (its error is O(h^2), so the order stays 2; see `stability` for the price);
`trapezoidal` solves for it (see `dashpots`). All steps between two looks run inside one kernel.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.model.dashpots import ImplicitDashpot
from taichi_disk.model.factor import Factor, factorise
from taichi_disk.model.observables import COLUMNS, Observables
from taichi_disk.model.ordering import spread
from taichi_disk.model.parameters import parameters
from taichi_disk.model.physics import Physics
from taichi_disk.model.springs import Springs
from taichi_disk.model.state import blocks_of, make_fields
from taichi_disk.model.stepping import Stepping
from taichi_disk.model.storage import State, Storage
from taichi_disk.model.sums import SUMS
from taichi_disk.model.walls import Walls


@ti.data_oriented
class World(Stepping, Springs, Walls, ImplicitDashpot, Observables, Storage):
    """`lanes` replicas of one lattice, each with its own initial velocities, dashpot constant and load.

    Args:
        lattice: points and springs, already in scene coordinates.
        physics: what acts on them; decides which fields exist and which branches are compiled.
        velocities: (lanes, n, 2) at t = 0 [c].
        dt: time step [R/c].
        eta, load: per lane; by default those of `physics`. Raises ValueError where lanes that share an
            implicit dashpot differ in eta.
    """

    def __init__(
        self,
        lattice: Lattice,
        physics: Physics,
        velocities: NDArray[np.float64],
        dt: float,
        eta: Sequence[float] | None = None,
        load: Sequence[float] | None = None,
    ) -> None:
        self.lattice, self.physics, self.dt = lattice, physics, dt
        self.lanes = len(velocities)
        self.n, self.n_disk, self.n_bonds = len(lattice.positions), lattice.disk_points, len(lattice.bonds)
        if velocities.shape != (self.lanes, self.n, 2):
            raise ValueError(f"velocities have shape {velocities.shape}, not (lanes, {self.n}, 2)")
        self.n_disk_surface, self.n_wall_surface = len(lattice.disk_surface), len(lattice.wall_surface)
        self.n_boundary = len(lattice.wall_boundary) if physics.boundary != "none" else 0
        self.reset_steps = max(1, round(physics.reset_interval / dt))
        self.block, self.blocks = blocks_of(lattice, self.lanes)
        self.mass = float(lattice.masses[0])
        self.compiled: set[str] = set()
        self.step_number = 0

        etas = np.full(self.lanes, physics.eta) if eta is None else np.asarray(eta, float)
        loads = np.full(self.lanes, physics.load) if load is None else np.asarray(load, float)
        factor = self._factor(etas) if physics.implicit_dashpot else None
        self.n_free = len(factor.order) if factor else 0
        self.components = factor.values.shape[1] if factor else 1
        entries = len(factor.row) if factor else 0
        self.fields, self._tree = make_fields(lattice, physics, self.lanes, self.n_free, entries)
        for name, field in self.fields.items():
            setattr(self, name, field)
        self._fill(factor, etas, loads)

        self._parameters = parameters(physics, self.mass, dt)
        vectors = np.zeros((3, self.n, 2, self.lanes))
        vectors[0] = lattice.positions[:, :, None]
        vectors[1] = np.moveaxis(velocities, 0, 2)
        self._copy_state(vectors, np.zeros((SUMS, self.lanes)), True)
        rows = np.zeros((1, len(COLUMNS), self.lanes))
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
            "reset boundary": physics.boundary == "reset",
            "pinned boundary": physics.boundary == "pinned",
            "dashpot boundary": physics.boundary == "dashpot",
        }[feature]
        if used:
            self.compiled.add(feature)
        return used

    def _factor(self, eta: NDArray[np.float64]) -> Factor:
        if np.ptp(eta) > 0.0:
            raise ValueError("lanes that share an implicit dashpot must have the same eta")
        free = np.arange(self.n, dtype=np.int32)
        if self.physics.boundary == "pinned":
            free = np.setdiff1d(free, self.lattice.wall_boundary)
        extra = np.zeros((self.n, 2 if self.physics.boundary == "dashpot" else 1))
        half = 0.5 * self.dt / self.mass
        if self.physics.boundary == "dashpot":
            extra[self.lattice.wall_boundary] = half * self.physics.impedance
        return factorise(self.lattice.bonds, half * float(eta[0]), free, extra)

    def _fill(self, factor: Factor | None, eta: NDArray[np.float64], load: NDArray[np.float64]) -> None:
        padded = self.block * self.blocks
        ends = np.full((padded, 2), [self.n, self.n + 1], dtype=np.int32)
        order = spread(self.lattice.bonds, self.n)
        ends[: self.n_bonds] = self.lattice.bonds[order]
        rest = np.ones(padded)
        rest[: self.n_bonds] = self.lattice.rest_lengths[order]
        self._fill_springs(ends, rest)
        if self.physics.dissipates or self.physics.load != 0.0:
            self._fill_lanes(eta, load)
        if self.physics.wall == "elastic":
            self._fill_surfaces(self.lattice.disk_surface, self.lattice.wall_surface)
        if self.n_boundary:
            self._fill_boundary(self.lattice.wall_boundary, self.physics.impedance)
        if factor:
            self._fill_factor(factor.order, factor.column, factor.row, factor.values, factor.inverse_diagonal)

    def advance(self, samples: int, stride: int = 1) -> NDArray[np.float64]:
        """Make `samples` times `stride` steps; returns the observables (samples, len(COLUMNS), lanes)."""
        rows = np.zeros((samples, len(COLUMNS), self.lanes))
        self._advance(self._parameters, self.step_number, samples, stride, rows)
        self.step_number += samples * stride
        return rows

    @property
    def time(self) -> float:
        return self.step_number * self.dt

    def export_state(self) -> State:
        vectors = np.zeros((3, self.n, 2, self.lanes))
        sums = np.zeros((SUMS, self.lanes))
        self._copy_state(vectors, sums, False)
        return State(self.step_number, vectors, sums)

    def import_state(self, state: State) -> None:
        self._copy_state(state.vectors, state.sums, True)
        self.step_number = state.step

    def positions(self) -> NDArray[np.float64]:
        """(lanes, n, 2) now [R]."""
        return np.moveaxis(self.export_state().vectors[0], 2, 0).copy()

    def velocities(self) -> NDArray[np.float64]:
        """(lanes, n, 2) now [c]."""
        _, v, f = self.export_state().vectors
        return np.moveaxis(v + 0.5 * self.dt / self.mass * f, 2, 0).copy()

    def forces(self) -> NDArray[np.float64]:
        """(lanes, n, 2) total force on every point now [M c^2/R]."""
        return np.moveaxis(self.export_state().vectors[2], 2, 0).copy()

    def destroy(self) -> None:
        """Give the fields' memory back; the world cannot be used afterwards."""
        self._tree.destroy()
