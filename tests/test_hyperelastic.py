"""The continuum at finite strain: its forces are those of its energy, and it tends to the law of small strains."""

from __future__ import annotations

import numpy as np
import pytest

from taichi_disk import theory
from taichi_disk.lattice import disk_lattice
from taichi_disk.newton import compress, laid_down, lowest_lie
from taichi_disk.study import small_strain
from taichi_disk.study.finite_elements import Triangles, ring_points
from taichi_disk.study.hyperelastic import POISSON, _springs, finite_compression


def test_forces_and_their_slope_are_derivatives_of_the_springs_energy():
    mesh = Triangles(ring_points(4)[0])
    rng = np.random.default_rng(1)
    u, way = 0.1 * rng.standard_normal((2, *mesh.points.shape))
    angle = np.linspace(0.0, np.pi, 12, endpoint=False)
    directions = np.stack([np.cos(angle), np.sin(angle)])

    def energy(t):
        gradient = np.eye(2) + np.einsum("tni,tnj->tij", (u + t * way)[mesh.corners], mesh.slopes)
        stretch = np.linalg.norm(gradient @ directions, axis=1) - 1.0
        return 0.5 * 3.0 * 1.1 * float(mesh.area @ (stretch**2).mean(axis=1))

    force, tangent = _springs(mesh, u, 1.1)
    assert np.sum(force * way) == pytest.approx((energy(1e-5) - energy(-1e-5)) / 2e-5, rel=1e-7)
    ahead, behind = (_springs(mesh, u + t * way, 1.1)[0] for t in (1e-5, -1e-5))
    np.testing.assert_allclose(tangent @ way.ravel(), (ahead - behind).ravel() / 2e-5, rtol=1e-6, atol=1e-7)


def test_at_small_strain_it_is_the_elastic_disk_of_the_exact_law():
    mesh = Triangles(ring_points(3)[0])
    small = _springs(mesh, np.zeros_like(mesh.points), 1.1)[1]
    np.testing.assert_allclose(small.toarray(), mesh.stiffness(1.1, POISSON).toarray(), atol=1e-12)
    assert finite_compression(1e-6, 1.1) == pytest.approx(float(theory.exact_compression(1e-6, 1.1, POISSON)), rel=1e-4)


@pytest.mark.validate
def test_a_strained_lattice_exceeds_the_same_lattice_at_small_strain_as_the_continuum_does(monkeypatch):
    a, excess = 1e5, []
    for seed in range(2):
        for pressure in (4e-3, 1e-2):
            disk = disk_lattice(4400, seed)
            angle = lowest_lie(disk, 1.0, a, pressure)
            laid = laid_down(disk, angle, a, 0.5 * a, pressure)
            rest = compress(laid, 1.0, 0.0, a, 0.5 * a, pressure, start=laid.positions)
            unloaded, loaded = laid_down(laid, rest.roll, a, 0.5 * a, pressure).positions[:, 1], rest.positions[:, 1]
            xi = (unloaded.mean() - unloaded.min()) - (loaded.mean() - loaded.min())
            # On the place where the strained disk came to rest.
            monkeypatch.setattr(small_strain, "lowest_lie", lambda *_, at=angle + rest.roll: at)
            excess.append(xi / small_strain.hard_compression(disk, 1.0, [pressure])[0] - 1.0)
    law = [finite_compression(P, 1.1) / float(theory.exact_compression(P, 1.1, POISSON)) - 1.0 for P in (4e-3, 1e-2)]
    assert law == pytest.approx([0.0127, 0.0227], abs=3e-4)
    assert np.reshape(excess, (2, 2)).mean(axis=0) == pytest.approx(law, abs=3e-3)
