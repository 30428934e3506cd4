"""The flight towards the wall that is known without a step: the linear answer to the wall's force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from taichi_disk.accuracy.steps import Reference
from taichi_disk.computation.outcome import compute
from taichi_disk.computation.stability import spectrum
from taichi_disk.physics import Load
from taichi_disk.scenes import load_scene

WALL = ("wall.points=70", "wall.width=3.0", "wall.threshold=0.3")


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("exponential_wall", ("material.eta_star=0",)),
        ("exponential_wall", ("material.eta_star=20", "impact.velocity=0.1")),
        ("exponential_wall", ("material.eta_star=20", "material.dashpot=axial", "wall.a=1000", "lattice.rim=false")),
        ("exponential_wall", ("lattice.core_radius=0.6", "lattice.core_density=3", "lattice.core_stiffness=0.2")),
        ("absorbing_wall", (*WALL, "wall.boundary=pinned", "material.eta_star=5")),
    ],
)
def test_slowing_down_and_deformation_are_those_of_dop853(name, settings):
    scenario = load_scene(name, ["lattice.points=60", "impact.velocity=0.04", *settings]).scenario()
    approach, lattice = scenario.approach(), scenario.lattice
    for t in (approach.end, approach.end - 1.0 / approach.rate):
        x, v = approach.at(t)
        flight = lattice.positions + t * scenario.velocities
        far, fast = Reference(lattice, scenario.model).solve(scenario.velocities, t, rtol=1e-12)
        assert np.abs(x - far).max() < 0.02 * np.abs(far - flight).max()
        assert np.abs(v - fast).max() < 0.02 * np.abs(fast - scenario.velocities).max()
    assert np.array_equal(approach.at(0.0)[0], lattice.positions)


@pytest.mark.parametrize("settings", [("impact.spin=0.1",), ("impact.gap=0.2",)])
def test_a_spin_or_a_start_by_hand_is_stepped_through(settings):
    assert load_scene("exponential_wall", ["lattice.points=60", *settings]).scenario().approach() is None


def test_a_force_of_ones_own_acts_on_the_whole_flight():
    scenario = load_scene("exponential_wall", ["lattice.points=60"]).scenario()
    assert scenario.approach() is not None
    scenario.model = replace(scenario.model, others=(Load(1e-4),))
    assert scenario.approach() is None and scenario.end_bounds()["lowest_y"][0] == scenario.gap


def test_rows_before_the_first_step_balance_and_follow_the_steps_that_a_whole_flight_takes(kernels):
    scene = load_scene("exponential_wall", ["lattice.points=60", "time.safety=0.3"])
    near = scene.scenario()
    whole = scene.with_({"impact.gap": near.gap}).scenario()
    modes = spectrum(near.lattice, near.model)
    (one, summary), (other, _) = (
        (outcome.columns, outcome.summary)
        for outcome in (
            compute(each, scene.time, kernels=kernels, modes=modes, estimate=False) for each in (near, whole)
        )
    )
    count = round(summary["stepped_from"] / one["t"][1])
    assert count > 20
    for name in ("com_y", "com_vy", "lowest_y", "wall_force", "wall", "kinetic", "elastic"):
        size = np.abs(other[name][: count + 1] - other[name][0]).max()
        np.testing.assert_allclose(one[name][:count], other[name][:count], atol=0.02 * size, err_msg=name)
    assert np.abs(one["total"][: count + 1] / one["total"][0] - 1.0).max() < 1e-9
