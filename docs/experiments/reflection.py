"""Reflection of plane waves at normal incidence by the matched dashpots of the elastic
wall (wall.boundary: dashpot).

    python docs/experiments/reflection.py        (two minutes)

A slab of the wall's lattice is stepped by the same kernels. A velocity pulse
exp(-y^2/(2 sigma^2)) at its free top travels as a plane wave to the dashpots at the
bottom. The sides do not disturb a plane wave: very strong dashpots hold the component
that the wave does not move (x for a P wave, y for an S wave), and the other component
is free. Impacts emit longer waves, which last as long as the contact, some 4 R/c.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_disk.base import runtime

runtime.start()

from taichi_disk.experiments.computation.stability import spectrum, step_limit  # noqa: E402
from taichi_disk.mechanics.integrators import VELOCITY_VERLET  # noqa: E402
from taichi_disk.mechanics.lattice import Lattice, Moduli, bulk_moduli, with_wall  # noqa: E402
from taichi_disk.mechanics.physics import (  # noqa: E402
    ElasticWall,
    MatchedBoundary,
    Model,
    Springs,
    matched_impedance,
)
from taichi_disk.mechanics.simulation.observables import INDEX  # noqa: E402
from taichi_disk.mechanics.simulation.simulation import Simulation  # noqa: E402

WIDTH = 2.0  # width of the slab [R]
RIGID = 1e6  # dashpots that hold a point fast [M c/R]
SPEED = 1e-6  # speed of the pulse [c], small enough for linear waves
LATTICES = 4


def reflect(
    wave: str, sigma: float, seed: int, points: int = 1099, impedance: float = 1.0
) -> tuple[float, float]:
    """Return the energy, and the amplitude of the plane pulse, that come back after
    half the way up again.

    Args:
        wave: "p" or "s"; sigma: [R], a tenth of the slab's depth.
        points: of the disk whose material the slab is made of.
        impedance: the bottom's dashpots over matched ones. Theory: the amplitude is (1
            - impedance)/(1 + impedance).

    The energy is everything that is left in the slab, including waves scattered by the
    random lattice, over the energy sent.
    """
    moduli, depth = bulk_moduli(points, seed, 1.0, 0.7), 10.0 * sigma
    lattice = with_wall(
        Lattice.disk(points, seed), round(points * WIDTH * depth / np.pi), WIDTH, seed
    )
    lattice.positions[:points, 1] += 10.0  # the disk hangs far above, at rest
    along = 1 if wave == "p" else 0  # the component that the wave moves
    boundary = MatchedBoundary(dashpots(lattice, moduli, along, impedance))
    model = Model(Springs(), ElasticWall(300.0, 150.0, 0.1), boundary=boundary)
    y = lattice.positions[points:, 1]
    velocities = np.zeros_like(lattice.positions)
    velocities[points:, along] = SPEED * np.exp(-0.5 * (y / sigma) ** 2)
    dt = 0.5 * step_limit(spectrum(lattice, model), model, VELOCITY_VERLET, 0.0)
    simulation = Simulation(lattice, model, VELOCITY_VERLET, velocities, dt)
    steps = round(
        1.5 * depth / (moduli.wave_speed_p if wave == "p" else moduli.wave_speed_s) / dt
    )
    simulation.advance(steps, steps)
    left = simulation.now[INDEX["kinetic"]] + simulation.now[INDEX["elastic"]]
    sent = 0.5 * float((lattice.masses[:, None] * velocities**2).sum())
    returned = np.exp(-0.5 * ((y + 0.5 * depth) / sigma) ** 2)
    after = simulation.velocities()[points:, along]
    # At a free end the pulse and its mirror image form a full pulse, one half of which
    # travels down.
    return float(left) / sent, float(after @ returned) / (
        0.5 * SPEED * float(returned @ returned)
    )


def dashpots(
    lattice: Lattice, moduli: Moduli, along: int, impedance: float
) -> NDArray[np.float64]:
    """Return the dashpot constants (k, 2) [M c/R]: those of the scene at the bottom,
    and guiding ones at the sides."""
    z = matched_impedance(
        lattice,
        moduli.density * moduli.wave_speed_p,
        moduli.density * moduli.wave_speed_s,
    )
    chain = lattice.positions[lattice.wall_boundary]
    side = np.abs(chain[:, 0]) >= 0.5 * WIDTH - 1e-9
    bottom = np.flatnonzero(chain[:, 1] <= chain[:, 1].min() + 1e-9)
    # the length of a corner includes half a spring of the side
    z[bottom[[0, -1]], along] = 0.5 * z[bottom[1], along]
    z[bottom] *= impedance
    z[side, 1 - along] = RIGID
    z[np.setdiff1d(np.flatnonzero(side), bottom), along] = 0.0
    return z


if __name__ == "__main__":
    print(
        "wave  sigma [R]  energy   amplitude (mean and standard deviation of 4"
        " lattices)"
    )
    for wave in ("p", "s"):
        for sigma in (0.2, 0.35, 0.7):
            energy, amplitude = np.array(
                [reflect(wave, sigma, seed) for seed in range(LATTICES)]
            ).T
            back = f"{amplitude.mean():+.2%} ± {amplitude.std(ddof=1):.2%}"
            print(f"{wave.upper():4}  {sigma:<9g}  {energy.mean():.2%}    {back}")
