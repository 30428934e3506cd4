"""Fields of a state, against elasticity, the virial and rigid motion."""

from dataclasses import replace

import bodies
import numpy as np
import pytest
from scipy.spatial.distance import pdist, squareform

from taichi_disk.mechanics.fields import (
    QUANTITIES,
    Triangles,
    at_points,
    field,
    fringes,
    point_stress,
    stress,
)
from taichi_disk.mechanics.lattice import Lattice, with_wall
from taichi_disk.mechanics.physics import Springs
from taichi_disk.pictures.render.painter import Painter

SPRINGS = Springs(1.3, 0.4)
DISK = Lattice.disk(300, 1)
DISK_MESH = Triangles(DISK)
# Moduli of the perfect triangular lattice with k_a = 1.
YOUNG = 2.0 / np.sqrt(3.0)
POISSON = 1.0 / 3.0


def shaken(lattice, seed=0):
    """Positions and velocities far from any equilibrium, with no triangle turned."""
    x, v = bodies.shaken(lattice, seed, 0.08 * float(np.median(lattice.rest_lengths)))
    return x + [0.3, 1.02], v


X, V = shaken(DISK)


RINGS = 6
PATCH = bodies.hexagon(RINGS)
PATCH_DISTANCES = squareform(pdist(PATCH.positions))
# all pairs of first and second neighbours: springs that cross triangles
CROSSED = Lattice.from_points(
    PATCH.positions,
    np.argwhere(np.triu(PATCH_DISTANCES < 1.8 / RINGS, 1)),
    triangles=PATCH.triangles,
)
MESH = Triangles(PATCH)
# triangles without a corner on the outline, whose springs belong to two triangles
INSIDE = ~np.isin(PATCH.triangles, np.unique(MESH.outline)).any(axis=1)


def strained(xx, yy, xy):
    return PATCH.positions @ np.array([[1.0 + xx, xy], [xy, 1.0 + yy]])


def test_springs_that_cross_triangles_and_the_edge_of_a_core_are_reported():
    more = len(CROSSED.bonds) - len(PATCH.bonds)
    assert len(Triangles(CROSSED).crossing) == more > 0.5 * len(PATCH.bonds)
    assert not len(MESH.crossing) + len(MESH.interfaces)
    core = Lattice.disk(300, 0, core_radius=0.5, core_stiffness=3.0)
    edge = Triangles(core).interfaces
    assert np.hypot(*core.positions[edge].T) == pytest.approx(0.5, abs=1e-9)
    # a closed line
    assert np.unique(edge, return_counts=True)[1].tolist() == [2] * len(edge)
    graded = replace(core, stiffness=1.0 + np.arange(len(core.bonds)) / len(core.bonds))
    assert not len(Triangles(graded).interfaces)


# ---- stress


def test_a_perfect_lattice_has_young_s_modulus_2_over_root_3_and_poisson_s_ratio_1_3():
    size = 1e-7
    k_a = 1.7
    strains = strained(size, 0, 0), strained(0, 0, size)
    both = [stress(MESH, Springs(k_a), x)[INSIDE] / size for x in strains]
    # uniform, like the strain
    assert max(np.ptp(values, axis=0).max() for values in both) < 1e-6
    (along, across, turned), (_, _, sideways) = (values.mean(axis=0) for values in both)
    assert turned == pytest.approx(0.0, abs=1e-6)
    assert across / along == pytest.approx(POISSON, rel=1e-6)  # plane stress: C12/C11
    assert along * (1.0 - POISSON**2) == pytest.approx(YOUNG * k_a, rel=1e-6)
    # 2 G e_xy
    assert sideways == pytest.approx(YOUNG * k_a / (1.0 + POISSON), rel=1e-6)


BODIES = {
    "disk": DISK,
    "disk and wall": with_wall(DISK, 260, 3.0, 0),
    "literal disk": Lattice.disk(300, 2, rim=False, min_spacing=0.0),
    "crossed": CROSSED,
}


