"""Moduli by the stretch test: of a perfect lattice exact, of random ones in range."""

import math

import numpy as np
import pytest

from taichi_disk.mechanics.lattice.lattice import triangulate
from taichi_disk.mechanics.lattice.network import bulk_moduli, inner_moduli, stretch


def test_perfect_triangular_lattice_has_the_textbook_moduli():
    # equal springs k: E = 2/sqrt(3) k, nu = 1/3; stretched along rows, a unit apart
    i, j = np.meshgrid(np.arange(16), np.arange(16), indexing="ij")
    mesh = triangulate(
        np.stack([i + 0.5 * (j % 2), j * math.sqrt(0.75)], axis=-1).reshape(-1, 2)
    )
    x = mesh.positions[:, 0]
    bulk = inner_moduli(mesh, 0.3, stretch(mesh, 0.3, x <= 0.5, x >= 15.0))
    assert (bulk.young, bulk.poisson) == pytest.approx(
        (2 / math.sqrt(3) * 0.3, 1 / 3), rel=1e-9
    )


@pytest.mark.parametrize(
    ("min_spacing", "young", "poisson"), [(0.0, 1.04, 0.26), (0.7, 1.10, 0.286)]
)
def test_random_lattice_has_moduli_in_the_known_range(min_spacing, young, poisson):
    samples = [bulk_moduli(1099, seed, 1.0, min_spacing) for seed in range(8)]
    assert np.mean([m.young for m in samples]) == pytest.approx(young, abs=0.03)
    assert np.mean([m.poisson for m in samples]) == pytest.approx(poisson, abs=0.01)
    # One sample of 1000 points scatters by a few per cent.
    assert np.std([m.young for m in samples]) < 0.06


def test_moduli_scale_with_the_springs_and_not_with_the_number_of_points():
    assert bulk_moduli(1099, 0, 2.5, 0.7).young == pytest.approx(
        2.5 * bulk_moduli(1099, 0, 1.0, 0.7).young
    )
    few, many = (
        np.mean([bulk_moduli(n, s, 1.0, 0.7).young for s in range(4)])
        for n in (300, 1000)
    )
    assert few == pytest.approx(many, rel=0.05)
    # small disks have moduli, too
    assert bulk_moduli(3, 0, 1.0, 0.7).young == pytest.approx(1.1, abs=0.15)
