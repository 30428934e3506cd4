"""Small bodies, models and runs of several test modules. Each kind of model is compiled
once per integrator and process: use one from here if it fits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from taichi_disk.experiments.computation.driver import Driver
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.computation.stability import spectrum
from taichi_disk.experiments.computation.step_control import StepControl
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.mechanics.fields import Triangles
from taichi_disk.mechanics.integrators import Integrator
from taichi_disk.mechanics.lattice import Lattice, with_wall
from taichi_disk.mechanics.lattice.lattice import double_area, polygon_area
from taichi_disk.mechanics.physics import (
    ElasticWall,
    ExponentialWall,
    Load,
    MatchedBoundary,
    Model,
    PinnedBoundary,
    ResetBoundary,
    Springs,
)
from taichi_disk.mechanics.simulation.observables import as_columns
from taichi_disk.pictures.render.painter import Painter

A = 300.0
V0 = 150.0
RIGID = ExponentialWall(A, V0)
ELASTIC = ElasticWall(A, V0, 0.1)
RESET = 0.12  # time between two resets of a boundary [R/c]
FREE = Model(Springs())
FALLING = Model(Springs(1.0, 1.0), RIGID)  # no dashpots

# a composition of several kicks and moves, as a user may write it: I. P. Omelyan, I. M.
# Mryglod and R. Folk, Comput. Phys. Commun. 146, 188 (2002)
_XI = 0.1644986515575760
_LAMBDA = -0.02094333910398989
_CHI = 1.235692651138917
_OUTER = 0.5 * (1.0 - 2.0 * _LAMBDA)
FOUR_FORCES = Integrator(
    "four_forces",
    4,
    kicks=(_XI, _CHI, 1.0 - 2.0 * (_CHI + _XI), _CHI, _XI),
    moves=(_OUTER, _LAMBDA, _LAMBDA, _OUTER),
    stable=3.4696,
    dashpots="none",
)

# The largest step goes with 1/sqrt(N). At N = 150 this safety gives the automatic step
# of 1099 points, about 0.017 R/c, for which bounds on errors are stated.
SMALL = ("lattice.points=150", "time.safety=0.3")
WALL = (*SMALL, "wall.points=180", "wall.width=3.4")


def damped(eta, k_b=1.0):
    return Model(Springs(1.0, k_b, eta), RIGID)


def pressed(load, eta=0.0, k_b=1.0, wall=RIGID):
    return Model(Springs(1.0, k_b, eta), wall, Load(load))


def disk(points=100, seed=0, height=None):
    """Return a disk, with its lowest point at y = `height` if that is given."""
    lattice = Lattice.disk(points, seed)
    lift = 0.0 if height is None else height - lattice.positions[:, 1].min()
    return replace(lattice, positions=lattice.positions + np.array([0.0, lift]))


def disk_and_wall(points=100, wall=120, height=0.03):
    lattice = with_wall(Lattice.disk(points, 0), wall, 3.0, 0)
    lattice.positions[:points, 1] += height
    return lattice


def painter(**attributes):
    """Return a painter of a disk above a rigid wall, with some `attributes`."""
    made = Painter(disk(60, height=0.05), Springs(), RIGID)
    vars(made).update(
        {"colour": "pressure", "limit": 0.02, "full_force": 0.01, "edge": 0.03}
        | attributes
    )
    return made


def hexagon(rings):
    """Return a patch of the triangular lattice, 1 R from its centre to a corner."""
    steps = np.arange(-rings, rings + 1)
    i, j = np.meshgrid(steps, steps)
    is_inside = np.abs(i + j) <= rings
    points = np.stack([i + 0.5 * j, np.sqrt(0.75) * j], axis=-1)[is_inside]
    return Lattice.from_points(points / rings)


def changed(array, place, value):
    """Return the array with another value at one place."""
    array = array.copy()
    array[place] = value
    return array


def assert_tiles(positions, triangles, outline):
    """Check that the triangles, all counter-clockwise, just fill the outline."""
    area = 0.5 * double_area(positions[triangles])
    assert area.min() > 0
    assert area.sum() == pytest.approx(polygon_area(positions[outline]), rel=1e-9)
    assert len(triangles) == 2 * len(np.unique(triangles)) - 2 - len(outline)  # Euler


def holes_of(lattice):
    """Return the areas [R^2] of the holes: outer sides, except the outline."""
    side = Triangles(lattice).outline
    _, part = connected_components(
        coo_matrix((np.ones(len(side)), side.T), shape=2 * [len(lattice.masses)])
    )
    rings = [part[lattice.disk_surface[0]]]
    x = lattice.positions
    inner = side[~np.isin(part[side[:, 0]], rings)]
    cross = (
        x[inner[:, 0], 0] * x[inner[:, 1], 1] - x[inner[:, 0], 1] * x[inner[:, 1], 0]
    )
    return [
        -0.5 * cross[part[inner[:, 0]] == number].sum()
        for number in np.unique(part[inner[:, 0]])
    ]


def shaken(lattice, seed, amplitude):
    """Return the lattice's points displaced at random, and velocities of some 0.1 c."""
    rng = np.random.default_rng(seed)
    shape = lattice.positions.shape
    return lattice.positions + amplitude * rng.uniform(
        -1, 1, shape
    ), 0.1 * rng.standard_normal(shape)


