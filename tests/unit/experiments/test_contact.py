"""The contact of wall and disk: when results are measured."""

import numpy as np
import pytest

from taichi_disk.experiments.computation.contact import (
    apexes,
    contact_interval,
    results_time,
)

T = np.linspace(0.0, 10.0, 101)
# two contacts, from 2 to 3 and from 4 to 5
FORCE = np.where(((T >= 2.0) & (T <= 3.0)) | ((T >= 4.0) & (T <= 5.0)), 1.0, 0.0)


def columns(**last):
    """Return a series of two contacts; `last`: values of columns at the end."""
    zero = {name: np.zeros(len(T)) for name in ("dissipated", "absorbed")}
    ends = {name: np.where(T > 5.0, value, 0.0) for name, value in last.items()}
    rising = {"com_y": T, "com_vy": T - 3.5}
    return zero | ends | rising | {"t": T, "wall_force": FORCE}


def contact(t, wall_force, com_vy=None):
    """Return the contact of a disk that does not fall back."""
    rising = np.ones(len(t)) if com_vy is None else com_vy
    return contact_interval(
        {"t": t, "wall_force": wall_force, "com_y": t, "com_vy": rising}
    )


def test_a_contact_lasts_while_the_force_exceeds_a_hundredth_of_its_peak():
    # F = exp(-|t - t_0|/tau) is 0.01 of its peak at t_0 -+ tau ln 100, where log-linear
    # interpolation is exact.
    t = np.linspace(0.0, 30.0, 1001)
    tau = 1.7
    t0 = t[500]
    force = 3.0 * np.exp(-np.abs(t - t0) / tau)
    found = contact(t, force)
    assert found == pytest.approx(
        (t0 - tau * np.log(100.0), t0 + tau * np.log(100.0)), abs=1e-9
    )
    # For two contacts, the time from the first to the last.
    force = np.exp(-((t - 8.0) ** 2)) + 0.5 * np.exp(-((t - 20.0) ** 2))
    found = contact(t, force)
    assert found == pytest.approx(
        (8.0 - np.sqrt(np.log(100.0)), 20.0 + np.sqrt(np.log(50.0))), abs=1e-3
    )
    # A contact without any row lies between the rows before and after it.
    t = np.arange(5.0)
    v = np.array([-1.0, -1.0, -1.0, 0.9, 0.9])
    assert contact(t, np.zeros(5), v) == (2.0, 3.0)


def test_each_impact_under_gravity_has_its_contact():
    t = np.linspace(0.0, 30.0, 3001)
    y = np.abs(np.cos(t / 3.0 + 0.3))
    v = np.gradient(y, t)
    force = np.where(y < 0.1, 0.1 - y, 0.0)
    series = {"t": t, "wall_force": force, "com_y": y, "com_vy": v}
    tops = 3.0 * (np.pi * np.arange(1, 4) - 0.3)
    assert t[apexes(series)] == pytest.approx(tops, abs=0.011)
    middle = tops[:2].mean()
    half = 3.0 * np.arcsin(0.099)
    assert contact_interval(series, 1) == pytest.approx(
        (middle - half, middle + half), abs=2e-3
    )


def test_results_are_measured_after_the_last_contact_if_there_are_losses_else_last():
    for loss in ("dissipated", "absorbed"):
        assert results_time(columns(**{loss: 1e-3})) == pytest.approx(5.0, abs=0.1)
    assert results_time(columns()) == 10.0


def test_a_contact_may_begin_with_the_second_row():
    # the logarithm of the force is straight between two rows
    force = np.array([1e-4, 1.0, 1.0, 1e-4, 0.0])
    found = contact(np.arange(5.0), force)
    assert found == pytest.approx((0.5, 2.5))
