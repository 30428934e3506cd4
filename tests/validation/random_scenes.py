"""Random scenes by number. A number gives the same scene everywhere."""

import math
import re
from dataclasses import replace
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

from taichi_disk.base.errors import SimulationError
from taichi_disk.experiments.computation.diagnostics import MAX_IMBALANCE
from taichi_disk.experiments.scenes import load_scene

from .hard_cases import judge

BOUNDARIES = ("reset", "pinned", "dashpot")
CONTACTS = ("springs", "smooth")
# Few and small lattices, which many scenes share: points, seed, rim, min_spacing;
# points and width of the wall
WILD_LATTICES = (
    (3, 1, True, 0.7, 100, 8.0),
    (7, 2, False, 0.0, 60, 5.0),
    (20, 3, True, 0.7, 60, 3.0),
    (20, 4, False, 0.0, 60, 3.0),
    (50, 5, True, 0.4, 80, 2.5),
)
TRIAL_POINTS = (30, 60, 100, 200, 400)
SHARES = (0.35, 0.35, 0.2, 0.07, 0.03)  # how often each is drawn
# rim, min_spacing; the default is more frequent
TRIAL_LATTICES = (
    (True, 0.7),
    (True, 0.7),
    (True, 0.7),
    (True, 0.4),
    (True, 0.4),
    (False, 0.7),
    (False, 0.0),
)
KEY = re.compile(r"\b(lattice|material|wall|impact|compression|time)\.[a-z_0A-Z]+")
TOO_LONG = "too long"


class Scene(NamedTuple):
    """Name and settings of a scene, and a tolerance of its result. `aspect`: ratio of
    height to width of a custom body, or 0 for the body of the settings."""

    name: str
    settings: tuple[str, ...]
    tolerance: float = 0.0
    aspect: float = 0.0


class Draw:
    """The random numbers of scene `number` of a series."""

    def __init__(self, series, number):
        self.rng = np.random.default_rng([series, number])

    def between(self, low, high):
        """Return a number with a uniform logarithm, rounded to four digits."""
        return float(f"{np.exp(self.rng.uniform(np.log(low), np.log(high))):.4g}")

    def one_of(self, choices):
        return choices[self.rng.integers(len(choices))]

    def chance(self, probability):
        return bool(self.rng.random() < probability)

    def maybe(self, probability, low, high):
        """Return 0, or with `probability` a number as `between` does."""
        return self.between(low, high) if self.chance(probability) else 0.0

    def unless(self, probability, usual, low, high):
        """Return `usual` with `probability`, otherwise a number as `between` does."""
        return usual if self.chance(probability) else self.between(low, high)

    def spin(self):
        """Return a spin of 0.01 to 0.3 of either sign [c/R]."""
        return self.between(0.01, 0.3) * self.one_of((-1.0, 1.0))


def tolerance_of(number):
    """Return a tolerance from 1e-6 to 1e-3 for scene `number`."""
    return float(10.0 ** np.random.default_rng([number, 9]).uniform(-6.0, -3.0))