@pytest.mark.parametrize("body", BODIES)
def test_the_integral_of_the_stress_is_minus_the_virial_of_the_springs_forces(body):
    lattice = BODIES[body]
    x, _ = shaken(lattice)
    triangles = Triangles(lattice)
    total = (triangles.areas(x)[:, None] * stress(triangles, SPRINGS, x)).sum(axis=0)
    forces = SPRINGS.forces(lattice, x)
    virial = x.T @ forces
    rounding = 1e-13 * (np.abs(x.T) @ np.abs(forces)).max()
    assert np.abs(total + [virial[0, 0], virial[1, 1], virial[1, 0]]).max() < rounding


def test_pressure_and_shear_are_the_invariants_of_the_stress():
    xx, yy, xy = stress(DISK_MESH, SPRINGS, X).T
    low, high = np.linalg.eigvalsh(np.array([[xx, xy], [xy, yy]]).transpose(2, 0, 1)).T
    invariants = {"pressure": -0.5 * (low + high), "shear": 0.5 * (high - low)}
    for name, values in invariants.items():
        found = field(name, DISK, SPRINGS, X, V).values
        assert found == pytest.approx(values, abs=1e-14)


def test_a_squeezed_disk_is_under_pressure_and_a_resting_one_has_no_field():
    v = np.zeros_like(DISK.positions)
    assert field("pressure", DISK, SPRINGS, 0.99 * DISK.positions, v).values.min() > 0.0
    for name in QUANTITIES:
        values = at_points(name, DISK_MESH, SPRINGS, DISK.positions, v)
        assert np.abs(values).max() < 1e-14


def test_a_triangle_folded_flat_has_a_finite_stress_and_a_tenth_of_its_area():
    x = X.copy()
    a, b, c = DISK.triangles[7]
    unloaded = DISK.positions[[a, b, c]]
    x[[a, b, c]] = unloaded
    x[a] = 0.5 * (x[b] + x[c])
    area = 0.5 * np.linalg.det(unloaded[1:] - unloaded[0])
    assert DISK_MESH.areas(x)[7] == pytest.approx(0.1 * area, rel=1e-12)
    for name in QUANTITIES:
        assert np.isfinite(field(name, DISK, SPRINGS, x, V).values).all()


def test_point_values_are_means_weighted_with_the_areas():
    sigma = stress(DISK_MESH, SPRINGS, X)
    areas = DISK_MESH.areas(X)
    i = 17
    around = (DISK.triangles == i).any(axis=1)
    mean = np.average(sigma[around], axis=0, weights=areas[around])
    assert point_stress(DISK_MESH, SPRINGS, X)[i] == pytest.approx(mean, rel=1e-12)
    strain = SPRINGS.strain(DISK, X)[(DISK.bonds == i).any(axis=1)]
    means = {"pressure": -0.5 * (mean[0] + mean[1]), "strain": strain.mean()}
    for name, value in means.items():
        found = at_points(name, DISK_MESH, SPRINGS, X, V)
        assert found[i] == pytest.approx(value, rel=1e-12)


# ---- motion


def test_the_rate_of_compression_is_minus_the_divergence_of_the_velocity():
    gradient = np.array([[0.3, 0.9], [-0.2, -0.5]])  # v_i = sum of x_k gradient[k, i]
    rate = field("rate", DISK, SPRINGS, X, X @ gradient + [1.0, 2.0])
    assert rate.values == pytest.approx(np.full(len(DISK.triangles), 0.2), rel=1e-10)


def test_speed_and_kinetic_energy_are_those_in_the_frame_of_the_disk_s_centre_of_mass():
    graded = replace(DISK, masses=DISK.masses * np.linspace(0.5, 1.5, 300))
    lattice = with_wall(graded, 260, 3.0, 0)
    x, v = shaken(lattice)
    # König's theorem: the kinetic energy is that relative to the centre of mass plus
    # that of the centre of mass.
    m = lattice.masses[:300, None]
    mv = (m * v[:300]).sum(axis=0)
    whole = 0.5 * float((m * v[:300] ** 2).sum())
    inner = field("kinetic", lattice, SPRINGS, x, v).values[:300].sum()
    assert inner == pytest.approx(whole - 0.5 * float(mv @ mv) / m.sum(), rel=1e-12)
    speed = field("speed", lattice, SPRINGS, x, v).values
    assert speed[300:] == pytest.approx(np.hypot(*v[300:].T), rel=1e-14)


# ---- fringes