def moving_down(lattice, speed):
    """Return velocities (n, 2): -`speed` in y for the disk, 0 for a wall."""
    v = np.zeros_like(lattice.positions)
    v[: lattice.disk_points, 1] = -speed
    return v


def non_uniform(lattice, least=0.8, most=1.25):
    """Return the lattice with random masses of the disk and random stiffness."""
    rng = np.random.default_rng(7)
    n = lattice.disk_points
    masses = lattice.masses.copy()
    masses[:n] *= rng.uniform(least, most, n)
    masses[:n] /= masses[:n].sum()
    return replace(
        lattice, masses=masses, stiffness=rng.uniform(least, most, len(lattice.bonds))
    )


def bouncing(scene, points, eta, height=0.05):
    """Return lattice, velocities and model of a disk just above a wall."""
    if scene.startswith("non-uniform "):
        lattice, velocities, model = bouncing(
            scene.removeprefix("non-uniform "), points, eta, height
        )
        return non_uniform(lattice), velocities, model
    speed = 0.05
    if scene == "compression":
        lattice = disk(points, height=0.045)
        speed = 0.0
        model = pressed(0.05, eta)
    elif scene == "rigid":
        lattice = disk(points, height=height)
        model = damped(eta)
    else:
        lattice = disk_and_wall(points, points + 20, height)
        boundary = {
            "matched": matched(lattice),
            "reset": ResetBoundary(RESET),
            "pinned": PinnedBoundary(),
        }[scene]
        model = Model(Springs(1.0, 1.0, eta), ELASTIC, boundary=boundary)
    return lattice, moving_down(lattice, speed), model


def matched(lattice):
    """Return plausible, unequal dashpots for the wall's boundary."""
    return MatchedBoundary(
        np.random.default_rng(5).uniform(0.02, 0.05, (len(lattice.wall_boundary), 2))
    )


def advance(simulation, steps, stride=1):
    """Return the time series of `steps` more steps; the first begins at t = 0."""
    first = simulation.first_row[None][: int(simulation.step_number == 0)]
    start = simulation.time
    interval = stride * simulation.dt
    columns = as_columns(
        np.concatenate([first, simulation.advance(steps, stride)[0]]), interval
    )
    return columns | {"t": start + columns["t"]}


def to_pixels(camera, xy):
    """Return (column, row) [px] of points (..., 2) [R], as GGUI gets them."""
    factor, shift = camera.canvas_map()
    return (factor * np.asarray(xy) + shift - [0.0, 1.0]) * [
        camera.width,
        -camera.height,
    ]


def words(text):
    """Return the arguments of a scene that is written as on the command line."""
    return text.split()


def computed(kernels, name, *settings, **options):
    """Return scenario and outcome of a shipped scene with some `settings`."""
    scene = load_scene(name, settings)
    scenario = scene.scenario()
    return scenario, compute(scenario, **options)


def driver_of(kernels, name, *settings, **options):
    """Return a driver at the start of a shipped scene with some `settings`."""
    control = control_of(name, *settings, **options)
    return Driver(control.scenario, control.step)


def drivers_of(kernels, name, *settings):
    """Return the drivers of all runs of a shipped scene, the last of them finished."""
    control = control_of(name, *settings)
    drivers = []
    while not drivers or control.shortens(drivers[-1]):
        drivers.append(Driver(control.scenario, control.step))
        drivers[-1].advance()
    return drivers


def control_of(name, *settings, **options):
    """Return the step control of a shipped scene with some `settings`."""
    scenario = load_scene(name, settings).scenario()
    return StepControl(scenario, spectrum(scenario.lattice, scenario.model), **options)
