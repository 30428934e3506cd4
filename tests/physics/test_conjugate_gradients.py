"""Implicit dashpots by iteration: the same motion and energies as by a factor."""

import numpy as np
import pytest
from bodies import bouncing, disk, moving_down, pressed
from numpy.testing import assert_array_equal

from taichi_disk.base import runtime
from taichi_disk.mechanics.integrators import TRAPEZOIDAL
from taichi_disk.mechanics.integrators.conjugate_gradients import IterativeSolver
from taichi_disk.mechanics.physics import ordering
from taichi_disk.mechanics.simulation import simulation
from taichi_disk.mechanics.simulation.observables import INDEX

LONG = pytest.mark.validate


def assert_equal_rows(rows, expected, allowed):
    scale = np.maximum(np.abs(expected).max(axis=0), 1e-3)
    assert (np.abs(rows - expected) <= allowed * scale).all()


@pytest.mark.parametrize(
    "scene",
    [
        "non-uniform compression",
        *(pytest.param(name, marks=LONG) for name in ("reset", "matched", "pinned")),
    ],
)
def test_iterated_dashpots_move_a_body_as_a_factor_does_and_go_on_from_a_saved_state(
    scene, monkeypatch, kernels
):
    lattice, velocities, model = bouncing(scene, 90, 0.3, height=0.02)
    body = lattice, model, TRAPEZOIDAL, velocities, 2e-3
    direct = kernels.simulation(*body)
    monkeypatch.setattr(simulation, "LARGEST_FACTORISED", 0)
    iterated = kernels.simulation(*body)
    assert isinstance(iterated.program.kernels.solver, IterativeSolver)
    assert type(direct.program.kernels.solver) is not IterativeSolver
    expected = direct.advance(300, 50)[0]
    rows = iterated.advance(300, 50)[0]
    assert expected[-1, INDEX["dissipated"]] > 1e-8
    assert_equal_rows(rows, expected, 1e-8)
    state = iterated.snapshot()
    ahead = iterated.advance(60, 5)[0]
    iterated.restore(state)
    assert iterated.step_number == 300
    assert_array_equal(iterated.advance(60, 5)[0], ahead)
    # The observables after the last step do not depend on which rows were requested.
    iterated.restore(state)
    iterated.advance(57, 50)
    last = iterated.now
    iterated.restore(state)
    assert_array_equal(iterated.advance(57)[0][-1], last)
    again = simulation.Simulation(*body, iterated.cache)
    assert again.program is iterated.program
    assert_array_equal(again.advance(300, 50)[0], rows)


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
    assert cut.arrangement.subdomains > 3
    expected = serial.advance(105, 21)[0]
    rows = cut.advance(105, 21)[0]
    assert_equal_rows(rows, expected, 1e-9)