def wild_scene(number):
    """Return a scene that may use every key of a scene file: six decades of k_a, five
    of eta* and of hardness, twelve of V0, four of speed."""
    draw = Draw(20, number)
    rng = draw.rng
    points, seed, rim, spacing, wall_points, width = draw.one_of(WILD_LATTICES)
    kind = draw.one_of(("exponential_wall", "absorbing_wall", "compression"))
    eta_star = draw.maybe(0.6, 0.1, 1e4)
    a = draw.between(1.0, 1e5)
    V0 = draw.between(1e-6, 1e6)
    settings = [
        f"lattice.points={points}",
        f"lattice.seed={seed}",
        f"lattice.rim={str(rim).lower()}",
        f"lattice.min_spacing={spacing}",
        f"material.k_a={draw.between(1e-3, 1e3)}",
        f"material.eta_star={eta_star}",
        f"material.k_b={draw.maybe(0.5, 1e-6, 1e3)}",
        f"wall.a={a}",
        f"wall.V0={V0}",
        f"time.safety={rng.uniform(0.05, 1.0):.3f}",
    ]
    if kind == "compression":
        settings += [
            f"compression.pressure={draw.between(1e-5, 10.0)}",
            f"compression.tolerance={draw.between(1e-7, 1e-3)}",
            f"compression.method={draw.one_of(('newton', 'relaxation'))}",
        ]
    else:
        v = draw.between(1e-3, 10.0)
        settings.append(f"impact.velocity={v}")
    if kind == "absorbing_wall":
        # `reach` as in `reach_of`, but at least 0.1 / a
        reach = max(math.log(V0) - math.log(5e-6) - 2.0 * math.log(v), 0.1) / a
        settings += [
            f"wall.points={wall_points}",
            f"wall.width={width}",
            f"wall.reset_interval={draw.between(1e-3, 1.0)}",
            f"wall.threshold={min(max(reach * rng.uniform(1.01, 4.0), 1e-3), 1e3):.4g}",
            f"wall.boundary={draw.one_of(BOUNDARIES)}",
        ]
    undamped = kind == "exponential_wall" and eta_star == 0.0
    if undamped and rng.random() < 0.3:
        settings.append("time.integrator=takahashi_imada")
    return Scene(kind, tuple(settings))


def plain_scene(number):
    """Return a scene whose true result can be computed by other solvers.

    Impacts and compressions with N 30 to 400, v 2e-3 to 0.2, eta* 0 or 0.1 to 100, a 30
    to 3000, k_a 1 or 0.01 to 10, tolerances 1e-8 to 1e-3; rim and literal lattices; all
    boundaries of the elastic wall.
    """
    draw = Draw(33, number)
    rng = draw.rng
    kinds = ["exponential_wall", "absorbing_wall", "compression"]
    name = str(rng.choice(kinds, p=[0.5, 0.35, 0.15]))
    points = int(rng.choice(TRIAL_POINTS, p=SHARES))
    rim, spacing = draw.one_of(TRIAL_LATTICES)
    boundary = draw.one_of(BOUNDARIES)
    eta_star = draw.unless(0.4, 0.0, 0.1, 100.0)
    a = draw.between(30.0, 3000.0)
    v = draw.between(2e-3, 0.2)
    k_a = draw.unless(0.7, 1.0, 0.01, 10.0)
    settings = [
        f"lattice.points={points}",
        f"lattice.seed={rng.integers(10000)}",
        f"lattice.rim={str(rim).lower()}",
        f"lattice.min_spacing={spacing}",
        f"material.k_a={k_a}",
        f"wall.a={a}",
        f"wall.V0={0.5 * a}",
    ]
    tolerance = float(f"{draw.between(1e-8, 1e-3):.2g}")
    if name == "compression":
        pressure = k_a * draw.between(1e-3, 3e-2)
        settings += [
            f"material.eta_star={draw.between(20.0, 100.0)}",
            f"compression.pressure={pressure:.4g}",
        ]
        return Scene(name, tuple(settings), tolerance)
    settings += [f"material.eta_star={eta_star}", f"impact.velocity={v}"]
    if name == "absorbing_wall":
        threshold = max(reach_of(a, v) * rng.uniform(1.01, 3.0), 1e-3)
        settings += [
            f"wall.points={round(1.2 * points)}",
            "wall.width=3.0",
            f"wall.boundary={boundary}",
            f"wall.threshold={threshold:.4g}",
            f"wall.reset_interval={draw.between(0.03, 0.3)}",
        ]
    return Scene(name, tuple(settings), tolerance)


