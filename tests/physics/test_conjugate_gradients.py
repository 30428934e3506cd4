"""Implicit dashpots of a large lattice, solved by iteration: the same motion and
energies as with a factor."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import (
    ELASTIC,
    disk,
    disk_and_wall,
    matched,
    moving_down,
    non_uniform,
    pressed,
)
from numpy.testing import assert_array_equal

from taichi_disk import runtime
from taichi_disk.integrators import TRAPEZOIDAL
from taichi_disk.integrators.conjugate_gradients import IterativeSolver
from taichi_disk.physics import Model, PinnedBoundary, ResetBoundary, Springs, ordering
from taichi_disk.simulation import simulation
from taichi_disk.simulation.observables import INDEX

LONG = pytest.mark.validate


def body(name):
    if name == "rigid":
        lattice = non_uniform(disk(90, height=0.02))
        model = pressed(0.02, 0.3)
    else:
        lattice = disk_and_wall(60, 80, height=0.02)
        boundary = {
            "matched": matched(lattice),
            "reset": ResetBoundary(1e-2),
            "pinned": PinnedBoundary(),
        }[name]
        model = Model(Springs(1.0, 1.0, 0.3), ELASTIC, boundary=boundary)
    return lattice, model, TRAPEZOIDAL, moving_down(lattice, 0.05), 2e-3


@pytest.mark.parametrize(
    "name",
    [
        "rigid",
        *(pytest.param(name, marks=LONG) for name in ("reset", "matched", "pinned")),
    ],
)
def test_iterated_dashpots_move_a_body_as_a_factor_does_and_go_on_from_a_saved_state(
    name, monkeypatch, kernels
):
    direct = kernels.simulation(*body(name))
    monkeypatch.setattr(simulation, "LARGEST_FACTORISED", 0)
    iterated = simulation.Simulation(*body(name))
    assert isinstance(iterated.kernels.solver, IterativeSolver)
    assert type(direct.kernels.solver) is not IterativeSolver
    expected = direct.advance(600, 50)[0]
    rows = iterated.advance(600, 50)[0]
    assert expected[-1, INDEX["dissipated"]] > 1e-8
    assert (
        np.abs(rows - expected) <= 1e-8 * np.maximum(np.abs(expected).max(axis=0), 1e-3)
    ).all()
    state = iterated.snapshot()
    ahead = iterated.advance(60, 5)[0]
    iterated.restore(state)
    assert_array_equal(iterated.advance(60, 5)[0], ahead)
    assert iterated.restart(*body(name))
    assert_array_equal(iterated.advance(600, 50)[0], rows)


@LONG
def test_iterated_dashpots_move_subdomains_as_one_body(monkeypatch):
    runtime.start()
    monkeypatch.setattr(simulation, "LARGEST_FACTORISED", 0)
    lattice = disk(900, height=0.02)
    model = pressed(0.02, 0.02)
    arguments = lattice, model, TRAPEZOIDAL, moving_down(lattice, 0.05), 2e-3
    serial = simulation.Simulation(*arguments)
    monkeypatch.setattr(ordering, "PARALLEL_FROM", 1)
    cut = simulation.Simulation(*arguments)
    assert cut.subdomains > 3
    expected = serial.advance(105, 21)[0]
    rows = cut.advance(105, 21)[0]
    assert (
        np.abs(rows - expected) <= 1e-9 * np.maximum(np.abs(expected).max(axis=0), 1e-3)
    ).all()
