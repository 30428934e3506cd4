"""A blow-up is detected within one launch of steps, and reported with time, place,
likely cause and remedy."""

from __future__ import annotations

import re

import numpy as np
import pytest
from bodies import ELASTIC, RIGID, WALL, computed, control_of, disk_and_wall, driver_of

from taichi_disk.computation.diagnostics import BlowUp, EnergyBalance, gone_through
from taichi_disk.computation.driver import Driver
from taichi_disk.physics import ElasticWall, Model, Springs
from taichi_disk.simulation.observables import INDEX

SMALL = ("exponential_wall", "lattice.points=80", "material.eta_star=0")
ON_WALL = Model(Springs(), ELASTIC)


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
        (
            {
                "kinetic": [1.0, 0.0, 0.0],
                "elastic": [0.0, 1.0, 0.06],
                "absorbed": [0.0, 0.0, 0.9],
            },
            None,
        ),
        # The wall's potential counts, as in a slow contact with a soft wall.
        (
            {
                "kinetic": [1.0, 0.05, 0.0],
                "wall": [0.0, 2.0, 2.2],
                "absorbed": [0.0, -1.05, -1.05],
            },
            None,
        ),
    ],
)
def test_a_lost_balance_is_detected_in_its_first_row(energies, lost):
    rows = np.zeros((len(energies["kinetic"]), len(INDEX)))
    for name, values in energies.items():
        rows[:, INDEX[name]] = values
    at_once = EnergyBalance(rows[0])
    one_by_one = EnergyBalance(rows[0])
    assert at_once.first_lost(rows) == lost
    each = [one_by_one.first_lost(row[None]) for row in rows]
    assert [found is None for found in each[:lost]] == [True] * len(rows[:lost])
    assert lost is None or each[lost] == 0


def test_a_blow_up_at_a_forced_step_is_reported_with_the_last_good_state(kernels):
    driver = driver_of(
        kernels,
        *SMALL,
        "impact.gap=0.13",
        "time.dt=0.2",
        "time.sample_interval=1.8",
        force=True,
    )
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
    # Before the blow-up the disk falls at its speed, and all rows until then are
    # available.
    assert np.isfinite(good["positions"]).all()
    assert good["velocities"][:, 1].mean() == pytest.approx(-0.02, abs=1e-4)
    # The next row would lie behind the blow-up.
    beyond = good["t"] - driver.columns["t"][-1]
    assert -1e-12 <= beyond < 0.99 * driver.stride * 0.2


@pytest.mark.parametrize("dt", ["0.02", "auto"])
def test_a_number_that_is_not_finite_is_reported_after_the_launch(
    dt, kernels, monkeypatch
):
    monkeypatch.setattr("taichi_disk.computation.driver.SPRINGS_PER_LAUNCH", 20_000)
    driver = driver_of(kernels, *SMALL, "impact.gap=0.13", f"time.dt={dt}")
    driver.advance(steps=60 if dt == "auto" else 500)  # to the middle of the impact
    snapshot = driver.simulation.snapshot()
    snapshot.vectors[1, 5, 1] = np.nan
    driver.simulation.restore(snapshot)
    assert driver.advance() == "failed"
    assert isinstance(driver.failure, BlowUp)
    if dt == "auto":
        # a shorter step is tried, which succeeds
        control = control_of(driver.scenario.scene)
        assert control.shortens(driver)
        again = Driver(driver.scenario, control.step, kernels)
        assert again.advance() == "finished"
    else:
        assert "a number is no longer finite" in str(driver.failure)
        good = driver.failure.last_good
        assert 400 < round(float(good["t"]) / 0.02) <= 600
        assert all(np.isfinite(values).all() for values in good.values())


def test_a_disk_in_the_wall_is_detected():
    lattice = disk_and_wall()

    def found(y, model=ON_WALL):
        positions = lattice.positions.copy()
        positions[: lattice.disk_points, 1] += y
        return gone_through(lattice, model, positions, energy=2e-4)

    assert found(-0.05)
    assert not found(0.0)
    assert not found(0.5)
    assert not found(-1.0, Model(Springs(), RIGID))
    # This depth is allowed if the potential is too weak to stop a point of this energy.
    assert not found(-0.05, Model(Springs(), ElasticWall(1.0, 1e-5, 0.1)))
    # Twice the depth at which the potential equals the energy is allowed. The lowest
    # point is 0.03 R above the wall.
    depth = np.log(2e-4 / 1e-5) / 100.0
    wall = Model(Springs(), ElasticWall(100.0, 1e-5, 0.1))
    assert not found(-0.03 - 1.6 * depth, wall)
    assert found(-0.03 - 2.4 * depth, wall)


@pytest.mark.validate
def test_a_disk_that_goes_through_the_wall_ends_a_run(kernels):
    with pytest.raises(
        BlowUp,
        match=r"may have dented the wall, gone through it.*lower impact\.velocity",
    ) as caught:
        computed(kernels, "absorbing_wall", *WALL, "impact.velocity=2")
    assert np.isfinite(caught.value.last_good["positions"]).all()
