"""The contact of wall and disk: when results are measured."""

from __future__ import annotations

import numpy as np
import pytest

from taichi_disk.computation.contact import contact_interval, results_time

T = np.linspace(0.0, 10.0, 101)
# two contacts, from 2 to 3 and from 4 to 5
FORCE = np.where(((T >= 2.0) & (T <= 3.0)) | ((T >= 4.0) & (T <= 5.0)), 1.0, 0.0)


def columns(**last):
    """Return a series of two contacts; `last`: values of columns at the end."""
    zero = {name: np.zeros(len(T)) for name in ("dissipated", "absorbed")}
    ends = {name: np.where(T > 5.0, value, 0.0) for name, value in last.items()}
    return zero | ends | {"t": T, "wall_force": FORCE, "com_vy": T - 3.5}


def test_the_contact_lasts_from_the_first_to_the_last_force():
    start, end = contact_interval(T, FORCE, T - 3.5)
    assert (start, end) == pytest.approx((2.0, 5.0), abs=0.1)


@pytest.mark.parametrize("loss", ["dissipated", "absorbed"])
def test_with_losses_results_are_measured_at_the_end_of_the_last_contact(loss):
    assert results_time(columns(**{loss: 1e-3})) == pytest.approx(5.0, abs=0.1)


def test_without_losses_results_are_measured_at_the_end_of_the_run():
    assert results_time(columns()) == 10.0


def test_a_contact_between_two_rows_is_the_interval_in_which_the_disk_turns_back():
    start, end = contact_interval(T, np.zeros(len(T)), T - 3.55)
    assert (start, end) == pytest.approx((3.5, 3.6))


def test_a_contact_may_begin_with_the_second_row():
    # the logarithm of the force is straight between two rows
    force = np.array([1e-4, 1.0, 1.0, 1e-4, 0.0])
    start, end = contact_interval(np.arange(5.0), force, np.arange(5.0) - 1.5)
    assert (start, end) == pytest.approx((0.5, 2.5))
