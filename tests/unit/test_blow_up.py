"""A blow-up is found within one launch of steps and told with step, place, likely cause and remedy."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from bodies import ELASTIC, FREE, RIGID, WALL, computed, disk, disk_and_wall, driver_of

from taichi_disk.integrators import VELOCITY_VERLET
from taichi_disk.physics import ElasticWall, ExponentialWall, Model, Springs
from taichi_disk.simulation.energy_balance import Watch
from taichi_disk.simulation.error_estimate import TimeStep
from taichi_disk.simulation.failure import BlowUp, diagnose, gone_through, worst_place
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
        # What sliding takes or gives is no reason to believe the rest.
        ({"kinetic": [1.0, 0.95, 0.8], "sliding": [0.0, 0.05, 0.2]}, 2),
        # A tenth of the largest energy so far.
        ({"kinetic": [1.0, 0.0, 0.0], "elastic": [0.0, 1.0, 0.06], "absorbed": [0.0, 0.0, 0.9]}, None),
    ],
)
def test_a_lost_balance_is_seen_in_the_first_row_that_shows_it(energies, lost):
    rows = np.zeros((len(energies["kinetic"]), len(INDEX)))
    for name, values in energies.items():
        rows[:, INDEX[name]] = values
    at_once, one_by_one = Watch(rows[0]), Watch(rows[0])
    assert at_once.first_lost(rows) == lost
    each = [one_by_one.first_lost(row[None]) for row in rows]
    assert [found is None for found in each[:lost]] == [True] * len(rows[:lost]) and (lost is None or each[lost] == 0)


def test_a_forced_step_is_told_to_the_step_and_the_state_before_it_is_kept(kernels):
    driver = driver_of(kernels, *SMALL, "time.dt=0.1", "time.sample_interval=0.9", force=True)
    assert driver.advance() == "failed" and isinstance(driver.failure, BlowUp)
    message, good = str(driver.failure), driver.failure.last_good
    found = re.search(r"blow-up at step (\d+), t = ([0-9.]+) R/c: the energy balance is lost, spring", message)
    assert float(found[2]) == pytest.approx(0.1 * int(found[1]))
    assert float(good["t"]) == pytest.approx(0.1 * (int(found[1]) - 1))
    assert "beyond the stability limit" in message and message.endswith("Remedy: set time.dt: auto")
    # Up to there little is wrong: the disk falls at its speed. All rows until then are known.
    assert np.isfinite(good["positions"]).all()
    assert good["velocities"][:, 1].mean() == pytest.approx(-0.02, abs=1e-4)
    assert 0.0 <= good["t"] - driver.columns["t"][-1] <= driver.stride * 0.1


@pytest.mark.parametrize("dt", ["0.02", "auto"])
def test_a_number_lost_by_the_machine_is_found_in_the_next_launch_and_told_as_that(dt, kernels):
    driver = driver_of(kernels, *SMALL, f"time.dt={dt}", launch=20_000)
    driver.advance(steps=500)
    snapshot = driver.simulation.snapshot()
    snapshot.vectors[0, 5, 1] = np.nan
    driver.simulation.restore(snapshot)
    if dt == "auto":  # a shorter step, from the start: nothing is wrong then
        assert driver.advance() == "restarted"
        while driver.advance() == "restarted":
            pass
        assert driver.status == "finished"
    else:
        assert driver.advance() == "failed"
        assert "computed again, it does not happen: the machine errs" in str(driver.failure)
        good = driver.failure.last_good
        assert 400 < round(float(good["t"]) / 0.02) <= 600
        assert all(np.isfinite(values).all() for values in good.values())


def test_a_disk_in_the_wall_or_past_its_end_is_seen():
    lattice = disk_and_wall()

    def found(x, y, model=ON_WALL):
        positions = lattice.positions.copy()
        positions[: lattice.disk_points] += [x, y]
        return gone_through(lattice, model, positions, energy=2e-4)

    assert found(0.0, 0.0) is None and found(0.0, 0.5) is None
    assert found(0.0, -1.0, Model(Springs(), RIGID)) is None
    # Sunk in by 0.05 R; beside the wall, past its end.
    assert "0.05 R below" in found(0.0, -0.08).cause and "end of the wall" in found(3.0, -2.0).cause
    assert found(0.0, -0.08).step_independent and found(3.0, -2.0).step_independent
    # In a potential too weak to keep a point of this energy out, this depth is allowed.
    assert found(0.0, -0.05) is not None
    assert found(0.0, -0.05, Model(Springs(), ElasticWall(1.0, 1e-5, 0.1))) is None


def test_the_cause_named_is_the_one_there_is():
    lattice = disk(60, height=0.03)
    x, rigid = lattice.positions, Model(Springs(), RIGID)
    hard, stiff = replace(rigid, wall=ExponentialWall(1e5, 150.0)), Model(Springs(1.0, 1e6), RIGID)
    for model, dt, limit, before, after, cause in (
        (rigid, 0.2, 0.1, x, x, "beyond the stability limit"),
        (rigid, 0.05, 0.06, x - [0, 0.02], x, "the wall pushes point"),
        (hard, 0.05, 0.06, x, x - [0, 0.05], "the wall pushes point"),  # from out of reach to deep in it in one step
        (stiff, 0.05, 0.06, 1.1 * x + [0, 0.5], x, "by the springs' strain"),
        (FREE, 0.01, 0.06, x * [1.0, 0.1], x, "crushed: springs are strained by up to 90%"),
    ):
        found = diagnose(lattice, model, TimeStep(VELOCITY_VERLET, limit, dt), before, after, 1.0)
        assert cause in found.cause and ("auto" in found.remedy) == ("beyond" in found.cause)


def test_the_worst_place_is_a_point_without_position_or_the_most_strained_spring():
    lattice = disk(80)
    i, j = lattice.bonds[9]
    x = lattice.positions.copy()
    x[j] += 2.0 * (x[j] - x[i])
    assert re.match(rf"spring \d+ between points ({j} and|\d+ and {j}) ", worst_place(FREE, lattice, x))
    x[5, 1] = np.nan
    assert worst_place(FREE, lattice, x) == "1 of 80 points have no position, among them point 5"


def test_a_disk_that_goes_through_the_wall_ends_a_run(kernels):
    with pytest.raises(BlowUp, match=r"gone through the wall's surface.*lower impact\.velocity") as caught:
        computed(kernels, "absorbing_wall", *WALL, "impact.velocity=2")
    assert np.isfinite(caught.value.last_good["positions"]).all()
