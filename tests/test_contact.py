"""The contact forces that a film shows are those that moved the disk."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import computed

from taichi_disk.contact import contact_forces
from taichi_disk.study.reference import Reference

pytestmark = pytest.mark.usefixtures("taichi")


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("exponential_wall", ("lattice.points=150", "impact.velocity=0.1")),
        ("absorbing_wall", ("lattice.points=150", "wall.points=170", "impact.velocity=0.1")),
    ],
)
def test_contact_forces_add_up_to_the_force_that_was_measured(name: str, settings: tuple[str, ...]) -> None:
    setup, outcome = computed(name, *settings)
    columns = outcome.columns
    rows = [int(columns["wall_force"].argmax()), len(columns["t"]) // 2, 0]
    for row in sorted(rows):
        t, x, _ = next(iter(outcome.snapshots(columns["t"][[row]])))
        assert t == pytest.approx(columns["t"][row], rel=1e-12)
        points, forces = contact_forces(setup.lattice, setup.physics, x)
        assert forces[:, 1].sum() == pytest.approx(columns["wall_force"][row], rel=1e-9, abs=1e-12)
        if name == "absorbing_wall":
            brute = Reference(setup.lattice, setup.physics).contacts(x)
            assert points.tolist() == brute.points.tolist()
            strength = setup.physics.a * setup.physics.V0
            push = (strength * np.exp(-setup.physics.a * brute.distance))[:, None] * brute.normal
            assert forces == pytest.approx(push, rel=1e-9)