def feature_scene(number):
    """Return an impact with any features of bodies, throws and walls.

    N 30 to 400 with holes, cores and ellipses (`custom_body`), angles, spins, friction
    0.05 to 5, both dashpots, all boundaries and contacts of the elastic wall, v 5e-3 to
    0.2, a 30 to 3000.
    """
    draw = Draw(35, number)
    rng = draw.rng
    is_rigid = draw.chance(0.65)
    body = draw.one_of(("plain", "plain", "hole", "core", "custom"))
    points = int(rng.choice(TRIAL_POINTS, p=SHARES))
    if body in ("hole", "core"):
        points = max(points, 100)
    a = draw.between(30.0, 3000.0)
    v = draw.between(5e-3, 0.2)
    angle = 0.0
    if draw.chance(0.6):
        steepest = 1.3 if is_rigid else 0.6
        angle = float(f"{rng.uniform(-steepest, steepest):.4f}")
    spin = 0.0
    if draw.chance(0.4):
        spin = draw.spin()
    settings = [
        f"lattice.points={points}",
        f"lattice.seed={rng.integers(10000)}",
        f"impact.velocity={v}",
        f"wall.a={a}",
        f"wall.V0={0.5 * a}",
        f"impact.angle={angle}",
        f"impact.spin={spin}",
        f"impact.turn={rng.uniform(-3.14, 3.14):.4f}",
    ]
    eta_star = draw.unless(0.4, 0.0, 0.1, 100.0)
    if draw.chance(0.5):
        settings.append(f"material.viscosity={eta_star / points:.4g}")
    else:
        settings.append(f"material.eta_star={eta_star}")
    if eta_star > 0.0 and draw.chance(0.4):
        settings.append("material.dashpot=axial")
    if body == "hole":
        settings.append(f"lattice.hole={rng.uniform(0.3, 0.4):.3f}")
    if body == "core":
        settings += [
            f"lattice.core_radius={rng.uniform(0.4, 0.6):.3f}",
            f"lattice.core_stiffness={draw.between(0.3, 4.0)}",
            f"lattice.core_density={draw.between(0.3, 4.0)}",
        ]
    if is_rigid:
        name = "exponential_wall"
        settings.append(f"wall.friction={draw.maybe(0.6, 0.05, 5.0)}")
    else:
        name = "absorbing_wall"
        settings += [
            f"wall.points={3 * points}",
            "wall.width=8.0",
            f"wall.boundary={draw.one_of(BOUNDARIES)}",
            f"wall.threshold={max(1.5 * reach_of(a, v), 1e-3):.4g}",
            f"wall.reset_interval={draw.between(0.03, 0.3)}",
            f"wall.contact={draw.one_of(CONTACTS)}",
            f"wall.k_a={draw.between(0.5, 20.0)}",
        ]
    aspect = 0.0
    if body == "custom":
        aspect = float(rng.uniform(0.5, 1.0))
    return Scene(name, tuple(settings), tolerance_of(number), aspect)


def chaotic_scene(number):
    """Return an impact that is often chaotic: N 25 to 60 on a hard, soft-springed wall
    with resets, v 0.1 to 0.2, no dashpots."""
    draw = Draw(37, number)
    rng = draw.rng
    points = int(rng.integers(25, 60))
    a = draw.between(1000.0, 3000.0)
    v = draw.between(0.1, 0.2)
    settings = [
        f"lattice.seed={rng.integers(1000000)}",
        f"impact.velocity={v}",
        f"impact.spin={draw.spin()}",
        f"impact.offset={rng.uniform(0.0, 0.03):.4f}",
        f"wall.points={2 * points}",
        f"wall.threshold={max(1.5 * reach_of(a, v), 0.1):.4g}",
        f"wall.reset_interval={draw.between(0.005, 0.02)}",
        "wall.contact=smooth",
        f"wall.k_a={draw.between(0.2, 0.5)}",
    ]
    return reset_on_hard_wall(number, points, a, settings)


def reset_on_hard_wall(number, points, a, settings):
    """Return an undamped impact on an elastic wall that is reset."""
    common = ("wall.boundary=reset", "wall.width=3.6", "material.eta_star=0")
    own = (f"lattice.points={points}", f"wall.a={a}", f"wall.V0={0.5 * a}")
    return Scene("absorbing_wall", (*common, *own, *settings), tolerance_of(number))


