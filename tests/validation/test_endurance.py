"""Check the stability limit and the conservation of energy by stepping small disks for
very long.

The disk has 60 points; its modes are like those of any lattice, and 10^6 steps take a
second.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from taichi_disk.computation.stability import contact_point_force, spectrum, step_limit
from taichi_disk.integrators import (
    TAKAHASHI_IMADA,
    TRAPEZOIDAL,
    VELOCITY_VERLET,
    Integrator,
)
from taichi_disk.lattice import Lattice
from taichi_disk.physics import ExponentialWall, Load, Model, Springs
from taichi_disk.simulation.observables import ENERGY_INDICES, INDEX
from taichi_disk.simulation.simulation import KernelCache, Simulation
from taichi_disk.statics.equilibrium import place_on_wall, solve_equilibrium

pytestmark = pytest.mark.validate

POINTS = 60
WALL = ExponentialWall(300.0, 150.0)
LOAD = 0.01  # load P of a disk that rests on the wall, in units of k_a R
MECHANICAL = [INDEX[name] for name in ("kinetic", "elastic", "wall", "load")]
ROWS = 2000  # samples of the energy in a long run
# Energy over its initial value. At h omega = 1.96 leapfrog's energy oscillates by a
# factor 1/(1 - 0.98^2) = 25. Implicit dashpots turn random velocities, which strong
# dashpots would stop at once, into a slowly decaying alternation.
BOUNDED = 1e3
LOST = 1e6
# steps at 0.98 and 1.05 of the limit; strong implicit dashpots blow up slowly
BELOW = 100_000
ABOVE = 200_000


def growth(simulation: Simulation, steps: int) -> float:
    """Return the largest energy in the second half of `steps` steps over its initial
    value; inf beyond LOST.

    The first half is a transient. (Kinetic energy alone does not suffice: a mode that
    changes its sign at every step has none at the steps.)
    """
    first = simulation.first_row[INDEX["kinetic"]]
    potential = simulation.first_row[MECHANICAL].sum() - first
    with np.errstate(over="ignore", invalid="ignore"):
        energy = (
            simulation.advance(steps, 20)[0][:, MECHANICAL].sum(axis=1) - potential
        ) / first
    return float(energy[len(energy) // 2 :].max()) if (energy < LOST).all() else np.inf


@pytest.mark.parametrize("pressed", [False, True], ids=["free", "pressed on the wall"])
@pytest.mark.parametrize(
    ("integrator", "eta_star"),
    [
        (VELOCITY_VERLET, 0.0),
        (TAKAHASHI_IMADA, 0.0),
        (VELOCITY_VERLET, 100.0),
        (TRAPEZOIDAL, 100.0),
    ],
)
def test_steps_below_the_limit_stay_bounded_and_above_blow_up(
    integrator: Integrator, eta_star: float, pressed: bool, kernels: KernelCache
) -> None:
    for k_a in (1e-3, 1.0, 1e3):
        lattice = Lattice.disk(POINTS, 0)
        springs = Springs(k_a, 0.0, eta_star / POINTS)
        point_force = 0.0
        model = Model(springs)
        if pressed:
            model = Model(springs, WALL, Load(LOAD * k_a))
            start = place_on_wall(lattice, 0.0, WALL, LOAD * k_a).positions
            lattice = replace(
                lattice, positions=solve_equilibrium(lattice, model, start).positions
            )
            point_force = float(WALL.forces(lattice, lattice.positions).max())
        limit = step_limit(spectrum(lattice, model), model, integrator, point_force)
        # The disk is so slow that forces stay linear; the limits refer to linear
        # frequencies.
        v = 1e-6 * np.sqrt(k_a) * np.random.default_rng(0).standard_normal((POINTS, 2))
        assert (
            growth(
                kernels.simulation(lattice, model, integrator, v, 0.98 * limit), BELOW
            )
            < BOUNDED
        )
        if not pressed:  # the limit of a pressed disk is on the safe side
            assert (
                growth(
                    kernels.simulation(lattice, model, integrator, v, 1.05 * limit),
                    ABOVE,
                )
                == np.inf
            )


class Wander(NamedTuple):
    """How the energy changed in a run, relative to the energy above rest."""

    swing: float  # largest deviation from the mean
    slope: float  # change of a straight line through the energy, over the whole run
    slope_error: float  # standard error of the slope, from the means of 20 sections


def wander(
    kernels: KernelCache,
    integrator: Integrator,
    bouncing: bool,
    fraction: float,
    steps: int,
    seed: int = 0,
) -> Wander:
    """Return how the energy changes in `steps` steps of `fraction` of the limit,
    without dashpots.

    A free disk vibrates at strains of some per cent, or a disk bounces on the rigid
    wall, where energy moves between flight and vibration all the time.
    """
    disk = Lattice.disk(POINTS, 0)
    model = Model(Springs(1.0, 1e-3))
    force = 0.0
    v = 0.003 * np.random.default_rng(seed).standard_normal((POINTS, 2))
    v -= v.mean(axis=0)
    rest = disk.positions
    if bouncing:
        model = Model(Springs(1.0, 1e-3), WALL, Load(LOAD))
        disk = replace(
            disk, positions=disk.positions + [0.0, 0.06 - disk.positions[:, 1].min()]
        )
        rest = solve_equilibrium(
            disk, model, place_on_wall(disk, 0.0, WALL, LOAD).positions
        ).positions
        force = contact_point_force(disk, model, 4.0 * LOAD)
    dt = fraction * step_limit(spectrum(disk, model), model, integrator, force)
    simulation = kernels.simulation(disk, model, integrator, v, dt)
    scale = simulation.first_row[ENERGY_INDICES].sum() - model.energy(disk, rest)
    energy = (
        simulation.advance(steps, steps // ROWS)[0][:, ENERGY_INDICES].sum(axis=1)
        / scale
    )
    relative = energy - energy.mean()
    from scipy.stats import linregress  # takes a second to import

    fit = linregress(
        np.linspace(0.025, 0.975, 20), relative.reshape(20, -1).mean(axis=1)
    )
    return Wander(float(np.abs(relative).max()), float(fit.slope), float(fit.stderr))


def test_the_energy_of_a_free_disk_does_not_drift_in_a_million_steps(
    kernels: KernelCache,
) -> None:
    for integrator, fraction in (
        (VELOCITY_VERLET, 0.8),
        (VELOCITY_VERLET, 0.4),
        (TAKAHASHI_IMADA, 0.8),
    ):
        found = wander(kernels, integrator, False, fraction, 1_000_000)
        # Leapfrog's energy oscillates by up to (h omega/2)^2 in the fastest mode, but
        # far less in the mean over all modes.
        assert found.swing < (0.25 if fraction > 0.5 else 0.02)
        # Beyond order h^2 corrected forces have no potential; they take 2.4e-3 of the
        # energy in these million steps.
        drift = 5e-3 if integrator.correction else 0.0
        assert abs(found.slope) < drift + 4.0 * found.slope_error < drift + 8e-3


@pytest.mark.parametrize(
    ("points", "fraction", "strain"),
    [(60, 0.8, 1e-3), (60, 0.8, 4e-3), (60, 0.95, 1e-3), (200, 0.8, 2e-3)],
)
def test_corrected_forces_change_the_energy_of_white_noise_by_some_per_cent(
    points: int, fraction: float, strain: float, kernels: KernelCache
) -> None:
    # Velocities are independent from point to point, so that the fastest modes have
    # their share. Measured: -0.8 to +2.7 % in a million steps.
    lattice = Lattice.disk(points, 0)
    model = Model(Springs())
    limits = spectrum(lattice, model)
    limit = step_limit(limits, model, TAKAHASHI_IMADA, 0.0)
    velocities = np.random.default_rng(1).standard_normal((points, 2))
    velocities -= velocities.mean(axis=0)
    velocities *= 0.5 * strain * np.median(lattice.rest_lengths) * limits.omega
    simulation = kernels.simulation(
        lattice, model, TAKAHASHI_IMADA, velocities, fraction * limit
    )
    rows, _ = simulation.advance(1_000_000, 1000)
    energy = rows[:, MECHANICAL].sum(axis=1)
    change = energy[-100:].mean() / energy[:100].mean() - 1.0
    assert 1e-4 < abs(change) < 0.05


def test_the_energy_of_a_bouncing_disk_wanders_as_the_square_of_the_step(
    kernels: KernelCache,
) -> None:
    # Some 2,500 bounces, each with the error of an impact. The motion is chaotic, so
    # another step gives another path, and only the median over several starts shows the
    # order.
    orders = []
    for seed in range(5):
        coarse = wander(kernels, VELOCITY_VERLET, True, 0.4, 1_000_000, seed)
        fine = wander(kernels, VELOCITY_VERLET, True, 0.2, 2_000_000, seed)
        assert max(abs(coarse.slope), abs(fine.slope)) < 0.02
        orders.append(np.log2(coarse.swing / fine.swing))
    assert np.median(orders) == pytest.approx(2.0, abs=0.5)
