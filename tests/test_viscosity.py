"""tau0 of the lattice against the decay of a simulated vibration and against a closed form."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from taichi_disk.lattice import disk_lattice
from taichi_disk.stiffness import tangent_stiffness
from taichi_disk.study.viscosity import lowest_mode, measured_viscosity

NU = 0.285


def test_the_lowest_mode_decays_as_its_viscosity_says(taichi: None) -> None:
    from taichi_disk.model.observables import COLUMNS
    from taichi_disk.model.physics import Physics
    from taichi_disk.model.world import World

    disk, eta_star = disk_lattice(60, 0), 0.5
    springs = tangent_stiffness(disk.positions, disk.bonds, disk.rest_lengths, 1.0, 0.0)
    mode = lowest_mode(disk, springs)
    omega = math.sqrt(60.0 * float(mode.ravel() @ (springs @ mode.ravel())))
    tau0 = eta_star * measured_viscosity(0, NU, points=60).lowest_mode
    moved = replace(disk, positions=disk.positions + 1e-4 * mode)
    world = World(moved, Physics(eta=eta_star / 60), np.zeros((1, 60, 2)), dt=0.01)
    periods = 4
    rows = world.advance(periods, round(2 * math.pi / omega / 0.01))[:, :, 0]
    energy = rows[:, COLUMNS.index("kinetic")] + rows[:, COLUMNS.index("elastic")]
    # q'' = -w^2 q - w^2 tau0 q': the energy falls as exp(-w^2 tau0 t). The mode is not quite one of the dashpots.
    decay = -np.log(energy[-1] / energy[0]) / ((periods - 1) * 2 * math.pi / omega)
    assert decay == pytest.approx(omega**2 * tau0, rel=0.02)


def test_a_uniform_stretch_is_damped_as_a_homogeneous_sheet() -> None:
    # n springs per area of mean square length l^2 lose eta n l^2/2 |grad v|^2: with the triangular lattice's
    # n l^2 = 2 sqrt(3), tau0 = sqrt(3) eta (1 + nu^2)/E. Random lattices differ by some per cent, and so does the rim.
    found = measured_viscosity(0, NU).stretch
    assert found == pytest.approx(math.sqrt(3) * (1 + NU**2) / 1.1 / 1099, rel=0.1)


def test_a_disk_s_contact_is_damped_more_than_a_stretch() -> None:
    # Shear and local rotation, which the vector dashpots resist, are large beside a contact.
    viscosity = measured_viscosity(0, NU, points=200)
    assert viscosity.contact > 1.5 * viscosity.stretch
