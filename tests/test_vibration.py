"""What an elastic impact leaves in vibration: the shares are the whole, on the lattice as in the continuum."""

from __future__ import annotations

import numpy as np
import pytest

from taichi_disk.errors import SimulationError
from taichi_disk.lattice import disk_lattice
from taichi_disk.stiffness import spring_energy
from taichi_disk.study import vibration
from taichi_disk.study.vibration import continuum_restitution, kept


@pytest.mark.usefixtures("taichi")
def test_what_the_disk_keeps_and_what_it_gives_back_are_the_whole():
    one = kept(seed=0, velocity=0.05, points=300, a=3000.0)
    # The parts share no code with the ledger; it closes to 2e-5.
    assert one.restitution**2 + one.rotation + one.vibration == pytest.approx(1.0, abs=3e-5)
    assert 0.0 < one.ellipse < one.modes < 1.001 * one.vibration
    assert one.period == pytest.approx(2.3, rel=0.05)


def test_the_energies_of_all_vibrations_are_the_energy(monkeypatch):
    monkeypatch.setattr(vibration, "MODES", 116)  # of 117: the solver cannot give the last
    disk = disk_lattice(60, 1)
    rest = disk.positions - disk.positions.mean(axis=0)
    u = 1e-6 * rest * [1.0, -1.0]  # much of it the ellipse
    still = np.zeros_like(u)
    energies, lowest = vibration._modal_energies(disk, rest, u, still, 1.0)
    whole = spring_energy(rest + u, disk.bonds, disk.rest_lengths, 1.0, 0.0)
    assert energies.sum() == pytest.approx(whole, rel=1e-3) and energies[:2].sum() > 0.4 * whole
    assert 2.0 < lowest < 3.5
    energies, _ = vibration._modal_energies(disk, rest, still, u, 1.0)
    assert energies.sum() == pytest.approx(0.5 * float(np.sum(u**2)) / 60, rel=1e-3)


def test_a_continuum_that_is_much_stiffer_than_the_wall_bounces_as_a_rigid_body():
    assert continuum_restitution(1e-3, 1.1, 0.29, rings=6, a=100.0) == pytest.approx(1.0, abs=1e-5)
    assert 0.9 < continuum_restitution(0.05, 1.1, 0.29, rings=6, a=3000.0) < 0.999
    with pytest.raises(SimulationError, match="too long for the continuum"):
        continuum_restitution(0.02, 1.1, 0.29, rings=6, a=1e6)


@pytest.mark.validate
@pytest.mark.usefixtures("taichi")
def test_a_fine_lattice_and_the_continuum_keep_as_much():
    assert continuum_restitution(0.02, 1.1025, 0.287) == pytest.approx(kept(0, 0.02).restitution, abs=5e-3)
