"""Rings, cores and non-uniform bodies, against closed forms and dense matrices."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bodies import FREE, disk, non_uniform, pressed, shaken
from numpy.testing import assert_allclose

from taichi_disk import run
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.mechanics.fields import Triangles, stress
from taichi_disk.mechanics.integrators import VELOCITY_VERLET
from taichi_disk.mechanics.lattice import Lattice, bulk_moduli
from taichi_disk.mechanics.simulation.observables import INDEX
from taichi_disk.mechanics.statics.equilibrium import solve_equilibrium
from taichi_disk.runs.output.arrays import write_lattice


def test_observables_are_weighted_with_mass(kernels):
    lattice = non_uniform(disk(60, height=0.03), 0.2, 3.0)
    x, v = shaken(lattice, 1, 0.01)
    m = lattice.masses
    moved = replace(lattice, positions=x)
    laws = pressed(0.02, 0.3)
    row = kernels.simulation(moved, laws, VELOCITY_VERLET, v, 1e-3).first_row
    centre = m @ x
    flight = m @ v
    arm = x - centre
    own = v - flight
    spin = np.sum(m * (arm[:, 0] * own[:, 1] - arm[:, 1] * own[:, 0]))
    names = "com_x", "com_y", "com_vx", "com_vy", "angular_momentum", "kinetic", "load"
    found = [row[INDEX[name]] for name in names]
    kinetic = 0.5 * m @ np.sum(v**2, axis=1)
    expected = [*centre, *flight, spin, kinetic, 0.02 * centre[1]]
    assert_allclose(found, expected, rtol=1e-11)
    assert np.abs(lattice.mean(x) - x.mean(axis=0)).max() > 1e-3


def test_the_compression_of_a_non_uniform_body_counts_from_its_centre_of_mass(kernels):
    # The load, too, acts in proportion to mass: at rest it is borne below that centre.
    settings = ["compression.method=newton", "compression.pressure=0.02"]
    scenario = load_scene("compression", settings).scenario(
        non_uniform(disk(100), 0.2, 3.0)
    )
    outcome = compute(scenario)
    m = scenario.lattice.masses
    x = outcome.positions
    unloaded = scenario.lattice.positions
    heights = [m @ y - y.min() for y in (unloaded[:, 1], x[:, 1])]
    xi = scenario.result(outcome.series)["xi"]
    assert xi == pytest.approx(heights[0] - heights[1], rel=1e-9)
    push = scenario.model.wall.forces(scenario.lattice, x)[:, 1]
    assert push.sum() == pytest.approx(0.02, rel=1e-9)
    assert m @ x[:, 0] == pytest.approx(push @ x[:, 0] / 0.02, abs=1e-9)
    assert abs(x[:, 0].mean() - m @ x[:, 0]) > 1e-3


def test_a_ring_under_its_own_weight_sinks_as_the_thin_ring_does():
    # An inextensible ring of radius r, load P as its own weight, on a rigid plane
    # (after Timoshenko, Strength of Materials II): with the tangential displacement
    # sum(a_n sin n phi) the bending energy is
    # pi EI/(2 r^3) sum(n^2 (n^2 - 1)^2 a_n^2) and the work of the load P sum(n a_n),
    # which is also P xi. So
    # xi = P r^3/(pi EI) sum_(n > 1) 1/(n^2 - 1)^2 = P r^3/(pi EI) (pi^2/12 - 11/16).
    # Two opposite forces: twice the even n give Timoshenko's (pi/4 - 2/pi) P r^3/EI.
    twice_even = [4.0 / np.pi / (n * n - 1.0) ** 2 for n in range(2, 400, 2)]
    assert sum(twice_even) == pytest.approx(np.pi / 4 - 2 / np.pi)
    hole = 0.9
    load = 1e-7
    settings = ["compression.method=newton", "material.k_b=0"]
    settings.append(f"compression.pressure={load}")
    ring = Lattice.disk(3000, 0, hole=hole)
    scenario = load_scene("compression", settings).scenario(ring)
    lattice = scenario.lattice
    heights = [
        lattice.mean(positions)[1] - positions[:, 1].min()
        for positions in (lattice.positions, scenario.rest.positions)
    ]
    thick = 1.0 - hole
    r = 0.5 * (1.0 + hole)
    bending = bulk_moduli(3000, 0, 1.0, 0.7).young * thick**3 / 12.0
    # A skin of half a spring more on either side, thick/2 from the middle: a spring of
    # the outline is as stiff as the others, but stands for one triangle, not for two.
    bending += np.median(lattice.rest_lengths) * (0.5 * thick) ** 2
    thin = load * r**3 / (np.pi * bending) * (np.pi**2 / 12.0 - 11.0 / 16.0)
    assert np.ptp(heights) == pytest.approx(thin, rel=0.05)


@pytest.mark.validate
@pytest.mark.parametrize("velocity", [0.01, 0.02, 0.05])
def test_a_circle_as_an_outline_is_the_disk(tmp_path, velocity):
    circle = tmp_path / "circle.svg"
    circle.write_text('<svg xmlns="http://www.w3.org/2000/svg"><circle r="7"/></svg>')
    scene = load_scene("exponential_wall").with_(velocity=velocity)
    means = []
    halves = []
    for one in (scene, scene.with_(outline=str(circle))):
        sample = run(one, lattices=8).summary["lattices"]["restitution"]
        means.append(sample["mean"])
        halves.append(np.ptp(sample["interval_95"]) / 2.0)
    assert abs(means[1] - means[0]) < np.hypot(*halves)
    assert halves[1] < 3.0 * halves[0]


def test_a_core_too_large_for_its_place_is_pressed_and_the_ring_around_it_pulled():
    # Lame, plane stress: a core of radius a with a misfit strain s and the modulus f E
    # in a ring of modulus E has the pressure p = s E/((1 - nu)/f + ((1 - nu) a^2 + 1 +
    # nu)/(1 - a^2)). The radial stress is continuous at a, the hoop stress jumps from
    # -p to p (1 + a^2)/(1 - a^2).
    a = 0.5
    f = 4.0
    misfit = 1e-4
    points = 3000
    lattice = Lattice.disk(points, 0, core_radius=a, core_stiffness=f)
    # A spring of the outline stands for one triangle, not for two, as in a sheet.
    outer = np.where(Triangles(lattice).fraction == 1.0, 0.5, 1.0)
    lattice = replace(lattice, stiffness=lattice.stiffened(outer))
    # of a spring that is the core's
    part = {1.0: 0.0, 0.5: 0.0, f: 1.0, 0.5 * (1.0 + f): f / (1.0 + f)}
    strain = misfit * np.array([part[spring] for spring in lattice.stiffness])
    strained = replace(lattice, rest_lengths=lattice.rest_lengths * (1.0 + strain))
    x = solve_equilibrium(strained, FREE, lattice.positions).positions
    moduli = bulk_moduli(points, 0, 1.0, 0.7)
    triangles = Triangles(strained)
    nu = moduli.poisson
    young = moduli.young
    across = (1.0 - nu) * a**2 + 1.0 + nu
    p = misfit * young / ((1.0 - nu) / f + across / (1.0 - a**2))
    share = p * a**2 / (1.0 - a**2)
    middle = x[triangles.triangles].mean(axis=1)
    areas = triangles.areas(x)
    sigma = stress(triangles, FREE.springs, x)
    r = np.hypot(*middle.T)
    c, s = middle.T / r
    radial = sigma[:, 0] * c * c + sigma[:, 1] * s * s + 2.0 * sigma[:, 2] * c * s
    hoop = sigma[:, 0] + sigma[:, 1] - radial
    means = []
    for low, high in ((0.1, 0.4), (0.4, 0.5), (0.5, 0.6), (0.6, 0.8)):
        ring = (r > low) & (r < high)
        means.append(
            [np.average(stress[ring], weights=areas[ring]) for stress in (radial, hoop)]
        )
        square = np.average(r[ring] ** -2.0, weights=areas[ring])
        expected = (-p, -p)
        if low >= a:
            expected = share * (1.0 - square), share * (1.0 + square)
        assert means[-1][0] == pytest.approx(expected[0], abs=0.05 * p)
        # springs of the edge carry the hoop stress of both sides
        if low == 0.1 or high == 0.8:
            assert means[-1][1] == pytest.approx(expected[1], abs=0.05 * p)
    assert means[2][1] - means[1][1] > 1.5 * p


CORE = {"lattice.core_radius": 0.6, "lattice.core_stiffness": 3.0}
ABSORBING = {"lattice.points": 100, "wall.points": 130, "impact.spin": 0.02}
REPEATED = {
    "spin": ("exponential_wall", {"lattice.points": 60, "impact.spin": 0.05}),
    "turned core": (
        "exponential_wall",
        {"lattice.points": 80, "impact.angle": 0.3, "impact.turn": 0.3, **CORE},
    ),
    "wall": ("absorbing_wall", {**ABSORBING, **CORE, "lattice.core_density": 2.0}),
    "compression": ("compression", {"lattice.points": 60}),
    "loading": ("compression", {"lattice.points": 60, "compression.method": "newton"}),
}


@pytest.mark.parametrize("name", REPEATED)
def test_a_scene_repeated_from_its_lattice_file_starts_the_same(tmp_path, name):
    kind, changes = REPEATED[name]
    scene = load_scene(kind).with_(changes)
    body = scene.body()
    first = scene.scenario(body)
    file = str(tmp_path / "lattice.npz")
    unloaded = body.positions[: body.disk_points]
    write_lattice(Path(file), first.lattice, first.velocities, unloaded)
    own = scene.with_({"lattice.file": file, "lattice.velocities": file})
    again = own.scenario()
    assert vars(again.lattice).keys() == vars(first.lattice).keys()
    for array, values in vars(first.lattice).items():
        assert np.array_equal(getattr(again.lattice, array), values)
    assert (again.velocities == first.velocities).all()
    for number in ("point_force", "max_time", "sample_interval", "view"):
        assert getattr(again, number) == getattr(first, number)
    assert again.scene.with_(lattice={"file": "none", "velocities": "none"}) == scene
