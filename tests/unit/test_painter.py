"""What the painter shows of forces, without a graphics device."""

from types import SimpleNamespace

import numpy as np
import pytest
from bodies import painter


def test_arrows_that_would_touch_become_their_mean_and_weak_ones_are_left_out():
    default_painter = painter()
    lowest = np.argsort(default_painter.lattice.positions[:, 1])[:4]
    forces = np.array([0.002, 0.004, 0.006, 1e-6])
    pushes = lowest, np.stack([np.zeros(4), forces], axis=1)
    default_painter.wall = SimpleNamespace(
        decay_length=1 / 300, contact_forces=lambda *state: pushes
    )
    x = default_painter.lattice.positions + [5.0, 0.0]
    feet, mean = default_painter.pushes(x, 0 * x, x, 10.0)
    assert feet == pytest.approx(x[lowest[:3]].mean(axis=0)[None])
    assert mean == pytest.approx(np.array([[0.0, 0.4]]))
    assert len(default_painter.pushes(x, 0 * x, x, 1e-3)[0]) == 3


def test_arrows_begin_above_the_wall_s_edge_however_much_displacements_are_magnified():
    default_painter = painter(magnify=20.0)
    lowest = np.argsort(default_painter.lattice.positions[:, 1])[:6]
    default_painter.wall = SimpleNamespace(
        decay_length=1e-9, contact_forces=lambda *state: (lowest, np.full((6, 2), 0.01))
    )
    x = np.maximum(default_painter.lattice.positions, [-9.0, 0.1])  # flat below
    assert default_painter.placed(x)[lowest, 1].min() < 0.0 < default_painter.edge
    placed = default_painter.placed(x)
    feet, _ = default_painter.pushes(x, 0 * x, placed, 1e-3)
    assert feet[:, 1].min() == default_painter.edge
