"""The energy balance: kinetic + elastic + wall + load + dissipated + absorbed + sliding
stays constant.

Leapfrog conserves a modified energy, E + h^2 E_2 + ..., so the imbalance during an
impact is proportional to h^2; after it, in a smooth state, it is far smaller.
"""

from dataclasses import replace

import numpy as np
import pytest
from bodies import SMALL, WALL, advance, bouncing, computed
from numpy.testing import assert_allclose

from taichi_disk.mechanics.integrators import TRAPEZOIDAL, VELOCITY_VERLET

N = 60
ENERGIES = ("kinetic", "elastic", "wall", "load", "dissipated", "absorbed", "sliding")
VV = VELOCITY_VERLET
LONG = pytest.mark.validate


def imbalance(columns):
    total = np.sum([columns[name] for name in ENERGIES], axis=0)
    return total - total[0]


RIGID = ("exponential_wall", *SMALL)
ELASTIC = ("absorbing_wall", *WALL)
STRONG = "material.eta_star=100"
SCENES = [
    (*RIGID, "material.eta_star=0"),
    (*RIGID, STRONG),
    ELASTIC,
    ("compression", *SMALL, "compression.tolerance=1e-3"),
]
LONG_SCENES = [
    (*RIGID, STRONG, "time.integrator=velocity_verlet"),
    (*RIGID, "material.eta_star=0", "time.integrator=takahashi_imada"),
    (*ELASTIC, "material.eta_star=10", "time.integrator=trapezoidal"),
    (*ELASTIC, "wall.boundary=dashpot"),
]


@pytest.mark.parametrize(
    "scene",
    [*SCENES, *(pytest.param(scene, marks=LONG) for scene in LONG_SCENES)],
    ids=" ".join,
)
def test_energy_is_accounted_for_at_the_automatic_step(scene, kernels):
    scenario, outcome = computed(kernels, *scene, estimate=False)
    columns = outcome.series
    energy = outcome.summary["energy"]
    total = np.sum([columns[name] for name in ENERGIES], axis=0)
    assert_allclose(columns["total"], total, rtol=1e-13)
    scale = columns["kinetic"][0]
    if scene[0] == "compression":  # nothing moves at first
        scale = 0.01 * np.ptp(columns["com_y"])
    lost = imbalance(columns) / scale
    assert energy["closing_imbalance"] == pytest.approx(lost[-1], abs=1e-12)
    assert energy["worst_imbalance"] == pytest.approx(np.abs(lost).max(), abs=1e-12)
    assert abs(lost[-1]) < 2e-5
    assert np.abs(lost).max() < 1e-4
    causes = {
        "dissipated": scenario.model.springs.eta > 0.0,
        "absorbed": scene[0] == "absorbing_wall",
        "friction": False,
    }
    for name, has_cause in causes.items():
        assert columns[name][0] == 0.0
        assert columns[name].any() == has_cause
        # Losses only grow. (Centred sums may dip by their own error.)
        assert np.diff(columns[name]).min() >= -1e-6 * scale


SCENES = [
    ("rigid", 0.0, VV),
    ("rigid", 20.0, VV),
    ("rigid", 100.0, TRAPEZOIDAL),
    ("compression", 20.0, TRAPEZOIDAL),
    ("non-uniform compression", 20.0, TRAPEZOIDAL),
]
LONG_SCENES = [
    ("matched", 20.0, VV),
    ("matched", 100.0, TRAPEZOIDAL),
    ("reset", 0.0, VV),
    ("reset", 20.0, TRAPEZOIDAL),
    ("axial reset", 20.0, VV),
    ("non-uniform rigid", 20.0, VV),
    ("non-uniform matched", 100.0, TRAPEZOIDAL),
    ("non-uniform reset", 20.0, VV),
    ("non-uniform reset", 20.0, TRAPEZOIDAL),
]


@pytest.mark.parametrize(
    ("scene", "eta_star", "integrator"),
    [*SCENES, *(pytest.param(*scene, marks=LONG) for scene in LONG_SCENES)],
)
def test_imbalances_fall_with_the_square_of_steps(scene, eta_star, integrator, kernels):
    lattice, velocities, model = bouncing(scene.removeprefix("axial "), N, eta_star / N)
    springs = replace(model.springs, axial=scene.startswith("axial"))
    model = replace(model, springs=springs)
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
    """E_2 is then 0, and the loss in dashpots is summed to the order of the rest."""
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
    # v^2 dt over the boundary, by the trapezoidal rule, to O(h^2).
    lattice, velocities, model = bouncing("matched", N, 20.0 / N)
    # The boundary moves at the start; else the wave would have to arrive first.
    velocities[lattice.disk_points :] = [0.01, -0.02]
    h = 1e-3
    i, j = lattice.bonds.T
    powers = []
    simulation = kernels.simulation(lattice, model, TRAPEZOIDAL, velocities, h)
    for step in range(201):
        columns = advance(simulation, min(step, 1))
        v = simulation.velocities()
        springs = model.springs.eta * np.sum((v[i] - v[j]) ** 2)
        boundary = np.sum(model.boundary.impedance * v[lattice.wall_boundary] ** 2)
        powers.append([springs, boundary])
    lost = h * (np.sum(powers, axis=0) - 0.5 * np.add(powers[0], powers[-1]))
    assert lost.min() > 1e-6
    found = [columns[name][-1] for name in ("dissipated", "absorbed")]
    assert_allclose(found, lost, rtol=1e-4)
