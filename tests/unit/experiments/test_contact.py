"""The contact of wall and disk: when results are measured."""

import numpy as np
import pytest

from taichi_disk.experiments.computation.contact import Contact, apexes

T = np.linspace(0.0, 10.0, 101)
# two contacts, from 2 to 3 and from 4 to 5
FORCE = np.where(((T >= 2.0) & (T <= 3.0)) | ((T >= 4.0) & (T <= 5.0)), 1.0, 0.0)


def columns(**last):
    """Return a series of two contacts; `last`: values of columns at the end."""
    zero = {name: np.zeros(len(T)) for name in ("dissipated", "absorbed")}
    ends = {name: np.where(T > 5.0, value, 0.0) for name, value in last.items()}
    return zero | ends | {"t": T, "wall_force": FORCE, "com_vy": T - 3.5, "com_y": T}


def test_a_contact_lasts_while_the_force_exceeds_a_hundredth_of_its_peak():
    # F = exp(-|t - t_0|/tau) is 0.01 of its peak at t_0 -+ tau ln 100, where log-linear
    # interpolation is exact.
    t = np.linspace(0.0, 30.0, 1001)
    rising = {"com_y": t, "com_vy": t}
    tau = 1.7
    t0 = t[500]
    force = 3.0 * np.exp(-np.abs(t - t0) / tau)
    contact = Contact(rising | {"t": t, "wall_force": force})
    assert (contact.start, contact.end) == pytest.approx(
        (t0 - tau * np.log(100.0), t0 + tau * np.log(100.0)), abs=1e-9
    )
    # For two contacts, the time from the first to the last.
    force = np.exp(-((t - 8.0) ** 2)) + 0.5 * np.exp(-((t - 20.0) ** 2))
    contact = Contact(rising | {"t": t, "wall_force": force})
    assert (contact.start, contact.end) == pytest.approx(
        (8.0 - np.sqrt(np.log(100.0)), 20.0 + np.sqrt(np.log(50.0))), abs=1e-3
    )
    # A contact without any row lies between the rows before and after it.
    t = np.arange(5.0)
    v = np.array([-1.0, -1.0, -1.0, 0.9, 0.9])
    without = {"t": t, "wall_force": np.zeros(5), "com_vy": v, "com_y": t}
    contact = Contact(without)
    assert (contact.start, contact.end) == (2.0, 3.0)


def test_results_are_measured_after_the_last_contact_if_there_are_losses_else_last():
    for loss in ("dissipated", "absorbed"):
        lossy = Contact(columns(**{loss: 1e-3}))
        assert lossy.results_time == pytest.approx(5.0, abs=0.1)
    assert Contact(columns()).results_time == 10.0
    rings = {"vibration": 0.1 + 0.02 * T, "elastic": 0.0 * T, "translation": T + 0.5}
    assert Contact(columns() | rings).vibration_left == pytest.approx(0.4)


def test_a_contact_may_begin_with_the_second_row():
    # the logarithm of the force is straight between two rows
    force = np.array([1e-4, 1.0, 1.0, 1e-4, 0.0])
    t = np.arange(5.0)
    contact = Contact({"t": t, "wall_force": force, "com_y": t, "com_vy": t})
    assert (contact.start, contact.end) == pytest.approx((0.5, 2.5))


def test_each_impact_under_gravity_has_its_contact():
    t = np.linspace(0.0, 30.0, 3001)
    y = np.abs(np.cos(t / 3.0 + 0.3))
    force = np.where(y < 0.1, 0.1 - y, 0.0)
    series = {"t": t, "wall_force": force, "com_y": y, "com_vy": np.gradient(y, t)}
    tops = 3.0 * (np.pi * np.arange(1, 4) - 0.3)
    assert t[apexes(series)] == pytest.approx(tops, abs=0.011)
    second = Contact(series, 1)
    assert second.end + second.start == pytest.approx(tops[0] + tops[1], abs=0.01)
    duration = 6.0 * np.arcsin(0.1)
    assert second.end - second.start == pytest.approx(duration, abs=0.02)