def reset_scene(number):
    """Return an impact on a hard elastic wall, reset every 0.005 to 0.03 R/c: N 60 to
    90, v 0.03 to 0.07, a 1000 to 4000, the paper's contact in two of three."""
    draw = Draw(38, number)
    rng = draw.rng
    points = int(rng.integers(60, 91))
    a = draw.between(1000.0, 4000.0)
    contact = "smooth" if draw.chance(0.33) else "springs"
    settings = [
        f"lattice.seed={rng.integers(1000000)}",
        f"impact.velocity={draw.between(0.03, 0.07)}",
        f"impact.offset={rng.uniform(0.0, 0.04):.4f}",
        f"wall.points={round(2.2 * points)}",
        "wall.threshold=0.1",
        f"wall.contact={contact}",
        f"wall.k_a={draw.between(0.25, 0.6)}",
        f"wall.reset_interval={draw.between(0.005, 0.03)}",
    ]
    return reset_on_hard_wall(number, points, a, settings)


def reach_of(a, v):
    """Return the height [R] at which the wall has 1e-5 of the kinetic energy."""
    return (math.log(0.5 * a) - math.log(5e-6) - 2.0 * math.log(v)) / a


def custom_body(disk, aspect, seed):
    """Return an ellipse of a disk's lattice with masses and springs unequal."""
    rng = np.random.default_rng([36, seed])
    n = disk.disk_points
    positions = disk.positions.copy()
    positions[:n, 1] *= aspect
    is_inside = (disk.bonds < n).all(axis=1)
    stiffness = np.where(is_inside, rng.uniform(0.7, 1.4, len(disk.bonds)), 1.0)
    masses = disk.masses.copy()
    masses[:n] *= rng.uniform(0.7, 1.4, n)
    masses[:n] /= masses[:n].sum()
    i, j = disk.bonds.T
    lengths = np.hypot(*(positions[i] - positions[j]).T)
    return replace(
        disk,
        positions=positions,
        masses=masses,
        stiffness=stiffness,
        rest_lengths=np.where(is_inside, lengths, disk.rest_lengths),
    )


class ShortOnly:
    """A kernel cache that refuses scenes of more than `most_work`."""

    compile_seconds = 0.0
    max_time = math.inf

    def __init__(self, kernels, most_work):
        self.kernels = kernels
        self.most_work = most_work

    def simulation(self, lattice, model, integrator, velocities, dt):
        if len(lattice.bonds) * self.max_time / dt > self.most_work:
            raise SimulationError(TOO_LONG)
        return self.kernels.simulation(lattice, model, integrator, velocities, dt)


def fate(number, kernels):
    """Run a wild scene, and return how it ended and its fault, "" if none."""

    def prepare():
        scene = wild_scene(number)
        scenario = load_scene(*scene[:2]).scenario()
        kernels.max_time = scenario.max_time
        return scenario

    with patch(
        "taichi_disk.experiments.computation.driver.shared_kernels", lambda: kernels
    ):
        verdict = judge(prepare, estimate=False)
    if verdict.text == TOO_LONG:
        return replace(verdict, end="long", text=""), ""
    if verdict.end == "stopped" and not KEY.search(verdict.text):
        return verdict, f"no remedy: {verdict.text}"
    return verdict, _fault(verdict.summary) if verdict.end == "done" else ""


def _fault(summary):
    value = summary.get("restitution", summary.get("xi", math.nan))
    energy = summary.get("energy")
    if not math.isfinite(value):
        return f"the result is {value}"
    if energy is None:
        return ""
    if not abs(energy["closing_imbalance"]) <= MAX_IMBALANCE:
        return f"the energy imbalance is {energy['closing_imbalance']:.2g}"
    gain = max(0.0, -energy["sliding"] / energy["scale"]) + 2e-3
    if "restitution" in summary and not 0.0 < value <= math.sqrt(1.0 + gain):
        return f"e = {value}"
    return ""
