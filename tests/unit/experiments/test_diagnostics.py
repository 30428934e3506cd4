"""A blow-up is found within one launch, and reported with its place and remedy."""

import re
from dataclasses import replace

import numpy as np
import pytest
from bodies import ELASTIC, RESET, disk_and_wall, driver_of

from taichi_disk.experiments.computation.diagnostics import BlowUp, EnergyBalance
from taichi_disk.mechanics.integrators import VELOCITY_VERLET as VV
from taichi_disk.mechanics.physics import ElasticWall, Model, ResetBoundary, Springs
from taichi_disk.mechanics.simulation.observables import INDEX

SMALL = ("exponential_wall", "lattice.points=80", "material.eta_star=0")
# as in the shipped scene, so that no other kernel is compiled
ON_WALL = Model(Springs(1.0, 1.0), ELASTIC, boundary=ResetBoundary(RESET))


@pytest.mark.parametrize(
    ("energies", "lost"),
    [
        ({"kinetic": [1.0, 1.05, 1.0]}, None),
        ({"kinetic": [1.0, 1.05, 1.2]}, 2),
        ({"kinetic": [1.0, np.nan]}, 1),
        ({"kinetic": [1.0, 1.0, np.inf]}, 2),
        # A balance that closes only because of a huge sliding energy is not valid.
        ({"kinetic": [1.0, 0.95, 0.8], "sliding": [0.0, 0.05, 0.2]}, 2),
        # The limit is a tenth of the largest energy so far.
        ({"kinetic": [1, 0, 0], "elastic": [0, 1, 0.06], "absorbed": [0, 0, 1]}, None),
        # The wall's potential counts, as in a slow contact with a soft wall.
        ({"kinetic": [1, 0, 0], "wall": [0, 2, 2.2], "absorbed": [0, -1, -1]}, None),
    ],
)
def test_a_lost_balance_is_detected_in_its_first_row(energies, lost):
    rows = np.zeros((len(energies["kinetic"]), len(INDEX)))
    for name, values in energies.items():
        rows[:, INDEX[name]] = values
    at_once = EnergyBalance(rows[0], None)
    one_by_one = EnergyBalance(rows[0], None)
    assert at_once.first_lost(rows) == lost
    each = [one_by_one.first_lost(row[None]) for row in rows]
    assert [found is None for found in each[:lost]] == [True] * len(rows[:lost])
    assert lost is None or each[lost] == 0


def test_a_blow_up_at_a_forced_step_is_reported_with_the_last_good_state(kernels):
    long = ("impact.gap=0.13", "time.dt=0.2", "time.sample_interval=1.8")
    driver = driver_of(kernels, *SMALL, *long, force=True)
    assert driver.advance() == "failed"
    assert isinstance(driver.failure, BlowUp)
    message = str(driver.failure)
    good = driver.failure.last_good
    text = (
        r"blow-up after t = ([0-9.]+) R/c: the energy balance is off by .*; before that"
        r" spring (\d+) between points"
    )
    found = re.match(text, message)
    assert float(found[1]) == pytest.approx(float(good["t"]))
    assert float(re.search(r"is ([0-9.]+) of the stability limit", message)[1]) > 1.0
    assert message.endswith("the step is beyond the stability limit: set time.dt: auto")
    lattice = driver.scenario.lattice
    springs = driver.scenario.model.springs
    assert int(found[2]) == np.abs(springs.strain(lattice, good["positions"])).argmax()
    # Before the blow-up the disk falls at its speed, and all rows are there.
    assert np.isfinite(good["positions"]).all()
    assert good["velocities"][:, 1].mean() == pytest.approx(-0.02, abs=1e-4)
    # The next row would lie behind the blow-up.
    beyond = good["t"] - driver.columns["t"][-1]
    assert -1e-12 <= beyond < 0.99 * driver.stride * 0.2


def test_a_number_that_is_not_finite_is_found_after_a_launch(kernels, monkeypatch):
    number = "taichi_disk.experiments.computation.driver.SPRINGS_PER_LAUNCH"
    monkeypatch.setattr(number, 20_000)
    driver = driver_of(kernels, *SMALL, "impact.gap=0.13", "time.dt=0.02")
    driver.advance(steps=500)  # to the middle of the impact
    snapshot = driver.simulation.snapshot()
    snapshot.vectors[1, 5, 1] = np.nan
    driver.simulation.restore(snapshot)
    assert driver.advance() == "failed"
    assert isinstance(driver.failure, BlowUp)  # after which a shorter step is tried
    assert "a number is no longer finite" in str(driver.failure)
    good = driver.failure.last_good
    assert 400 < round(float(good["t"]) / 0.02) <= 600
    assert all(np.isfinite(values).all() for values in good.values())


def test_the_depth_of_a_disk_in_a_bumpy_wall_is_measured(kernels):
    # against the straight lines between the points of the surface
    lattice = disk_and_wall()
    rng = np.random.default_rng(0)
    for y in (-0.3, -0.05, 0.0, 0.5):
        x = lattice.positions.copy()
        x[: lattice.disk_points, 1] += y
        x[lattice.wall_surface, 1] += 0.02 * rng.random(len(lattice.wall_surface))
        body = replace(lattice, positions=x)
        simulation = kernels.simulation(body, ON_WALL, VV, 0.0 * x, 1e-3)
        surface = x[lattice.wall_surface]
        rim = x[lattice.disk_surface]
        below = np.interp(rim[:, 0], *surface.T) - rim[:, 1]
        expected = max(0.0, below[np.abs(rim[:, 0]) < 1.5].max())
        found = simulation.first_row[INDEX["depth"]]
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert expected == 0.0


def test_a_disk_may_be_twice_as_deep_as_the_potential_permits():
    start = np.zeros(len(INDEX))
    start[INDEX["kinetic"]] = 2e-4
    row = start.copy()
    permitted = np.log(2e-4 / 1e-5) / 100.0
    for depth, wall, is_valid in (
        (1e-9, ElasticWall(300.0, 150.0, 0.1), False),
        (0.05, ElasticWall(1.0, 1e-5, 0.1), True),
        (1.9 * permitted, ElasticWall(100.0, 1e-5, 0.1), True),
        (2.1 * permitted, ElasticWall(100.0, 1e-5, 0.1), False),
    ):
        row[INDEX["depth"]] = depth
        balance = EnergyBalance(start, wall)
        assert (balance.first_lost(row[None]) is None) == is_valid
        if not is_valid:
            assert "gone through the surface" in balance.loss(row)
