"""The energy balance: kinetic + elastic + wall + load + dissipated + absorbed + sliding
stays constant.

Leapfrog conserves a modified energy, E + h^2 E_2 + ..., so the imbalance during an
impact is proportional to h^2; after the impact, when the state is smooth again, it is
far smaller.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import SMALL, WALL, advance, bouncing, computed, driver_of
from numpy.testing import assert_allclose

from taichi_disk.integrators import TRAPEZOIDAL, VELOCITY_VERLET

N = 60
ENERGIES = ("kinetic", "elastic", "wall", "load", "dissipated", "absorbed", "sliding")
VV = VELOCITY_VERLET
LONG = pytest.mark.validate


def imbalance(columns):
    total = np.sum([columns[name] for name in ENERGIES], axis=0)
    return total - total[0]


@pytest.mark.parametrize(
    "scene",
    [
        ("exponential_wall", *SMALL, "material.eta_star=0"),
        ("exponential_wall", *SMALL, "material.eta_star=100"),
        ("absorbing_wall", *WALL),
        ("compression", *SMALL, "compression.tolerance=1e-3"),
        pytest.param(
            (
                "exponential_wall",
                *SMALL,
                "material.eta_star=100",
                "time.integrator=velocity_verlet",
            ),
            marks=LONG,
        ),
        pytest.param(
            (
                "exponential_wall",
                *SMALL,
                "material.eta_star=0",
                "time.integrator=takahashi_imada",
            ),
            marks=LONG,
        ),
        pytest.param(
            (
                "absorbing_wall",
                *WALL,
                "material.eta_star=10",
                "time.integrator=trapezoidal",
            ),
            marks=LONG,
        ),
        pytest.param(("absorbing_wall", *WALL, "wall.boundary=dashpot"), marks=LONG),
    ],
    ids=" ".join,
)
def test_energy_is_accounted_for_at_the_automatic_step(scene, kernels):
    _, outcome = computed(kernels, *scene, estimate=False)
    columns = outcome.series
    energy = outcome.summary["energy"]
    assert_allclose(
        columns["total"],
        np.sum([columns[name] for name in ENERGIES], axis=0),
        rtol=1e-13,
    )
    # of the load of a compression, where nothing moves at first
    work = 0.01 * np.ptp(columns["com_y"])
    scale = work if scene[0] == "compression" else columns["kinetic"][0]
    lost = imbalance(columns) / scale
    assert energy["closing_imbalance"] == pytest.approx(lost[-1], abs=1e-12)
    assert energy["worst_imbalance"] == pytest.approx(np.abs(lost).max(), abs=1e-12)
    assert abs(lost[-1]) < 2e-5
    assert np.abs(lost).max() < 1e-4
    # Losses only grow. (Centred sums may dip by their own error.)
    for name in ("dissipated", "absorbed"):
        assert np.diff(columns[name]).min() >= -1e-6 * scale


@pytest.mark.parametrize(
    ("scene", "eta_star", "integrator"),
    [
        ("rigid", 0.0, VV),
        ("rigid", 20.0, VV),
        ("rigid", 100.0, TRAPEZOIDAL),
        ("compression", 20.0, TRAPEZOIDAL),
        ("reset", 0.0, VV),
        pytest.param("matched", 0.0, VV, marks=LONG),
        pytest.param("matched", 100.0, TRAPEZOIDAL, marks=LONG),
        pytest.param("matched", 20.0, VV, marks=LONG),
        pytest.param("reset", 20.0, VV, marks=LONG),
        pytest.param("reset", 20.0, TRAPEZOIDAL, marks=LONG),
        pytest.param("axial reset", 20.0, VV, marks=LONG),
        pytest.param("non-uniform rigid", 20.0, VV, marks=LONG),
        ("non-uniform compression", 20.0, TRAPEZOIDAL),
        pytest.param("non-uniform matched", 100.0, TRAPEZOIDAL, marks=LONG),
        pytest.param("non-uniform reset", 20.0, VV, marks=LONG),
        pytest.param("non-uniform reset", 20.0, TRAPEZOIDAL, marks=LONG),
    ],
)
def test_the_imbalance_falls_with_the_square_of_the_step(
    scene, eta_star, integrator, kernels
):
    lattice, velocities, model = bouncing(scene.removeprefix("axial "), N, eta_star / N)
    model = replace(
        model, springs=replace(model.springs, axial=scene.startswith("axial"))
    )
    worst = []
    for stride in (120, 240):
        simulation = kernels.simulation(
            lattice, model, integrator, velocities, 0.12 / stride
        )
        worst.append(np.abs(imbalance(advance(simulation, 16 * stride, stride))).max())
    assert worst[0] / worst[1] == pytest.approx(4.0, abs=0.4)
    assert worst[1] < 1e-4 * 0.5 * 0.05**2


@pytest.mark.parametrize(
    ("scene", "eta_star", "integrator"),
    [
        ("rigid", 1.0, VV),
        ("rigid", 20.0, TRAPEZOIDAL),
        pytest.param("matched", 3.0, VV, marks=LONG),
    ],
)
def test_the_imbalance_once_nothing_vibrates_falls_with_the_fourth_power(
    scene, eta_star, integrator, kernels
):
    """E_2 is then 0, and the energy taken by dashpots is summed to the order of the
    remaining terms."""
    lattice, velocities, model = bouncing(scene, N, eta_star / N, height=0.12)
    closing = []
    for steps in (400, 800):
        simulation = kernels.simulation(
            lattice, model, integrator, velocities, 9.0 / steps
        )
        closing.append(imbalance(advance(simulation, steps, steps))[-1])
    assert closing[0] / closing[1] == pytest.approx(16.0, rel=0.2)
    assert abs(closing[1]) < 3e-6 * 0.5 * 0.05**2


def test_losses_are_recorded_where_they_occur(kernels):
    # dissipated = int eta sum |v_i - v_j|^2 dt over the springs, absorbed = int sum Z
    # v^2 dt over the boundary, by the
    # trapezoidal rule over every step: both sums are O(h^2) from the integrals.
    lattice, velocities, model = bouncing("matched", N, 20.0 / N)
    # The boundary already moves at the start; otherwise the wave would have to arrive
    # first.
    velocities[lattice.disk_points :] = [0.01, -0.02]
    h = 1e-3
    i, j = lattice.bonds.T
    powers = []
    simulation = kernels.simulation(lattice, model, TRAPEZOIDAL, velocities, h)
    for step in range(401):
        columns = advance(simulation, min(step, 1))
        v = simulation.velocities()
        springs = model.springs.eta * np.sum((v[i] - v[j]) ** 2)
        powers.append(
            [springs, np.sum(model.boundary.impedance * v[lattice.wall_boundary] ** 2)]
        )
    lost = h * (np.sum(powers, axis=0) - 0.5 * np.add(powers[0], powers[-1]))
    assert lost.min() > 1e-6
    assert_allclose(
        [columns["dissipated"][-1], columns["absorbed"][-1]], lost, rtol=1e-4
    )


@pytest.mark.parametrize(
    ("scene", "causes"),
    [
        (("exponential_wall", "material.eta_star=0"), set()),
        (("exponential_wall", "material.eta_star=10"), {"dissipated"}),
        (("exponential_wall", "material.eta_star=100"), {"dissipated"}),
        (
            ("exponential_wall", "material.eta_star=0", "wall.friction=0.2"),
            {"friction"},
        ),
        (("absorbing_wall", "material.eta_star=0"), {"absorbed"}),
        pytest.param(
            ("absorbing_wall", "material.eta_star=10"),
            {"absorbed", "dissipated"},
            marks=LONG,
        ),
        (
            (
                "absorbing_wall",
                "material.eta_star=10",
                "time.integrator=trapezoidal",
                "wall.boundary=dashpot",
            ),
            {"absorbed", "dissipated"},
        ),
    ],
)
def test_losses_begin_at_0_and_grow_only_where_their_cause_acts(scene, causes, kernels):
    name, *settings = scene
    spin = ("lattice.points=30", "impact.spin=0.1")
    if name == "absorbing_wall":
        spin += ("wall.points=50", "wall.width=3.0")
    driver = driver_of(kernels, name, *spin, *settings)
    driver.advance()
    for loss in ("dissipated", "absorbed", "friction"):
        values = driver.columns[loss]
        assert values[0] == 0.0
        assert bool(values.any()) is (loss in causes), loss