def test_fringes_follow_the_difference_of_the_principal_stresses():
    middle = np.hypot(*(PATCH.positions - PATCH.positions.mean(axis=0)).T) < 0.3
    for order, bright in ((0.0, 0.0), (0.5, 1.0), (1.0, 0.0), (1.25, 0.5), (2.5, 1.0)):
        fringe = 1e-4
        x = strained(0.0, 0.0, 0.5 * order * fringe * (1.0 + POISSON) / YOUNG)
        difference = at_points("fringes", MESH, Springs(1.0), x, np.zeros_like(x))
        light = np.sin(np.pi * difference / fringe) ** 2
        assert light[middle] == pytest.approx(bright, abs=2e-3)
    # five fringes up to the largest difference
    difference = np.array([0.0, 0.06, 0.12, 0.15, 0.6])
    assert fringes(difference) == pytest.approx([0.0, 1.0, 0.0, 0.5, 0.0], abs=1e-12)


def test_smoothing_keeps_uniform_values_and_averages_neighbours():
    uniform = np.full((300, 2), 0.7)
    assert DISK_MESH.smoothed(uniform, 5) == pytest.approx(uniform, rel=1e-14)
    values = np.random.default_rng(0).random((300, 1))
    i = 40
    mean = values[np.unique(DISK.bonds[(DISK.bonds == i).any(axis=1)])].mean()
    assert DISK_MESH.smoothed(values, 1)[i, 0] == pytest.approx(mean, rel=1e-14)


@pytest.mark.parametrize("rings", [20, 30])
def test_fringes_show_stress_smoothed_to_a_width_of_0_06_r_whatever_the_spacing(rings):
    # Half of the lattice is shifted, so a row of triangles is in pure shear.
    lattice = bodies.hexagon(rings)
    spacing = 1.0 / rings
    x = lattice.positions.copy()
    rows = np.round(x[:, 1] / (np.sqrt(0.75) * spacing)).astype(int)
    x[rows > 0, 0] += 1e-6
    light = at_points("fringes", Triangles(lattice), Springs(1.0), x, np.zeros_like(x))
    near = np.abs(x[:, 0]) < 0.6 * spacing
    weight = light[near]
    height = (rows[near] - 0.5) * np.sqrt(0.75) * spacing
    # The points on either side of that row are half of its height away from its middle.
    width2 = np.average(height**2, weights=weight) - 3.0 / 16.0 * spacing**2
    # Averages (over six neighbours and the point) are whole: the width may be half off.
    assert width2 == pytest.approx(0.06**2, abs=0.51 * 3.0 / 7.0 * spacing**2)
    assert np.average(height, weights=weight) == pytest.approx(0.0, abs=0.01 * spacing)


# ---- the mesh


def test_every_spring_of_a_lattice_is_carried_by_one_or_two_triangles():
    assert set(DISK_MESH.fraction) == {0.5, 1.0}
    alone = (DISK_MESH.fraction == 1.0).sum()
    assert alone == len(DISK_MESH.outline) == len(DISK.disk_surface)
    # The outline has the body on its left: its polygon's area is that of all triangles.
    a, b = DISK.positions[DISK_MESH.outline].transpose(1, 0, 2)
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
    assert area == pytest.approx(DISK_MESH.areas(DISK.positions).sum(), rel=1e-12)


def test_a_field_says_where_it_lives_and_in_which_unit():
    count = {"triangles": len(DISK.triangles), "springs": len(DISK.bonds)}
    count["points"] = 300
    for name, quantity in QUANTITIES.items():
        found = field(name, DISK, SPRINGS, X, V)
        assert found.values.shape == (count[found.on],)
        assert found.unit == quantity.unit
        assert quantity.signed or found.values.min() >= 0.0


@pytest.mark.parametrize("colour", QUANTITIES)
def test_a_vibration_shown_3_times_stronger_has_the_colours_of_a_larger_one(colour):
    rest = DISK.positions
    painter = Painter(DISK, SPRINGS, colour=colour)

    def colours(ringing, factor):
        x = rest + factor * 1e-3 * np.sin(3.0 * rest[:, ::-1])
        v = factor * 1e-3 * np.cos(4.0 * rest)
        return painter.values(x, v, ringing)

    expected = colours(1.0, 3.0)
    change = expected - colours(1.0, 0.0)
    assert np.abs(colours(3.0, 1.0) - expected).max() < 0.03 * np.abs(change).max()
