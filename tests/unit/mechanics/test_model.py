"""A scene compiles only its laws, once for all lattices and parameters."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple, replace

import numpy as np
import pytest
from bodies import FALLING, disk, moving_down, words
from numpy.testing import assert_array_equal

from taichi_disk.base.engine import ti
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.mechanics.integrators import VELOCITY_VERLET
from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.physics import BodyForce, ExponentialWall, Load, Springs
from taichi_disk.mechanics.physics.law import Capacity
from taichi_disk.mechanics.physics.ordering import BLOCK
from taichi_disk.mechanics.simulation.observables import INDEX
from taichi_disk.mechanics.simulation.simulation import KernelCache, Simulation

VV = VELOCITY_VERLET


@pytest.fixture
def cache(kernels, monkeypatch):
    """Return a KernelCache whose programs for 60 points have no room for 130."""
    least = Capacity(60, 240 // BLOCK, 27 * 60)
    monkeypatch.setattr(
        "taichi_disk.mechanics.simulation.simulation.MIN_CAPACITY", least
    )
    return KernelCache()


def test_equal_springs_have_their_own_kernel_and_masses_need_no_other_kernel(kernels):
    lattice = disk(60, height=0.03)
    ones = np.ones(len(lattice.bonds))
    masses = lattice.masses * np.linspace(0.5, 1.5, 60)
    cases = {
        "plain": lattice,
        "stiff": replace(lattice, stiffness=ones),
        "heavy": replace(lattice, masses=masses),
    }
    rows = {}
    made = {}
    for name, body in cases.items():
        v = moving_down(body, 0.05)
        made[name] = kernels.simulation(body, FALLING, VV, v, 1e-3)
        rows[name] = made[name].advance(30, 3)[0]
    programs = {name: one.program for name, one in made.items()}
    assert programs["plain"] is programs["heavy"] is not programs["stiff"]
    assert_array_equal(rows["stiff"], rows["plain"])  # times 1
    assert not np.allclose(rows["heavy"], rows["plain"], rtol=1e-6)
    assert disk(60).stiffness is None
    for mass in (0.1, 3.0, 7.7):
        equal = Lattice.from_points(lattice.positions, masses=np.full(60, mass)).masses
        assert equal == pytest.approx(1.0 / 60, rel=1e-15)
        assert np.ptp(equal) == 0.0


@pytest.mark.parametrize(
    ("scene", "own"),
    [
        ("exponential_wall", ""),
        ("compression", "compression.pressure=0.03"),
        (
            "absorbing_wall",
            "wall.points=80 wall.width=3 wall.threshold=0.2 wall.reset_interval=0.004",
        ),
    ],
)
def test_the_numbers_of_a_scene_reach_its_laws(scene, own):
    numbers = """
        material.k_a=2 material.k_b=3 material.eta_star=12 material.dashpot=axial
        wall.a=200 wall.V0=70 lattice.points=60
    """
    model = load_scene(scene, words(numbers + own)).scenario().model
    assert astuple(model.springs) == (2.0, 3.0, 12.0 / 60, True)
    assert astuple(model.wall) == (200.0, 70.0, 0.2 if model.elastic else 0.0)
    force = 0.03 if scene == "compression" else None
    assert getattr(model.load, "force", None) == force
    assert model.reset_interval == (0.004 if scene == "absorbing_wall" else 0.0)


def test_a_lattice_with_other_rest_lengths_alone_is_another_lattice(kernels):
    lattice = disk(30, height=1.0)
    strained = replace(lattice, rest_lengths=1.01 * lattice.rest_lengths)
    for body in (lattice, strained):
        simulation = kernels.simulation(body, FALLING, VV, 0 * lattice.positions, 1e-3)
        force = simulation.snapshot().vectors[2]
        np.testing.assert_allclose(
            force, FALLING.forces(body, body.positions), rtol=0, atol=1e-15
        )
    assert np.abs(force).max() > 0.01


@ti.data_oriented
class FailingLaw(BodyForce):
    def make_fields(self, builder, capacity):
        self.extra = ti.field(float)
        builder.dense(ti.i, 5).place(self.extra)
        assert self.extra.dtype == ti.f64  # though Taichi's default is f32
        raise OSError("a slip")


@ti.data_oriented
class LawWithoutPlace(BodyForce):
    def make_fields(self, builder, capacity):
        self.extra = ti.field(ti.f64)


def test_after_laws_of_a_user_that_fail_other_laws_are_computed(kernels):
    lattice = disk(30, height=1.0)
    v = moving_down(lattice, 0.05)
    for law, message in ((FailingLaw(), "a slip"), (LawWithoutPlace(), "not placed")):
        with pytest.raises((OSError, RuntimeError), match=message):
            Simulation(lattice, replace(FALLING, others=(law,)), VV, v, 1e-3)
    other = replace(FALLING, others=(Load(1.0),))  # must be compiled
    row = Simulation(lattice, other, VV, v, 1e-3).advance(1)[0][-1]
    assert row[INDEX["com_vy"]] == pytest.approx(-0.05 - 1e-3)


@ti.kernel
def of_the_user(value: ti.i32) -> ti.i32:
    return value + 1


def test_simulations_of_one_program_move_as_each_does_alone(cache):
    # A larger lattice even takes the place of the program, after a kernel in a thread
    # of the user: Taichi then cannot delete fields that are older than the thread.
    bodies = [disk(60, height=0.03), disk(60, 1, height=0.05), disk(130)]

    def simulation(body):
        return cache.simulation(body, FALLING, VV, moving_down(body, 0.05), 1e-3)

    small = [simulation(body) for body in bodies[:2]]
    alone = [one.advance(40, 5)[0] for one in small]
    assert small[0].program is small[1].program
    with ThreadPoolExecutor(1) as thread:
        assert thread.submit(of_the_user, 1).result() == 2
    large = simulation(bodies[2])
    alone.append(large.advance(40, 5)[0])
    assert large.program is not small[1].program
    together = [simulation(body) for body in bodies]
    rows = [[one.advance(10, 5)[0] for one in together] for _ in range(4)]
    for k in range(3):
        assert_array_equal(np.concatenate([some[k] for some in rows]), alone[k])
    assert_array_equal(small[0].advance(10, 5)[0], together[0].advance(10, 5)[0])
    state = large.snapshot()
    with pytest.raises(ValueError, match="f64"):
        large.restore(replace(state, vectors=state.vectors.astype(np.float32)))


def test_a_law_that_a_scene_has_no_use_for_is_not_compiled():
    linear = replace(FALLING, springs=Springs(1.0)).signature()
    for springs in (Springs(1.0, 2.0), Springs(1.0, 0.0, 0.1)):
        assert replace(FALLING, springs=springs).signature() != linear
    again = replace(FALLING, springs=Springs(3.0), wall=ExponentialWall(50.0, 3.0))
    assert again.signature() == linear
    rough = replace(again, wall=ExponentialWall(50.0, 3.0, 0.1))
    assert rough.signature() != linear
